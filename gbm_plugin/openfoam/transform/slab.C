#include "slab.H"

// * * * * * * * * * * * * * * * * Constructors  * * * * * * * * * * * * * * //

Foam::slab::slab(const fvMesh& mesh)
:
    places_(mesh.nCells())
{
    const uniformBox& box = uniformBox::New(mesh);
    if (!box.problem().empty())
    {
        FatalErrorInFunction
            << "Fourier transforms need a uniform, periodic box: "
            << box.problem().c_str() << exit(FatalError);
    }

    n_ = box.cells();
    forAll(places_, celli)
    {
        places_[celli] = box.place(celli);
    }

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
            << " their order, which Fourier transforms need; in decomposeParDict,"
            << " with a number of ranks that divides " << n_.z()
            << " layers, use: method simple; simpleCoeffs { n (1 1 "
            << Pstream::nProcs() << "); }" << exit(FatalError);
    }
}
