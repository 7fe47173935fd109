#include "locator.H"
#include "cellSearch.H"
#include "lattice.H"

const Foam::locator& Foam::locator::of(const fvMesh& mesh)
{
    if (uniformBox::New(mesh).problem().empty())
    {
        return lattice::New(mesh);
    }
    return cellSearch::New(mesh);
}
