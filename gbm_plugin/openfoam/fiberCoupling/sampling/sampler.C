#include "sampler.H"
#include "interpolants.H"
#include "latticeSampler.H"
#include "schemeSampler.H"
#include "interpolation.H"
#include "FlatOutput.H"

Foam::autoPtr<Foam::sampler> Foam::sampler::New
(
    const dictionary& fiberProperties,
    const fvMesh& mesh
)
{
    const word scheme =
        fiberProperties.lookupOrDefault<word>("interpolation", "trilinear");

    if (scheme == "trilinear" || scheme == "cubic" || scheme == "quintic")
    {
        const string& problem = uniformBox::New(mesh).problem();
        if (!problem.empty())
        {
            FatalIOErrorInFunction(fiberProperties)
                << "interpolation " << scheme << " needs a box of equal cells,"
                << " which this mesh is not (" << problem.c_str() << "); use"
                << " one of OpenFOAM's own schemes, as cellPoint"
                << exit(FatalIOError);
        }
        if (scheme == "cubic")
        {
            return autoPtr<sampler>(new latticeSampler<cubic>(mesh));
        }
        if (scheme == "quintic")
        {
            return autoPtr<sampler>(new latticeSampler<quintic>(mesh));
        }
        return autoPtr<sampler>(new latticeSampler<trilinear>(mesh));
    }

    if (!interpolation<vector>::dictionaryConstructorTablePtr_->found(scheme))
    {
        FatalIOErrorInFunction(fiberProperties)
            << "interpolation '" << scheme << "' is unknown to OpenFOAM;"
            << " allowed: trilinear cubic quintic "
            << flatOutput
               (
                   interpolation<vector>::dictionaryConstructorTablePtr_
                 ->sortedToc()
               )
            << exit(FatalIOError);
    }

    return autoPtr<sampler>(new schemeSampler(scheme));
}
