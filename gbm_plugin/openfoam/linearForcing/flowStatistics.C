#include "flowStatistics.H"
#include "fvc.H"
#include "fvMesh.H"

namespace
{

Foam::scalar volumeAverage
(
    const Foam::scalarField& f,
    const Foam::fvMesh& mesh
)
{
    const Foam::scalarField& V = mesh.V();
    return Foam::gSumProd(f, V)/Foam::gSum(V);
}

}


Foam::vector Foam::flowStatistics::average(const volVectorField& U)
{
    const scalarField& V = U.mesh().V();
    return gSum(V*U.primitiveField())/gSum(V);
}


Foam::scalar Foam::flowStatistics::energy
(
    const volVectorField& U,
    const vector& mean
)
{
    return 0.5*volumeAverage(magSqr(U.primitiveField() - mean), U.mesh());
}


Foam::flowStatistics::flowStatistics(const volVectorField& U, const scalar nu)
:
    mean(average(U)),
    k(energy(U, mean))
{
    const fvMesh& mesh = U.mesh();

    epsilonGradient =
        nu*volumeAverage(magSqr(fvc::grad(U)().primitiveField()), mesh);

    // the name under which the laminar momentum equation finds its scheme
    const tmp<volVectorField> laplacian =
        fvc::laplacian
        (
            dimensionedScalar("nu", dimViscosity, nu),
            U,
            "laplacian(nuEff,U)"
        );

    epsilonLaplacian =
       -volumeAverage
        (
            (U.primitiveField() - mean) & laplacian().primitiveField(),
            mesh
        );
}
