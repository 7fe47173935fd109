#include "lattice.H"

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

    labelList remoteSlots;
    labelList remoteNumbers;
    l->layOut(remoteSlots, remoteNumbers);
    l->connect(remoteSlots, remoteNumbers);
    l->divide();

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
        perCell_[d] = 1/h_[d];
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
        i[d] = label((p[d] - box_.min()[d])*perCell_[d]);
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


Foam::Vector<Foam::label> Foam::lattice::coarsePlace
(
    const Vector<label>& i
) const
{
    return Vector<label>
    (
        i.x()/coarse_.x(), i.y()/coarse_.y(), i.z()/coarse_.z()
    );
}


void Foam::lattice::layOut(labelList& remoteSlots, labelList& remoteNumbers)
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
    blocks_.setSize(Pstream::nProcs());
    blocks_[Pstream::myProcNo()] = {first_, last};

    first_ -= layers*Vector<label>::one;
    last += layers*Vector<label>::one;
    extent_ = last - first_ + Vector<label>::one;
    slots_.setSize(extent_.x()*extent_.y()*extent_.z(), -1);

    // local cells by number, then every slot around them
    Map<label> local(2*centres.size());
    forAll(centres, celli)
    {
        local.insert(number(place(centres[celli])), celli);
    }

    DynamicList<label> slots;
    DynamicList<label> numbers;

    forAll(centres, celli)
    {
        const Vector<label> c(place(centres[celli]));

        for (label k = -layers; k <= layers; ++k)
        for (label j = -layers; j <= layers; ++j)
        for (label i = -layers; i <= layers; ++i)
        {
            const Vector<label> neighbour(c + Vector<label>(i, j, k));
            label& s = slots_[slot(neighbour)];

            if (s == -1)
            {
                s = local.lookup(number(neighbour), -1);

                if (s == -1)
                {
                    s = -2;     // asked for
                    slots.append(slot(neighbour));
                    numbers.append(number(neighbour));
                }
            }
        }
    }

    remoteSlots.transfer(slots);
    remoteNumbers.transfer(numbers);
}


// * * * * * * * * * * * * * * * Member Functions  * * * * * * * * * * * * * //

Foam::List<Foam::DynamicList<Foam::label>> Foam::lattice::candidates
(
    const UList<point>& points
) const
{
    List<DynamicList<label>> result(Pstream::nProcs());
    result[Pstream::myProcNo()].reserve(points.size());

    forAll(points, p)
    {
        const Vector<label> i(place(points[p]));
        const Vector<label> c(coarsePlace(i));

        for
        (
            const label rank :
            ranks_[c.x() + nCoarse_.x()*(c.y() + nCoarse_.y()*c.z())]
        )
        {
            const Vector<label>& first = blocks_[rank].first();
            const Vector<label>& last = blocks_[rank].second();

            if
            (
                first.x() <= i.x() && i.x() <= last.x()
             && first.y() <= i.y() && i.y() <= last.y()
             && first.z() <= i.z() && i.z() <= last.z()
            )
            {
                result[rank].append(p);
            }
        }
    }

    return result;
}


Foam::label Foam::lattice::findCell(const point& p) const
{
    const label celli = slots_[slot(place(p))];

    return celli < mesh_.nCells() ? celli : -1;
}


const Foam::label* Foam::lattice::around
(
    const point& p,
    vector& weights
) const
{
    Vector<label> lower;

    for (direction d = 0; d < vector::nComponents; ++d)
    {
        // the box's lower corner is at 0, so that x + 1 is positive
        const scalar x = (p[d] - box_.min()[d])*perCell_[d] - 0.5;
        lower[d] = label(x + 1) - 1;
        weights[d] = x - lower[d];
    }

    return slots_.cdata() + slot(lower);
}
