#include "sampler.H"
#include "trilinearSampler.H"
#include "schemeSampler.H"
#include "interpolation.H"
#include "FlatOutput.H"

Foam::autoPtr<Foam::sampler> Foam::sampler::New
(
    const dictionary& fiberProperties,
    const fvMesh& mesh,
    const periodicBox& box
)
{
    const word scheme =
        fiberProperties.lookupOrDefault<word>("interpolation", "trilinear");

    autoPtr<lattice> places(lattice::New(mesh, box));

    if (scheme == "trilinear")
    {
        if (!places.valid())
        {
            FatalIOErrorInFunction(fiberProperties)
                << "interpolation trilinear needs a box of equal cells, which"
                << " this mesh is not; use one of OpenFOAM's own schemes, as"
                << " cellPoint" << exit(FatalIOError);
        }
        return autoPtr<sampler>
        (
            new trilinearSampler(mesh, box, std::move(places))
        );
    }

    if (!interpolation<vector>::dictionaryConstructorTablePtr_->found(scheme))
    {
        FatalIOErrorInFunction(fiberProperties)
            << "interpolation '" << scheme << "' is unknown to OpenFOAM;"
            << " allowed: trilinear "
            << flatOutput
               (
                   interpolation<vector>::dictionaryConstructorTablePtr_
                 ->sortedToc()
               )
            << exit(FatalIOError);
    }

    return autoPtr<sampler>
    (
        new schemeSampler(scheme, mesh, box, std::move(places))
    );
}


Foam::sampler::sampler
(
    const fvMesh& mesh,
    const periodicBox& box,
    autoPtr<lattice>&& places
)
:
    mesh_(mesh),
    box_(box),
    lattice_(std::move(places))
{}


void Foam::sampler::locate(const UList<point>& positions)
{
    indices_.clear();
    points_.clear();
    cells_.clear();

    if (!lattice_.valid())
    {
        searchCells(positions);
        return;
    }

    forAll(positions, i)
    {
        const point p(box_.wrap(positions[i]));
        const label celli = lattice_->findCell(p);

        if (celli != -1)
        {
            indices_.append(i);
            points_.append(p);
            cells_.append(celli);
        }
    }
}


void Foam::sampler::searchCells(const UList<point>& positions)
{
    // A point on a face between ranks may be found by both or, by rounding,
    // by none: the lowest rank takes it, else the one with the nearest cell
    labelList found(positions.size());
    labelList owner(positions.size(), labelMax);

    forAll(positions, i)
    {
        found[i] = mesh_.findCell(box_.wrap(positions[i]));
        if (found[i] != -1)
        {
            owner[i] = Pstream::myProcNo();
        }
    }
    Pstream::listCombineGather(owner, minEqOp<label>());
    Pstream::listCombineScatter(owner);

    forAll(positions, i)
    {
        const point p(box_.wrap(positions[i]));

        if (owner[i] == labelMax)
        {
            const label nearest = mesh_.nCells() ? mesh_.findNearestCell(p) : -1;
            const scalar distance =
                nearest < 0 ? GREAT : mag(mesh_.cellCentres()[nearest] - p);
            const scalar least = returnReduce(distance, minOp<scalar>());
            owner[i] = returnReduce
            (
                distance == least ? Pstream::myProcNo() : labelMax,
                minOp<label>()
            );
            found[i] = nearest;
        }
        if (owner[i] == Pstream::myProcNo())
        {
            indices_.append(i);
            points_.append(p);
            cells_.append(found[i]);
        }
    }
}
