#include "uniformBox.H"
#include "periodicBox.H"
#include "volFields.H"

namespace Foam
{
    defineTypeNameAndDebug(uniformBox, 0);
}


Foam::uniformBox::uniformBox(const fvMesh& mesh)
:
    MeshObject<fvMesh, Foam::GeometricMeshObject, uniformBox>(mesh),
    min_(mesh.bounds().min()),
    n_(Zero),
    h_(Zero),
    perCell_(Zero),
    problem_(periodicBox::problem(mesh))
{
    if (problem_.empty())
    {
        problem_ = measure(mesh.bounds().span());
    }
}


Foam::string Foam::uniformBox::measure(const vector& L)
{
    vector h(vector::max);

    if (mesh_.nCells())
    {
        h = boundBox(mesh_.points(), mesh_.cellPoints()[0], false).span();
    }
    reduce(h, minOp<vector>());

    double all = 1;
    for (direction d = 0; d < vector::nComponents; ++d)
    {
        // a graded mesh may have any ratio
        n_[d] = label(min(max(std::round(L[d]/h[d]), 1.0), double(labelMax)));
        h_[d] = L[d]/n_[d];
        perCell_[d] = 1/h_[d];
        all *= n_[d];
    }
    bool uniform = (all == double(returnReduce(mesh_.nCells(), sumOp<label>())));

    // each cell fills its place
    const vectorField& centres = mesh_.cellCentres();
    forAll(centres, celli)
    {
        const vector s(inCells(centres[celli]) - vector::uniform(0.5));

        for (direction d = 0; d < vector::nComponents; ++d)
        {
            uniform = uniform && mag(s[d] - std::round(s[d])) < 1e-5;
        }
        uniform = uniform
         && mag(mesh_.V()[celli]/(h_.x()*h_.y()*h_.z()) - 1) < 1e-5;
    }

    return
        returnReduce(uniform, andOp<bool>())
      ? string()
      : string("its cells are not all of one size, in rows along x, y and z");
}


Foam::Vector<Foam::label> Foam::uniformBox::place(const point& p) const
{
    const vector x(inCells(p));
    Vector<label> i;

    for (direction d = 0; d < vector::nComponents; ++d)
    {
        i[d] = max(label(0), Foam::min(n_[d] - 1, label(x[d])));
    }

    return i;
}


Foam::label Foam::uniformBox::number(const Vector<label>& place) const
{
    Vector<label> i;

    for (direction d = 0; d < vector::nComponents; ++d)
    {
        i[d] = (place[d] % n_[d] + n_[d]) % n_[d];
    }

    return i.x() + n_.x()*(i.y() + n_.y()*i.z());
}


Foam::direction Foam::uniformBox::normal(const label facei) const
{
    const vector area(cmptMag(mesh_.faceAreas()[facei]));

    return
        area.x() > 0.5*mag(area) ? vector::X
      : area.y() > 0.5*mag(area) ? vector::Y : vector::Z;
}
