#include "leanCubic.H"
#include "fvMesh.H"

namespace Foam
{
    defineTypeNameAndDebug(leanCubic, 0);

    surfaceInterpolationScheme<vector>::addMeshConstructorToTable<leanCubic>
        addleanCubicMeshConstructorToTable_;

    surfaceInterpolationScheme<vector>::addMeshFluxConstructorToTable<leanCubic>
        addleanCubicMeshFluxConstructorToTable_;
}

namespace
{

using namespace Foam;

//- The cubic through the values up, un and the slopes (per length d) sp, sn
//  on both sides of a face of weight w, less the line through up, un
vector cubicLessLinear
(
    const scalar w,
    const vector& up,
    const vector& un,
    const vector& sp,
    const vector& sn
)
{
    return
        w*(1 - w*(3 - 2*w))*(up - un)
      + sqr(1 - w)*w*sp
      + sqr(w)*(w - 1)*sn;
}

}


Foam::tmp<Foam::surfaceVectorField> Foam::leanCubic::correction
(
    const volVectorField& U
) const
{
    const fvMesh& mesh = this->mesh();
    const labelUList& owner = mesh.owner();
    const labelUList& neighbour = mesh.neighbour();
    const surfaceScalarField& weights = mesh.weights();
    const surfaceVectorField& Sf = mesh.Sf();
    const surfaceScalarField& magSf = mesh.magSf();
    const surfaceScalarField& deltaCoeffs = mesh.deltaCoeffs();

    const tmp<volTensorField> tgradient(fv::gaussGrad<vector>(mesh).grad(U));
    const volTensorField& gradient = tgradient();

    tmp<surfaceVectorField> tcorrection
    (
        new surfaceVectorField
        (
            IOobject
            (
                "leanCubic::correction(" + U.name() + ')',
                mesh.time().timeName(),
                mesh,
                IOobject::NO_READ,
                IOobject::NO_WRITE,
                false
            ),
            mesh,
            dimensioned<vector>(U.dimensions(), Zero)
        )
    );
    surfaceVectorField& correction = tcorrection.ref();
    vectorField& inside = correction.primitiveFieldRef();

    forAll(owner, facei)
    {
        const label p = owner[facei];
        const label n = neighbour[facei];
        const vector d(Sf[facei]/(magSf[facei]*deltaCoeffs[facei]));

        inside[facei] = cubicLessLinear
        (
            weights[facei], U[p], U[n], d & gradient[p], d & gradient[n]
        );
    }

    for (fvsPatchVectorField& values : correction.boundaryFieldRef())
    {
        const label patchi = values.patch().index();
        const fvPatchVectorField& Up = U.boundaryField()[patchi];

        if (!Up.coupled())
        {
            continue;
        }

        const fvPatchTensorField& gp = gradient.boundaryField()[patchi];
        const tmp<vectorField> tup(Up.patchInternalField());
        const tmp<vectorField> tun(Up.patchNeighbourField());
        const tmp<tensorField> tgradientp(gp.patchInternalField());
        const tmp<tensorField> tgradientn(gp.patchNeighbourField());
        const vectorField d
        (
            Sf.boundaryField()[patchi]
           /(magSf.boundaryField()[patchi]*deltaCoeffs.boundaryField()[patchi])
        );

        forAll(values, i)
        {
            values[i] = cubicLessLinear
            (
                weights.boundaryField()[patchi][i],
                tup()[i],
                tun()[i],
                d[i] & tgradientp()[i],
                d[i] & tgradientn()[i]
            );
        }
    }

    return tcorrection;
}
