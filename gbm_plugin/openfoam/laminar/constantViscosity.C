#include "constantViscosity.H"
#include "kinematicViscosity.H"
#include "addToRunTimeSelectionTable.H"
#include "fvmLaplacian.H"

namespace Foam
{
namespace laminarModels
{
    defineTypeNameAndDebug(constantViscosity, 0);

    typedef incompressible::laminarModel incompressibleLaminarModel;

    addToRunTimeSelectionTable
    (
        incompressibleLaminarModel,
        constantViscosity,
        dictionary
    );
}
}


Foam::laminarModels::constantViscosity::constantViscosity
(
    const geometricOneField& alpha,
    const geometricOneField& rho,
    const volVectorField& U,
    const surfaceScalarField& alphaRhoPhi,
    const surfaceScalarField& phi,
    const Foam::transportModel& transport,
    const word& propertiesName
)
:
    Base(alpha, rho, U, alphaRhoPhi, phi, transport, propertiesName)
{
    // at once, and not when the first step has begun
    kinematicViscosity(U.mesh());
}


Foam::tmp<Foam::fvVectorMatrix>
Foam::laminarModels::constantViscosity::divDevRhoReff(volVectorField& U) const
{
    const dimensionedScalar nu
    (
        "nu",
        dimViscosity,
        kinematicViscosity(U.mesh())
    );

    return -fvm::laplacian(nu, U, "laplacian(nuEff," + U.name() + ')');
}
