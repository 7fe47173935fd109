#include "flowStatistics.H"
#include "fvc.H"
#include "fvMesh.H"
#include "surfaceFields.H"

namespace
{

using namespace Foam;

//- Whether a scheme of fvSchemes is made of these words; the last may be one
//  of several
bool isScheme
(
    const ITstream& scheme,
    const wordList& words,
    const wordList& last
)
{
    if (scheme.size() != words.size() + 1)
    {
        return false;
    }
    for (const token& t : static_cast<const tokenList&>(scheme))
    {
        if (!t.isWord())
        {
            return false;
        }
    }
    forAll(words, i)
    {
        if (scheme[i].wordToken() != words[i])
        {
            return false;
        }
    }
    return last.found(scheme[words.size()].wordToken());
}


//- Values on the other side of a coupled patch, or on any other patch itself
tmp<vectorField> outside(const fvPatchVectorField& U)
{
    return U.coupled() ? U.patchNeighbourField() : tmp<vectorField>(U);
}


//- Sum of |grad U|^2 V with linear face values, as Gauss linear has it
scalar sumMagSqrGrad(const volVectorField& U)
{
    const fvMesh& mesh = U.mesh();
    const labelUList& owner = mesh.owner();
    const labelUList& neighbour = mesh.neighbour();
    const vectorField& Sf = mesh.Sf();
    const scalarField& weights = mesh.weights();
    const scalarField& V = mesh.V();

    tensorField sum(mesh.nCells(), Zero);

    forAll(owner, facei)
    {
        const vector& up = U[owner[facei]];
        const vector& un = U[neighbour[facei]];
        const tensor flux(Sf[facei]*(weights[facei]*(up - un) + un));
        sum[owner[facei]] += flux;
        sum[neighbour[facei]] -= flux;
    }

    for (const fvPatchVectorField& Up : U.boundaryField())
    {
        const label patchi = Up.patch().index();
        const labelUList& cells = Up.patch().faceCells();
        const vectorField& Sfp = mesh.Sf().boundaryField()[patchi];
        const scalarField& w = mesh.weights().boundaryField()[patchi];
        const tmp<vectorField> tun(outside(Up));
        const vectorField& un = tun();

        forAll(Up, i)
        {
            const scalar wi = Up.coupled() ? w[i] : 0;
            sum[cells[i]] += Sfp[i]*(wi*(U[cells[i]] - un[i]) + un[i]);
        }
    }

    scalar total = 0;
    forAll(sum, celli)
    {
        total += magSqr(sum[celli])/V[celli];
    }
    return total;
}


//- Sum of -(U - mean) . laplacian(U) V with uncorrected face gradients, summed
//  by parts: of each face inside remains |difference|^2
scalar sumDissipation
(
    const volVectorField& U,
    const surfaceScalarField& deltaCoeffs,
    const vector& mean
)
{
    const fvMesh& mesh = U.mesh();
    const labelUList& owner = mesh.owner();
    const labelUList& neighbour = mesh.neighbour();
    const scalarField& magSf = mesh.magSf();

    scalar total = 0;
    forAll(owner, facei)
    {
        total +=
            magSf[facei]*deltaCoeffs[facei]
           *magSqr(U[neighbour[facei]] - U[owner[facei]]);
    }

    for (const fvPatchVectorField& Up : U.boundaryField())
    {
        const label patchi = Up.patch().index();
        const labelUList& cells = Up.patch().faceCells();
        const scalarField& magSfp = mesh.magSf().boundaryField()[patchi];
        const tmp<vectorField> tgradient
        (
            Up.coupled()
          ? Up.snGrad(deltaCoeffs.boundaryField()[patchi])
          : Up.snGrad()
        );
        const vectorField& gradient = tgradient();

        forAll(Up, i)
        {
            total -= magSfp[i]*((U[cells[i]] - mean) & gradient[i]);
        }
    }
    return total;
}


scalar totalMagSqrGrad(const volVectorField& U)
{
    const fvMesh& mesh = U.mesh();

    if (isScheme(mesh.gradScheme("grad(" + U.name() + ')'), {"Gauss"}, {"linear"}))
    {
        return returnReduce(sumMagSqrGrad(U), sumOp<scalar>());
    }
    return gSum(magSqr(fvc::grad(U)().primitiveField())*mesh.V().field());
}


scalar totalDissipation(const volVectorField& U, const vector& mean)
{
    const fvMesh& mesh = U.mesh();

    // the name under which the laminar momentum equation finds its scheme
    const word name("laplacian(nuEff," + U.name() + ')');
    const ITstream& scheme = mesh.laplacianScheme(name);

    if (isScheme(scheme, {"Gauss", "linear"}, {"orthogonal", "uncorrected"}))
    {
        const surfaceScalarField& deltaCoeffs =
            scheme[2].wordToken() == "orthogonal"
          ? mesh.deltaCoeffs()
          : mesh.nonOrthDeltaCoeffs();

        return returnReduce
        (
            sumDissipation(U, deltaCoeffs, mean),
            sumOp<scalar>()
        );
    }

    const tmp<volVectorField> laplacian(fvc::laplacian(U, name));
    return
       -gSum
        (
            ((U.primitiveField() - mean) & laplacian().primitiveField())
           *mesh.V().field()
        );
}

}


Foam::vector Foam::flowStatistics::average(const volVectorField& U)
{
    const scalarField& V = U.mesh().V();

    scalar volume = 0;
    vector total(Zero);
    forAll(V, celli)
    {
        volume += V[celli];
        total += V[celli]*U[celli];
    }
    reduce(volume, sumOp<scalar>());
    reduce(total, sumOp<vector>());

    return total/volume;
}


Foam::flowStatistics::flowStatistics
(
    const volVectorField& U,
    const scalar nu,
    const bool dissipation
)
:
    mean(average(U))
{
    const scalarField& V = U.mesh().V();

    scalar volume = 0;
    scalar energy = 0;
    forAll(V, celli)
    {
        volume += V[celli];
        energy += V[celli]*magSqr(U[celli] - mean);
    }
    reduce(volume, sumOp<scalar>());
    reduce(energy, sumOp<scalar>());

    k = 0.5*energy/volume;
    if (!dissipation)
    {
        return;
    }
    epsilonGradient = nu*totalMagSqrGrad(U)/volume;
    epsilonLaplacian = nu*totalDissipation(U, mean)/volume;
}
