#include "sampler.H"
#include "cellSearch.H"
#include "interpolants.H"
#include "latticeSampler.H"
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

    autoPtr<lattice> cells(lattice::New(mesh, box));

    if (scheme == "trilinear" || scheme == "cubic")
    {
        if (!cells.valid())
        {
            FatalIOErrorInFunction(fiberProperties)
                << "interpolation " << scheme << " needs a box of equal cells,"
                << " which this mesh is not; use one of OpenFOAM's own"
                << " schemes, as cellPoint" << exit(FatalIOError);
        }
        if (scheme == "cubic")
        {
            return autoPtr<sampler>
            (
                new latticeSampler<cubic>(std::move(cells))
            );
        }
        return autoPtr<sampler>
        (
            new latticeSampler<trilinear>(std::move(cells))
        );
    }

    if (!interpolation<vector>::dictionaryConstructorTablePtr_->found(scheme))
    {
        FatalIOErrorInFunction(fiberProperties)
            << "interpolation '" << scheme << "' is unknown to OpenFOAM;"
            << " allowed: trilinear cubic "
            << flatOutput
               (
                   interpolation<vector>::dictionaryConstructorTablePtr_
                 ->sortedToc()
               )
            << exit(FatalIOError);
    }

    autoPtr<locator> places;
    if (cells.valid())
    {
        places.reset(cells.ptr());
    }
    else
    {
        places.reset(new cellSearch(mesh));
    }

    return autoPtr<sampler>(new schemeSampler(scheme, std::move(places)));
}
