#include "lattice.H"
#include <vector>

namespace Foam
{
    defineTypeNameAndDebug(lattice, 0);
}


// * * * * * * * * * * * * * * * * Constructors  * * * * * * * * * * * * * * //

Foam::lattice::lattice(const fvMesh& mesh)
:
    MeshObject<fvMesh, Foam::GeometricMeshObject, lattice>(mesh),
    box_(uniformBox::New(mesh))
{
    if (!box_.problem().empty())
    {
        FatalErrorInFunction
            << "a lattice needs a uniform, periodic box: "
            << box_.problem().c_str() << exit(FatalError);
    }

    labelList remoteSlots;
    labelList remoteNumbers;
    layOut(remoteSlots, remoteNumbers);
    connect(remoteSlots, remoteNumbers);
    measureRuns();
    divide();
}


// * * * * * * * * * * * * * Private Member Functions  * * * * * * * * * * * //

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
    const label nCells = mesh_.nCells();

    first_ = Vector<label>::zero;
    Vector<label> last(-Vector<label>::one);

    for (label celli = 0; celli < nCells; ++celli)
    {
        const Vector<label> i(box_.place(celli));
        first_ = celli ? min(first_, i) : i;
        last = celli ? max(last, i) : i;
    }
    blocks_.setSize(Pstream::nProcs());
    blocks_[Pstream::myProcNo()] = {first_, last};

    first_ -= layers*Vector<label>::one;
    last += layers*Vector<label>::one;
    extent_ = last - first_ + Vector<label>::one;
    slots_.setSize(extent_.x()*extent_.y()*extent_.z(), -1);

    Map<label> local(2*nCells);
    std::vector<char> near(slots_.size(), char(0));
    for (label celli = 0; celli < nCells; ++celli)
    {
        const Vector<label> i(box_.place(celli));
        local.insert(box_.number(i), celli);
        slots_[slot(i)] = celli;
        near[slot(i)] = 1;
    }

    // widened by some layers in one direction after the other
    for (direction d = 0; d < vector::nComponents; ++d)
    {
        const std::vector<char> inside(near);
        forAll(slots_, s)
        {
            for (label m = -layers; inside[s] && m <= layers; ++m)
            {
                near[s + m*strides()[d]] = 1;
            }
        }
    }

    DynamicList<label> slots;
    DynamicList<label> numbers;

    forAll(slots_, s)
    {
        if (near[s] && slots_[s] == -1)
        {
            const Vector<label> i
            (
                s % extent_.x(),
                (s/extent_.x()) % extent_.y(),
                s/(extent_.x()*extent_.y())
            );
            const label number = box_.number(first_ + i);
            slots_[s] = local.lookup(number, -1);

            if (slots_[s] == -1)
            {
                slots.append(s);
                numbers.append(number);
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

    // counted and put in the order of their blocks
    labelList block(points.size());
    labelList starts(ranks_.size() + 1, Zero);
    forAll(points, p)
    {
        const Vector<label> c(coarsePlace(box_.place(points[p])));
        block[p] = c.x() + nCoarse_.x()*(c.y() + nCoarse_.y()*c.z());
        ++starts[block[p] + 1];
    }
    for (label b = 1; b < starts.size(); ++b)
    {
        starts[b] += starts[b - 1];
    }
    labelList order(points.size());
    forAll(points, p)
    {
        order[starts[block[p]]++] = p;
    }

    for (const label p : order)
    {
        const labelList& ranks = ranks_[block[p]];
        if (ranks.size() == 1)
        {
            result[ranks[0]].append(p);
            continue;
        }

        const Vector<label> i(box_.place(points[p]));
        for (const label rank : ranks)
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


void Foam::lattice::addBack
(
    const List<vector>& values,
    vectorField& cellValues,
    filledParts& filled
) const
{
    if (!Pstream::parRun())
    {
        return;
    }

    // those that hold something, mostly few, with their places
    PstreamBuffers buffers(Pstream::commsTypes::nonBlocking);
    label start = 0;
    forAll(received_, rank)
    {
        if (received_[rank])
        {
            DynamicList<label> places;
            DynamicList<vector> some;
            for (label i = 0; i < received_[rank]; ++i)
            {
                const vector& value = values[start + i];
                if (value != vector::zero)
                {
                    places.append(i);
                    some.append(value);
                }
            }
            start += received_[rank];

            UOPstream to(rank, buffers);
            to  << static_cast<const labelUList&>(places)
                << static_cast<const UList<vector>&>(some);
        }
    }
    buffers.finishedSends();

    forAll(sent_, rank)
    {
        if (sent_[rank].size())
        {
            UIPstream from(rank, buffers);
            const labelList places(from);
            const List<vector> added(from);
            forAll(added, i)
            {
                const label celli = sent_[rank][places[i]];
                filled.mark(celli, 1);
                cellValues[celli] += added[i];
            }
        }
    }
}


Foam::label Foam::lattice::findCell(const point& p) const
{
    const label celli = slots_[slot(box_.place(p))];

    return celli < mesh_.nCells() ? celli : -1;
}


Foam::label Foam::lattice::around
(
    const point& p,
    vector& weights
) const
{
    // from the lowest centre; rounded down, as x + 1 is positive
    const vector x(box_.inCells(p) - vector::uniform(0.5));
    Vector<label> lower;

    for (direction d = 0; d < vector::nComponents; ++d)
    {
        lower[d] = label(x[d] + 1) - 1;
        weights[d] = x[d] - lower[d];
    }

    return slot(lower);
}
