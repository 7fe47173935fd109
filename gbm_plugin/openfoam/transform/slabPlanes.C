#include "slabPlanes.H"

// * * * * * * * * * * * * * * * * Constructors  * * * * * * * * * * * * * * //

Foam::slabPlanes::slabPlanes
(
    const slab& cells,
    const label components,
    const label width
)
:
    components_(components),
    width_(width),
    ny_(cells.n().y()),
    block_(cells.block()),
    layers_(Pstream::nProcs() + 1),
    rows_(Pstream::nProcs() + 1),
    planes_(size_t(components)*max(label(1), cells.layers())*ny_*width)
{
    const label ranks = Pstream::nProcs();
    const label rowBlock = (ny_ + ranks - 1)/ranks;

    for (label rank = 0; rank <= ranks; ++rank)
    {
        layers_[rank] = min(cells.n().z(), rank*block_);
        rows_[rank] = min(ny_, rank*rowBlock);
    }
    layOutMessages();
}


Foam::slabPlanes::~slabPlanes()
{
    for (MPI_Datatype& type : rowsOf_)
    {
        MPI_Type_free(&type);
    }
}


// * * * * * * * * * * * * * Private Member Functions  * * * * * * * * * * * //

void Foam::slabPlanes::layOutMessages()
{
    const label ranks = Pstream::nProcs();
    const label me = Pstream::myProcNo();

    bool any = false;
    for (label rank = 0; rank < ranks; ++rank)
    {
        any = any || !planes_.of(rank);
    }
    if (!returnReduce(any, orOp<bool>()))
    {
        return;
    }

    const label row = components_*width_;
    const label nPlanes = components_*(layers_[me + 1] - layers_[me]);

    distant_.setSize(row*nRows()*layers_[ranks]);
    numbers_.setSize(ranks, MPI_DOUBLE);
    rowsOf_.setSize(ranks);
    planeCounts_.setSize(ranks);
    planeStarts_.setSize(ranks);
    distantCounts_.setSize(ranks);
    distantStarts_.setSize(ranks);

    for (label rank = 0; rank < ranks; ++rank)
    {
        const bool far = !planes_.of(rank);
        const label nRanksRows = rows_[rank + 1] - rows_[rank];
        const label nRanksLayers = layers_[rank + 1] - layers_[rank];

        // in bytes
        MPI_Type_create_hvector
        (
            nPlanes, nRanksRows*width_, sizeof(double)*ny_*width_,
            MPI_DOUBLE, &rowsOf_[rank]
        );
        MPI_Type_commit(&rowsOf_[rank]);
        planeCounts_[rank] = far && nPlanes && nRanksRows;
        planeStarts_[rank] = sizeof(double)*rows_[rank]*width_;
        distantCounts_[rank] = far ? row*nRows()*nRanksLayers : 0;
        distantStarts_[rank] = sizeof(double)*row*nRows()*layers_[rank];
    }
}


double* Foam::slabPlanes::planeOf
(
    const label rank,
    const label z,
    const label component
) const
{
    return
        planes_.of(rank) + (size_t(z)*components_ + component)*ny_*width_;
}


// * * * * * * * * * * * * * * * Member Functions  * * * * * * * * * * * * * //

Foam::label Foam::slabPlanes::nRows() const
{
    return rows_[Pstream::myProcNo() + 1] - rows_[Pstream::myProcNo()];
}


Foam::label Foam::slabPlanes::firstRow() const
{
    return rows_[Pstream::myProcNo()];
}


double* Foam::slabPlanes::row
(
    const label z,
    const label component,
    const label y
)
{
    const label rank = z/block_;

    return
        planes_.of(rank)
      ? planeOf(rank, z - layers_[rank], component)
      + size_t(firstRow() + y)*width_
      : distant_.begin()
      + ((size_t(z)*components_ + component)*nRows() + y)*width_;
}


void Foam::slabPlanes::toRows()
{
    planes_.meet();
    if (rowsOf_.size())
    {
        MPI_Alltoallw
        (
            planes_.of(Pstream::myProcNo()),
            planeCounts_.cdata(), planeStarts_.cdata(), rowsOf_.cdata(),
            distant_.begin(),
            distantCounts_.cdata(), distantStarts_.cdata(), numbers_.cdata(),
            MPI_COMM_WORLD
        );
    }
}


void Foam::slabPlanes::toPlanes()
{
    if (rowsOf_.size())
    {
        MPI_Alltoallw
        (
            distant_.cdata(),
            distantCounts_.cdata(), distantStarts_.cdata(), numbers_.cdata(),
            planes_.of(Pstream::myProcNo()),
            planeCounts_.cdata(), planeStarts_.cdata(), rowsOf_.cdata(),
            MPI_COMM_WORLD
        );
    }
    planes_.meet();
}
