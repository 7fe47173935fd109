#include "periodicLaplacian.H"
#include "mathematicalConstants.H"
#include "volFields.H"

namespace Foam
{
    defineTypeNameAndDebug(periodicLaplacian, 0);
}


// * * * * * * * * * * * * * * * * Constructors  * * * * * * * * * * * * * * //

Foam::periodicLaplacian::periodicLaplacian(const fvMesh& mesh)
:
    MeshObject<fvMesh, Foam::GeometricMeshObject, periodicLaplacian>(mesh),
    cells_(mesh),
    transform_(cells_, 1, cells_.n().x()),
    directions_(mesh.nFaces()),
    nFaces_(Zero),
    elements_(mesh.nCells()),
    planes_(mesh.nCells()),
    column_(transform_.columnSize())
{
    const Vector<label>& n = cells_.n();

    forAll(elements_, celli)
    {
        const Vector<label>& i = cells_.places()[celli];
        elements_[celli] = i.x() + n.x()*(i.y() + n.y()*i.z());
    }

    forAll(directions_, facei)
    {
        directions_[facei] = uniformBox::New(mesh).normal(facei);
        nFaces_[directions_[facei]] += 1;
    }
    reduce(nFaces_, sumOp<vector>());

    const double nCells = double(n.x())*n.y()*n.z();
    for (direction d = 0; d < vector::nComponents; ++d)
    {
        symbols_[d].setSize(n[d]);
        forAll(symbols_[d], i)
        {
            const double s = std::sin(constant::mathematical::pi*i/n[d]);
            symbols_[d][i] = 4*s*s*nCells;
        }
    }
}


// * * * * * * * * * * * * * Private Member Functions  * * * * * * * * * * * //

void Foam::periodicLaplacian::divideByEigenvalues
(
    const label y,
    const vector& c
) const
{
    const label first = transform_.firstRow() + y;
    const scalarList& x = symbols_[vector::X];
    double* row = column_.begin();

    for (label z = 0; z < cells_.n().z(); ++z, row += transform_.width())
    {
        const double rest =
            c.y()*symbols_[vector::Y][first] + c.z()*symbols_[vector::Z][z];

        for (label i = 0; 2*i < transform_.width(); ++i)
        {
            // the mean has the eigenvalue zero, and is left out
            const bool mean = (first == 0 && z == 0 && i == 0);
            const double factor = mean ? 0 : -1/(c.x()*x[i] + rest);
            row[2*i] *= factor;
            row[2*i + 1] *= factor;
        }
    }
}


// * * * * * * * * * * * * * * * Member Functions  * * * * * * * * * * * * * //

Foam::vector Foam::periodicLaplacian::meanCoefficients
(
    const lduMatrix& matrix,
    const FieldField<Field, scalar>& interfaceBouCoeffs,
    const lduInterfaceFieldPtrsList& interfaces
) const
{
    const scalarField& upper = matrix.upper();
    vector sums(Zero);

    forAll(upper, facei)
    {
        sums[directions_[facei]] += upper[facei];
    }
    forAll(interfaces, patchi)
    {
        // coefficients of an interface stand on the other side
        const label start = mesh_.boundaryMesh()[patchi].start();
        forAll(interfaceBouCoeffs[patchi], i)
        {
            sums[directions_[start + i]] -= interfaceBouCoeffs[patchi][i];
        }
    }
    reduce(sums, sumOp<vector>());

    return cmptDivide(sums, nFaces_);
}


void Foam::periodicLaplacian::solve
(
    solveScalarField& x,
    const vector& coefficients
) const
{
    const label layer = cells_.n().x()*cells_.n().y();

    forAll(elements_, celli)
    {
        planes_[elements_[celli]] = x[celli];
    }
    for (label z = 0; z < cells_.layers(); ++z)
    {
        transform_.planeForward(planes_.begin() + layer*z, z, 0);
    }
    transform_.toColumns();

    for (label y = 0; y < transform_.nRows(); ++y)
    {
        transform_.columnForward(y, column_.begin());
        divideByEigenvalues(y, coefficients);
        transform_.columnBackward(y, column_.begin());
    }
    transform_.toPlanes();

    for (label z = 0; z < cells_.layers(); ++z)
    {
        transform_.planeBackward(planes_.begin() + layer*z, z, 0);
    }
    forAll(elements_, celli)
    {
        x[celli] = planes_[elements_[celli]];
    }
}
