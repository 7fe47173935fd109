#include "slabTransform.H"

#include <fftw3.h>
#include <mpi.h>

namespace
{
    constexpr unsigned planning = FFTW_ESTIMATE;

    fftw_complex* modes(double* numbers)
    {
        return reinterpret_cast<fftw_complex*>(numbers);
    }
}


// * * * * * * * * * * * * * * * * Constructors  * * * * * * * * * * * * * * //

Foam::slabTransform::slabTransform
(
    const slab& cells,
    const label components,
    const label rowStride
)
:
    n_(cells.n()),
    components_(components),
    width_(2*(n_.x()/2 + 1)),
    layers_(Pstream::nProcs() + 1),
    rows_(Pstream::nProcs() + 1),
    planeCounts_(Pstream::nProcs()),
    planeStarts_(Pstream::nProcs()),
    columnCounts_(Pstream::nProcs()),
    columnStarts_(Pstream::nProcs())
{
    const label ranks = Pstream::nProcs();
    const label rowBlock = (n_.y() + ranks - 1)/ranks;

    for (label rank = 0; rank <= ranks; ++rank)
    {
        layers_[rank] = min(n_.z(), rank*cells.block());
        rows_[rank] = min(n_.y(), rank*rowBlock);
    }

    for (label rank = 0; rank < ranks; ++rank)
    {
        const label row = components*width_;
        planeCounts_[rank] = cells.layers()*row*(rows_[rank + 1] - rows_[rank]);
        planeStarts_[rank] = cells.layers()*row*rows_[rank];
        columnCounts_[rank] = nRows()*row*(layers_[rank + 1] - layers_[rank]);
        columnStarts_[rank] = nRows()*row*layers_[rank];
    }
    // what is here already stays in its planes
    planeCounts_[Pstream::myProcNo()] = 0;
    columnCounts_[Pstream::myProcNo()] = 0;

    const size_t perLayer = size_t(components)*n_.y()*width_;
    const size_t perRow = size_t(components)*n_.z()*width_;
    planes_ = fftw_alloc_real(perLayer*max(label(1), cells.layers()));
    columns_ =
        Pstream::parRun()
      ? fftw_alloc_real(perRow*max(label(1), nRows()))
      : nullptr;
    plane_ = fftw_alloc_real(size_t(n_.y())*width_);

    plan(rowStride);
}


Foam::slabTransform::~slabTransform()
{
    fftw_destroy_plan(planeForward_);
    fftw_destroy_plan(planeBackward_);
    fftw_destroy_plan(columnForward_);
    fftw_destroy_plan(columnBackward_);
    fftw_free(plane_);
    fftw_free(columns_);
    fftw_free(planes_);
}


// * * * * * * * * * * * * * Private Member Functions  * * * * * * * * * * * //

void Foam::slabTransform::plan(const label rowStride)
{
    const int nModes = width_/2;

    // planes
    {
        const int n[] = {n_.y(), n_.x()};
        const int there[] = {n_.y(), n_.x()};
        const int back[] = {n_.y(), rowStride};
        const int spectrum[] = {n_.y(), nModes};
        double* plane = fftw_alloc_real(size_t(n_.y())*rowStride);

        planeForward_ = fftw_plan_many_dft_r2c
        (
            2, n, 1, plane, there, 1, 0, modes(plane_), spectrum, 1, 0,
            planning
        );
        planeBackward_ = fftw_plan_many_dft_c2r
        (
            2, n, 1, modes(plane_), spectrum, 1, 0, plane, back, 1, 0,
            planning
        );
        fftw_free(plane);
    }

    // all components of a column at once
    {
        const fftw_iodim along[] = {{n_.z(), nModes, nModes}};
        const int size = n_.z()*nModes;
        const fftw_iodim many[] = {{components_, size, size}, {nModes, 1, 1}};
        double* column = fftw_alloc_real(columnSize());

        columnForward_ = fftw_plan_guru_dft
        (
            1, along, 2, many, modes(column), modes(column),
            FFTW_FORWARD, planning
        );
        columnBackward_ = fftw_plan_guru_dft
        (
            1, along, 2, many, modes(column), modes(column),
            FFTW_BACKWARD, planning
        );
        fftw_free(column);
    }
}


double* Foam::slabTransform::rowsFor
(
    const label rank,
    const label z,
    const label component
) const
{
    const size_t nRanksRows = rows_[rank + 1] - rows_[rank];

    return
        planes_ + planeStarts_[rank]
      + (z*components_ + component)*nRanksRows*width_;
}


double* Foam::slabTransform::rowAt
(
    const label z,
    const label component,
    const label y
) const
{
    const label me = Pstream::myProcNo();

    return
        layers_[me] <= z && z < layers_[me + 1]
      ? rowsFor(me, z - layers_[me], component) + size_t(y)*width_
      : columns_
      + ((size_t(z)*components_ + component)*nRows() + y)*width_;
}


// * * * * * * * * * * * * * * * Member Functions  * * * * * * * * * * * * * //

Foam::label Foam::slabTransform::nRows() const
{
    return rows_[Pstream::myProcNo() + 1] - rows_[Pstream::myProcNo()];
}


Foam::label Foam::slabTransform::firstRow() const
{
    return rows_[Pstream::myProcNo()];
}


void Foam::slabTransform::planeForward
(
    const double* plane,
    const label z,
    const label component
)
{
    // FFTW keeps the input of such a transform, though it does not say const
    double* input = const_cast<double*>(plane);

    if (!Pstream::parRun())
    {
        fftw_execute_dft_r2c
        (
            planeForward_, input, modes(rowsFor(0, z, component))
        );
        return;
    }

    fftw_execute_dft_r2c(planeForward_, input, modes(plane_));
    for (label rank = 0; rank < Pstream::nProcs(); ++rank)
    {
        std::copy
        (
            plane_ + size_t(rows_[rank])*width_,
            plane_ + size_t(rows_[rank + 1])*width_,
            rowsFor(rank, z, component)
        );
    }
}


void Foam::slabTransform::toColumns()
{
    if (Pstream::parRun())
    {
        MPI_Alltoallv
        (
            planes_, planeCounts_.cdata(), planeStarts_.cdata(), MPI_DOUBLE,
            columns_, columnCounts_.cdata(), columnStarts_.cdata(), MPI_DOUBLE,
            MPI_COMM_WORLD
        );
    }
}


void Foam::slabTransform::columnForward(const label y, double* column) const
{
    double* row = column;
    for (label c = 0; c < components_; ++c)
    for (label z = 0; z < n_.z(); ++z, row += width_)
    {
        std::copy_n(rowAt(z, c, y), width_, row);
    }
    fftw_execute_dft(columnForward_, modes(column), modes(column));
}


void Foam::slabTransform::columnBackward(const label y, double* column)
{
    fftw_execute_dft(columnBackward_, modes(column), modes(column));
    const double* row = column;
    for (label c = 0; c < components_; ++c)
    for (label z = 0; z < n_.z(); ++z, row += width_)
    {
        std::copy_n(row, width_, rowAt(z, c, y));
    }
}


void Foam::slabTransform::toPlanes()
{
    if (Pstream::parRun())
    {
        MPI_Alltoallv
        (
            columns_, columnCounts_.cdata(), columnStarts_.cdata(), MPI_DOUBLE,
            planes_, planeCounts_.cdata(), planeStarts_.cdata(), MPI_DOUBLE,
            MPI_COMM_WORLD
        );
    }
}


void Foam::slabTransform::planeBackward
(
    double* plane,
    const label z,
    const label component
)
{
    if (!Pstream::parRun())
    {
        fftw_execute_dft_c2r
        (
            planeBackward_, modes(rowsFor(0, z, component)), plane
        );
        return;
    }

    for (label rank = 0; rank < Pstream::nProcs(); ++rank)
    {
        const double* rows = rowsFor(rank, z, component);
        const size_t size = size_t(rows_[rank + 1] - rows_[rank])*width_;
        std::copy_n(rows, size, plane_ + size_t(rows_[rank])*width_);
    }
    fftw_execute_dft_c2r(planeBackward_, modes(plane_), plane);
}
