#include "periodicBox.H"
#include "cyclicPolyPatch.H"
#include "volFields.H"

Foam::periodicBox::periodicBox(const fvMesh& mesh)
:
    bounds_(mesh.bounds())
{
    for (const polyPatch& patch : mesh.boundaryMesh())
    {
        const label faces = returnReduce(patch.size(), sumOp<label>());

        if (faces && !patch.coupled())
        {
            FatalErrorInFunction
                << "patch '" << patch.name() << "' is of type "
                << patch.type() << " with " << faces
                << " faces: fibers need a box that is periodic (cyclic) in"
                << " all three directions" << exit(FatalError);
        }

        const cyclicPolyPatch* cyclic = isA<cyclicPolyPatch>(patch);
        if (cyclic && patch.size() && !cyclic->parallel())
        {
            FatalErrorInFunction
                << "patch '" << patch.name() << "' is cyclic with a rotation:"
                << " fibers need translational periodicity"
                << exit(FatalError);
        }
    }

    const scalar volume = gSum(mesh.V().field());
    const vector L = span();

    if (mag(volume/(L.x()*L.y()*L.z()) - 1) > 1e-6)
    {
        FatalErrorInFunction
            << "the mesh fills " << volume << " m3 of its bounding box of "
            << L.x()*L.y()*L.z() << " m3: fibers need a mesh that is a whole,"
            << " axis-aligned box" << exit(FatalError);
    }
}


bool Foam::periodicBox::fills(const fvMesh& mesh)
{
    for (const polyPatch& patch : mesh.boundaryMesh())
    {
        const label faces = returnReduce(patch.size(), sumOp<label>());
        const cyclicPolyPatch* cyclic = isA<cyclicPolyPatch>(patch);
        const bool turned = cyclic && patch.size() && !cyclic->parallel();

        if (faces && (!patch.coupled() || returnReduce(turned, orOp<bool>())))
        {
            return false;
        }
    }

    const vector L(mesh.bounds().span());

    return mag(gSum(mesh.V().field())/(L.x()*L.y()*L.z()) - 1) <= 1e-6;
}


Foam::point Foam::periodicBox::wrap(const point& p) const
{
    const vector L = span();
    point q;

    for (direction d = 0; d < vector::nComponents; ++d)
    {
        if (min()[d] <= p[d] && p[d] < max()[d])
        {
            q[d] = p[d];
            continue;
        }

        const scalar x = (p[d] - min()[d])/L[d];
        const scalar y = min()[d] + L[d]*(x - std::floor(x));

        // rounding may land on the upper face, which is the lower one
        q[d] = (y < max()[d] ? y : min()[d]);
    }

    return q;
}
