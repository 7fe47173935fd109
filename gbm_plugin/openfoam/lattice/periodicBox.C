#include "periodicBox.H"
#include "coupledPolyPatch.H"
#include "volFields.H"

Foam::periodicBox::periodicBox(const fvMesh& mesh)
:
    bounds_(mesh.bounds())
{
    const string why(problem(mesh));

    if (!why.empty())
    {
        FatalErrorInFunction
            << "fibers need a periodic box: " << why.c_str()
            << exit(FatalError);
    }
}


Foam::string Foam::periodicBox::problem(const fvMesh& mesh)
{
    // Patches between ranks are other ones, and other numbers of them, on
    // each rank: what all ranks do is done for the rest, which all ranks have
    const polyBoundaryMesh& patches = mesh.boundaryMesh();
    const label nPatches = patches.nNonProcessor();
    labelList wrong(nPatches, Zero);

    for (label patchi = 0; patchi < nPatches; ++patchi)
    {
        const auto* coupled = isA<coupledPolyPatch>(patches[patchi]);
        if (!coupled || !coupled->parallel())
        {
            wrong[patchi] = patches[patchi].size();
        }
    }
    Pstream::listCombineGather(wrong, plusEqOp<label>());
    Pstream::listCombineScatter(wrong);

    const scalar volume = gSum(mesh.V().field());
    const vector L(mesh.bounds().span());

    OStringStream why;
    for (label patchi = 0; patchi < nPatches; ++patchi)
    {
        if (wrong[patchi])
        {
            why << "patch '" << patches[patchi].name() << "' is of type "
                << patches[patchi].type() << " with " << wrong[patchi]
                << (patches[patchi].coupled() ? " turned faces" : " faces")
                << " and not periodic (cyclic) in all three directions, by"
                << " translation";
            return why.str();
        }
    }
    if (mag(volume/(L.x()*L.y()*L.z()) - 1) > 1e-6)
    {
        why << "the mesh fills " << volume << " m3 of its bounding box of "
            << L.x()*L.y()*L.z() << " m3 and is not a whole, axis-aligned box";
    }
    return why.str();
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
