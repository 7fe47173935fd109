#include "leanCubic.H"
#include "fvMesh.H"
#include "latticeFaces.H"

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


//- The correction by the slopes on both sides of each face, on any mesh
void fromSlopes(const volVectorField& U, surfaceVectorField& correction)
{
    const fvMesh& mesh = U.mesh();
    const labelUList& owner = mesh.owner();
    const labelUList& neighbour = mesh.neighbour();
    const surfaceScalarField& weights = mesh.weights();
    const surfaceVectorField& Sf = mesh.Sf();
    const surfaceScalarField& magSf = mesh.magSf();
    const surfaceScalarField& deltaCoeffs = mesh.deltaCoeffs();

    const tmp<volTensorField> tgradient(fv::gaussGrad<vector>(mesh).grad(U));
    const volTensorField& gradient = tgradient();

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
}


//- The correction by the four cells in a row of a uniform mesh
void fromRows
(
    const volVectorField& U,
    const latticeFaces& faces,
    surfaceVectorField& correction
)
{
    const vectorField& cells = U.primitiveField();
    const List<vector> neighbours(faces.cells().gather(cells));
    const label nCells = cells.size();
    const label* slots = faces.cells().slots().cdata();

    const auto value = [&](const label slot) -> const vector&
    {
        const label i = slots[slot];
        return i < nCells ? cells[i] : neighbours[i - nCells];
    };
    const auto atFace = [&](const label facei)
    {
        const label p = faces.owner(facei);
        const label step = faces.step(facei);

        return
            (1.0/16)
           *(
                (value(p) + value(p + step))
              - (value(p - step) + value(p + 2*step))
            );
    };

    vectorField& inside = correction.primitiveFieldRef();
    forAll(inside, facei)
    {
        inside[facei] = atFace(facei);
    }

    for (fvsPatchVectorField& values : correction.boundaryFieldRef())
    {
        const label start = values.patch().start();
        forAll(values, i)
        {
            values[i] = atFace(start + i);
        }
    }
}

}


Foam::tmp<Foam::surfaceVectorField> Foam::leanCubic::correction
(
    const volVectorField& U
) const
{
    const fvMesh& mesh = this->mesh();

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

    if (uniformBox::New(mesh).problem().empty())
    {
        fromRows(U, latticeFaces::New(mesh), tcorrection.ref());
    }
    else
    {
        fromSlopes(U, tcorrection.ref());
    }

    return tcorrection;
}
