#include "beadExchange.H"
#include "besideSolver.H"
#include "PstreamBuffers.H"

// * * * * * * * * * * * * * * * * Constructors  * * * * * * * * * * * * * * //

Foam::beadExchange::beadExchange(const periodicBox& box, const locator& places)
:
    box_(box),
    places_(places),
    brought_(0),
    starts_(Pstream::nProcs() + 1, Zero)
{}


// * * * * * * * * * * * * * Private Member Functions  * * * * * * * * * * * //

template<class PointList>
void Foam::beadExchange::take
(
    const labelUList& numbers,
    const PointList& points
)
{
    const label capacity = numbers_.size() + numbers.size();
    numbers_.reserve(capacity);
    points_.reserve(capacity);
    cells_.reserve(capacity);

    forAll(numbers, i)
    {
        const label celli = places_.findCell(points[i]);

        if (celli != -1)
        {
            numbers_.append(numbers[i]);
            points_.append(points[i]);
            cells_.append(celli);
        }
    }
}


// * * * * * * * * * * * * * * * Member Functions  * * * * * * * * * * * * * //

void Foam::beadExchange::locate(List<point>&& positions)
{
    List<point> wrapped(std::move(positions));
    brought_ = wrapped.size();
    numbers_.clear();
    points_.clear();
    cells_.clear();

    for (point& p : wrapped)
    {
        p = box_.wrap(p);
    }
    const List<DynamicList<label>> candidates(places_.candidates(wrapped));
    const label me = Pstream::myProcNo();

    PstreamBuffers buffers(Pstream::commsTypes::nonBlocking);
    labelList received(Pstream::nProcs(), Zero);    // bytes from each rank
    if (Pstream::parRun())
    {
        forAll(candidates, rank)
        {
            if (rank != me && candidates[rank].size())
            {
                UOPstream to(rank, buffers);
                to  << static_cast<const labelUList&>(candidates[rank])
                    << List<point>
                       (
                           UIndirectList<point>(wrapped, candidates[rank])
                       );
            }
        }
        buffers.finishedSends(received);
    }

    forAll(candidates, rank)
    {
        starts_[rank] = numbers_.size();
        if (rank == me)
        {
            take
            (
                candidates[me],
                UIndirectList<point>(wrapped, candidates[me])
            );
        }
        else if (received[rank])
        {
            UIPstream from(rank, buffers);
            const labelList numbers(from);
            const List<point> points(from);
            take(numbers, points);
        }
    }
    starts_.last() = numbers_.size();
}


Foam::label Foam::beadExchange::rankOf(const label i) const
{
    label rank = 0;
    while (starts_[rank + 1] <= i)
    {
        ++rank;
    }
    return rank;
}


Foam::scalarList Foam::beadExchange::collect
(
    scalarList&& sampled,
    const label n
) const
{
    // in their places already, and not a second list of all
    if (!Pstream::parRun() && numbers_.size() == brought_)
    {
        return std::move(sampled);
    }

    const label me = Pstream::myProcNo();
    scalarList result(brought_*n);
    label found = 0;

    const auto put = [&](const labelUList& numbers, const scalar* values)
    {
        for (const label number : numbers)
        {
            std::copy_n(values, n, result.begin() + n*number);
            values += n;
        }
        found += numbers.size();
    };
    const auto numbersFor = [&](const label rank)
    {
        return SubList<label>
        (
            numbers_, starts_[rank + 1] - starts_[rank], starts_[rank]
        );
    };

    put(numbersFor(me), sampled.cdata() + n*starts_[me]);

    found_.setSize(Pstream::nProcs());
    found_ = labelList();
    found_[me] = numbersFor(me);
    if (Pstream::parRun())
    {
        PstreamBuffers buffers(Pstream::commsTypes::nonBlocking);
        labelList received;
        for (label rank = 0; rank < Pstream::nProcs(); ++rank)
        {
            const SubList<label> numbers(numbersFor(rank));
            if (rank != me && numbers.size())
            {
                UOPstream to(rank, buffers);
                to  << static_cast<const labelUList&>(numbers)
                    << static_cast<const UList<scalar>&>
                       (
                           SubList<scalar>
                           (
                               sampled, n*numbers.size(), n*starts_[rank]
                           )
                       );
            }
        }
        buffers.finishedSends(received);

        for (label rank = 0; rank < Pstream::nProcs(); ++rank)
        {
            if (rank != me && received[rank])
            {
                UIPstream from(rank, buffers);
                from >> found_[rank];
                const scalarList values(from);
                put(found_[rank], values.cdata());
            }
        }
    }

    if (found != brought_)
    {
        besideSolver::fail
        (
            std::to_string(found) + " of " + std::to_string(brought_)
          + " beads were found in the mesh"
        );
    }

    return result;
}


Foam::scalarList Foam::beadExchange::distribute
(
    scalarList&& values,
    const label n
) const
{
    if (!Pstream::parRun())
    {
        return std::move(values);
    }

    const auto valuesOf = [&](const labelUList& numbers)
    {
        scalarList some(n*numbers.size());
        scalar* out = some.begin();
        for (const label number : numbers)
        {
            out = std::copy_n(values.cdata() + n*number, n, out);
        }
        return some;
    };

    const label me = Pstream::myProcNo();
    PstreamBuffers buffers(Pstream::commsTypes::nonBlocking);
    forAll(found_, rank)
    {
        if (rank != me && found_[rank].size())
        {
            UOPstream to(rank, buffers);
            to << valuesOf(found_[rank]);
        }
    }
    buffers.finishedSends();

    scalarList result(n*numbers_.size());
    for (label rank = 0; rank < Pstream::nProcs(); ++rank)
    {
        const label count = n*(starts_[rank + 1] - starts_[rank]);
        if (!count)
        {
            continue;
        }
        SubList<scalar> part(result, count, n*starts_[rank]);
        if (rank == me)
        {
            part = valuesOf(found_[me]);
        }
        else
        {
            UIPstream from(rank, buffers);
            const scalarList own(from);
            part = own;
        }
    }

    return result;
}
