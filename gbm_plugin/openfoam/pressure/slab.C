#include "slab.H"
#include "coupledPolyPatch.H"
#include "volFields.H"

// * * * * * * * * * * * * * * * * Constructors  * * * * * * * * * * * * * * //

Foam::slab::slab(const fvMesh& mesh)
{
    checkPatches(mesh);
    findPlaces(mesh);

    layers_ = places_.size()/(n_.x()*n_.y());
    block_ = returnReduce(layers_, maxOp<label>());
    checkDecomposition();

    const label first = min(n_.z(), block_*Pstream::myProcNo());
    for (Vector<label>& place : places_)
    {
        place.z() -= first;
    }
}


// * * * * * * * * * * * * * Private Member Functions  * * * * * * * * * * * //

void Foam::slab::checkPatches(const fvMesh& mesh) const
{
    for (const polyPatch& patch : mesh.boundaryMesh())
    {
        const label faces = returnReduce(patch.size(), sumOp<label>());
        const coupledPolyPatch* coupled = isA<coupledPolyPatch>(patch);

        if (faces && (!coupled || !coupled->parallel()))
        {
            FatalErrorInFunction
                << "patch '" << patch.name() << "' is of type "
                << patch.type() << (coupled ? " with a rotation" : "")
                << ": periodicFFT needs a box that is cyclic, by translation,"
                << " in all three directions" << exit(FatalError);
        }
    }
}


void Foam::slab::findPlaces(const fvMesh& mesh)
{
    const vector L(mesh.bounds().span());
    vector h(vector::max);

    if (mesh.nCells())
    {
        const labelList corners(mesh.cells()[0].labels(mesh.faces()));
        h = boundBox(mesh.points(), corners, false).span();
    }
    reduce(h, minOp<vector>());

    for (direction d = 0; d < vector::nComponents; ++d)
    {
        n_[d] = label(std::round(L[d]/h[d]));
        h[d] = L[d]/n_[d];
    }

    const double all = double(n_.x())*double(n_.y())*double(n_.z());
    bool uniform = (all == double(returnReduce(mesh.nCells(), sumOp<label>())));

    places_.setSize(mesh.nCells());
    forAll(places_, celli)
    {
        const vector x(mesh.cellCentres()[celli] - mesh.bounds().min());

        for (direction d = 0; d < vector::nComponents; ++d)
        {
            const scalar s = x[d]/h[d] - 0.5;
            const label i = label(std::round(s));
            uniform = uniform && mag(s - i) < 1e-5 && 0 <= i && i < n_[d];
            places_[celli][d] = i;
        }
        uniform = uniform
         && mag(mesh.V()[celli]/(h.x()*h.y()*h.z()) - 1) < 1e-5;
    }

    if (!returnReduce(uniform, andOp<bool>()))
    {
        FatalErrorInFunction
            << "the mesh is not a whole, axis-aligned box of equal cells:"
            << " periodicFFT needs a uniform mesh" << exit(FatalError);
    }
}


void Foam::slab::checkDecomposition() const
{
    const label first = min(n_.z(), block_*Pstream::myProcNo());

    // on the box's lattice, as many different places as it has are all of it
    bool slabs = (layers_ == min(block_, n_.z() - first));
    slabs = slabs && places_.size() == n_.x()*n_.y()*layers_;
    for (const Vector<label>& place : places_)
    {
        slabs = slabs && first <= place.z() && place.z() < first + layers_;
    }

    if (!returnReduce(slabs, andOp<bool>()))
    {
        FatalErrorInFunction
            << "the ranks do not hold whole layers of z, equally many and in"
            << " their order, which periodicFFT needs; in decomposeParDict,"
            << " with a number of ranks that divides " << n_.z()
            << " layers, use: method simple; simpleCoeffs { n (1 1 "
            << Pstream::nProcs() << "); }" << exit(FatalError);
    }
}
