#include "kinematicViscosity.H"
#include "IOdictionary.H"
#include "dimensionedScalar.H"

Foam::scalar Foam::kinematicViscosity(const objectRegistry& mesh)
{
    const dictionary& transport =
        mesh.lookupObject<IOdictionary>("transportProperties");

    const word model =
        transport.lookupOrDefault<word>("transportModel", "Newtonian");

    if (model != "Newtonian")
    {
        FatalIOErrorInFunction(transport)
            << "transportModel '" << model
            << "': fibers, statistics and constantViscosity need a fluid of"
            << " constant viscosity, Newtonian"
            << exit(FatalIOError);
    }

    const dimensionedScalar nu("nu", dimViscosity, transport);

    if (nu.value() <= 0)
    {
        FatalIOErrorInFunction(transport)
            << "nu = " << nu.value() << " must be positive"
            << exit(FatalIOError);
    }

    return nu.value();
}
