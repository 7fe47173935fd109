#include "latticeFaces.H"

namespace Foam
{
    defineTypeNameAndDebug(latticeFaces, 0);
}


Foam::latticeFaces::latticeFaces(const fvMesh& mesh)
:
    MeshObject<fvMesh, Foam::GeometricMeshObject, latticeFaces>(mesh)
{
    if (!periodicBox::fills(mesh))
    {
        return;
    }
    box_.reset(new periodicBox(mesh));
    lattice_ = lattice::New(mesh, box_());
    if (!lattice_.valid())
    {
        return;
    }

    const Vector<label> strides(lattice_->strides());
    owners_.setSize(mesh.nFaces());
    steps_.setSize(mesh.nFaces());

    forAll(owners_, facei)
    {
        const vector area(mesh.faceAreas()[facei]);
        const vector size(cmptMag(area));
        const direction d =
            size.x() > 0.5*mag(area) ? vector::X
          : size.y() > 0.5*mag(area) ? vector::Y : vector::Z;

        owners_[facei] = lattice_->slotOf(mesh.faceOwner()[facei]);
        steps_[facei] = area[d] > 0 ? strides[d] : -strides[d];
    }
}
