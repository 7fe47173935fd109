#include "cellSearch.H"

namespace Foam
{
    defineTypeNameAndDebug(cellSearch, 0);
}


Foam::labelList Foam::cellSearch::owners(const UList<point>& points) const
{
    // A point on a face between ranks may be found by both or, by rounding,
    // by none: the lowest rank takes it, else the one with the nearest cell
    labelList owner(points.size(), labelMax);

    forAll(points, i)
    {
        if (mesh_.findCell(points[i]) != -1)
        {
            owner[i] = Pstream::myProcNo();
        }
    }
    Pstream::listCombineGather(owner, minEqOp<label>());
    Pstream::listCombineScatter(owner);

    forAll(points, i)
    {
        if (owner[i] == labelMax)
        {
            const label nearest =
                mesh_.nCells() ? mesh_.findNearestCell(points[i]) : -1;
            const scalar distance =
                nearest < 0
              ? GREAT
              : mag(mesh_.cellCentres()[nearest] - points[i]);
            const scalar least = returnReduce(distance, minOp<scalar>());
            owner[i] = returnReduce
            (
                distance == least ? Pstream::myProcNo() : labelMax,
                minOp<label>()
            );
        }
    }

    return owner;
}


Foam::List<Foam::DynamicList<Foam::label>> Foam::cellSearch::candidates
(
    const UList<point>& points
) const
{
    List<List<point>> all(Pstream::nProcs());
    all[Pstream::myProcNo()] = points;
    Pstream::gatherList(all);
    Pstream::scatterList(all);

    List<DynamicList<label>> result(Pstream::nProcs());
    forAll(all, rank)
    {
        const labelList owner(owners(all[rank]));
        if (rank == Pstream::myProcNo())
        {
            forAll(owner, i)
            {
                result[owner[i]].append(i);
            }
        }
    }

    return result;
}


Foam::label Foam::cellSearch::findCell(const point& p) const
{
    const label celli = mesh_.findCell(p);

    return celli < 0 ? mesh_.findNearestCell(p) : celli;
}
