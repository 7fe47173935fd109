#include "latticeFaces.H"

namespace Foam
{
    defineTypeNameAndDebug(latticeFaces, 0);
}


Foam::latticeFaces::latticeFaces(const fvMesh& mesh)
:
    MeshObject<fvMesh, Foam::GeometricMeshObject, latticeFaces>(mesh),
    cells_(lattice::New(mesh)),
    owners_(mesh.nFaces()),
    steps_(mesh.nFaces())
{
    const Vector<label> strides(cells_.strides());

    forAll(owners_, facei)
    {
        const direction d = cells_.box().normal(facei);
        const scalar area = mesh.faceAreas()[facei][d];

        owners_[facei] = cells_.slotOf(mesh.faceOwner()[facei]);
        steps_[facei] = area > 0 ? strides[d] : -strides[d];
    }
}
