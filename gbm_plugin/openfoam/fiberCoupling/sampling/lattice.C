#include "lattice.H"
#include "globalIndex.H"
#include "PstreamBuffers.H"

// * * * * * * * * * * * * * * * * Constructors  * * * * * * * * * * * * * * //

Foam::autoPtr<Foam::lattice> Foam::lattice::New
(
    const fvMesh& mesh,
    const periodicBox& box
)
{
    autoPtr<lattice> l(new lattice(mesh, box));

    if (!l->measure())
    {
        return nullptr;
    }
    l->connect();
    return l;
}


// * * * * * * * * * * * * * Private Member Functions  * * * * * * * * * * * //

bool Foam::lattice::measure()
{
    vector h(vector::max);

    if (mesh_.nCells())
    {
        const boundBox cell(mesh_.points(), mesh_.cellPoints()[0], false);
        h = cell.span();
    }
    reduce(h, minOp<vector>());

    for (direction d = 0; d < vector::nComponents; ++d)
    {
        n_[d] = label(std::round(box_.span()[d]/h[d]));
        h_[d] = box_.span()[d]/n_[d];
    }

    const double all = double(n_.x())*double(n_.y())*double(n_.z());
    bool uniform = (all == double(returnReduce(mesh_.nCells(), sumOp<label>())));

    // each cell fills its place
    forAll(mesh_.cellCentres(), celli)
    {
        const vector x(mesh_.cellCentres()[celli] - box_.min());

        for (direction d = 0; d < vector::nComponents; ++d)
        {
            const scalar s = x[d]/h_[d] - 0.5;
            uniform = uniform && mag(s - std::round(s)) < 1e-5;
        }
        uniform = uniform
         && mag(mesh_.V()[celli]/(h_.x()*h_.y()*h_.z()) - 1) < 1e-5;
    }

    return returnReduce(uniform, andOp<bool>());
}


Foam::Vector<Foam::label> Foam::lattice::place(const point& p) const
{
    Vector<label> i;

    for (direction d = 0; d < vector::nComponents; ++d)
    {
        i[d] = label(std::floor((p[d] - box_.min()[d])/h_[d]));
        i[d] = max(label(0), min(n_[d] - 1, i[d]));
    }

    return i;
}


Foam::label Foam::lattice::number(const Vector<label>& place) const
{
    Vector<label> i;

    for (direction d = 0; d < vector::nComponents; ++d)
    {
        i[d] = (place[d] + n_[d]) % n_[d];
    }

    return i.x() + n_.x()*(i.y() + n_.y()*i.z());
}


Foam::label Foam::lattice::slot(const Vector<label>& place) const
{
    const Vector<label> i(place - first_);

    return i.x() + extent_.x()*(i.y() + extent_.y()*i.z());
}


Foam::labelList Foam::lattice::globalCells
(
    const globalIndex& cells,
    const labelUList& numbers
) const
{
    // A directory spread over the ranks: rank r keeps the numbers of its
    // equal share. Every cell reports there; then the directory is read.
    const label total = n_.x()*n_.y()*n_.z();
    const label share = (total + Pstream::nProcs() - 1)/Pstream::nProcs();
    const label mine =
        max(label(0), min(share, total - share*Pstream::myProcNo()));
    const globalIndex directory(mine);

    List<DynamicList<labelPair>> reports(Pstream::nProcs());
    forAll(mesh_.cellCentres(), celli)
    {
        const label i = number(place(mesh_.cellCentres()[celli]));
        reports[i/share].append(labelPair(i % share, cells.toGlobal(celli)));
    }

    PstreamBuffers buffers(Pstream::commsTypes::nonBlocking);
    forAll(reports, rank)
    {
        UOPstream to(rank, buffers);
        to << reports[rank];
    }
    buffers.finishedSends();

    labelList entries(mine, -1);
    forAll(reports, rank)
    {
        UIPstream from(rank, buffers);
        const List<labelPair> pairs(from);
        for (const labelPair& pair : pairs)
        {
            entries[pair.first()] = pair.second();
        }
    }

    // share*rank + offset is the directory's own global numbering, as all
    // shares before the last one are full
    labelList wanted(numbers);
    List<Map<label>> compact;
    const mapDistribute map(directory, wanted, compact);
    map.distribute(entries);

    return labelList(UIndirectList<label>(entries, wanted));
}


void Foam::lattice::connect()
{
    const vectorField& centres = mesh_.cellCentres();

    first_ = Vector<label>::zero;
    Vector<label> last(-Vector<label>::one);

    forAll(centres, celli)
    {
        const Vector<label> i(place(centres[celli]));
        first_ = celli ? min(first_, i) : i;
        last = celli ? max(last, i) : i;
    }
    first_ -= Vector<label>::one;
    last += Vector<label>::one;
    extent_ = last - first_ + Vector<label>::one;
    slots_.setSize(extent_.x()*extent_.y()*extent_.z(), -1);

    // local cells by number, then every slot around them
    Map<label> local(2*centres.size());
    forAll(centres, celli)
    {
        local.insert(number(place(centres[celli])), celli);
    }

    DynamicList<label> remoteSlots;
    DynamicList<label> remoteNumbers;

    forAll(centres, celli)
    {
        const Vector<label> c(place(centres[celli]));

        for (label k = -1; k <= 1; ++k)
        for (label j = -1; j <= 1; ++j)
        for (label i = -1; i <= 1; ++i)
        {
            const Vector<label> neighbour(c + Vector<label>(i, j, k));
            label& s = slots_[slot(neighbour)];

            if (s == -1)
            {
                const label cell = local.lookup(number(neighbour), -1);
                s = cell;

                if (cell == -1)
                {
                    s = -2;     // asked for
                    remoteSlots.append(slot(neighbour));
                    remoteNumbers.append(number(neighbour));
                }
            }
        }
    }

    const globalIndex cells(mesh_.nCells());
    labelList elements(globalCells(cells, remoteNumbers));
    List<Map<label>> compact;
    map_.reset(new mapDistribute(cells, elements, compact));

    forAll(remoteSlots, i)
    {
        slots_[remoteSlots[i]] = elements[i];
    }
}


// * * * * * * * * * * * * * * * Member Functions  * * * * * * * * * * * * * //

Foam::label Foam::lattice::findCell(const point& p) const
{
    const Vector<label> i(place(p));

    for (direction d = 0; d < vector::nComponents; ++d)
    {
        if (i[d] <= first_[d] || i[d] >= first_[d] + extent_[d] - 1)
        {
            return -1;
        }
    }

    const label value = slots_[slot(i)];

    return value < mesh_.nCells() ? value : -1;
}


void Foam::lattice::stencil
(
    const point& p,
    FixedList<label, 8>& values,
    FixedList<scalar, 8>& weights
) const
{
    Vector<label> lower;
    vector w;

    for (direction d = 0; d < vector::nComponents; ++d)
    {
        const scalar x = (p[d] - box_.min()[d])/h_[d] - 0.5;
        lower[d] = label(std::floor(x));
        w[d] = x - lower[d];
    }

    const label s = slot(lower);

    for (label corner = 0; corner < 8; ++corner)
    {
        const label i = corner & 1, j = (corner >> 1) & 1, k = corner >> 2;

        values[corner] = slots_[s + i + extent_.x()*(j + extent_.y()*k)];
        weights[corner] =
            (i ? w.x() : 1 - w.x())
           *(j ? w.y() : 1 - w.y())
           *(k ? w.z() : 1 - w.z());
    }
}
