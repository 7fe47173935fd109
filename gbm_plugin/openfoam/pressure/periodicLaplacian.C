#include "periodicLaplacian.H"
#include "mathematicalConstants.H"
#include "volFields.H"

#include <fftw3-mpi.h>

namespace Foam
{
    defineTypeNameAndDebug(periodicLaplacian, 0);
}

namespace
{
    // Not measured: plans chosen by time would change the rounding from run
    // to run
    constexpr unsigned planning = FFTW_ESTIMATE;
}


// * * * * * * * * * * * * * * * * Constructors  * * * * * * * * * * * * * * //

Foam::periodicLaplacian::periodicLaplacian(const fvMesh& mesh)
:
    MeshObject<fvMesh, Foam::GeometricMeshObject, periodicLaplacian>(mesh),
    directions_(mesh.nFaces()),
    nFaces_(Zero),
    elements_(mesh.nCells())
{
    const slab cells(mesh);
    n_ = cells.n();

    forAll(elements_, celli)
    {
        // rows of real numbers leave room for their spectrum
        const Vector<label>& i = cells.places()[celli];
        elements_[celli] = i.x() + 2*(n_.x()/2 + 1)*(i.y() + n_.y()*i.z());
    }

    forAll(directions_, facei)
    {
        directions_[facei] = uniformBox::New(mesh).normal(facei);
        nFaces_[directions_[facei]] += 1;
    }
    reduce(nFaces_, sumOp<vector>());

    const double nCells = double(n_.x())*n_.y()*n_.z();
    for (direction d = 0; d < vector::nComponents; ++d)
    {
        symbols_[d].setSize(n_[d]);
        forAll(symbols_[d], i)
        {
            const double s = std::sin(constant::mathematical::pi*i/n_[d]);
            symbols_[d][i] = 4*s*s*nCells;
        }
    }

    if (Pstream::parRun())
    {
        planParallel(cells);
    }
    else
    {
        planSerial();
    }
}


Foam::periodicLaplacian::~periodicLaplacian()
{
    fftw_destroy_plan(forward_);
    fftw_destroy_plan(backward_);
    fftw_free(data_);
}


// * * * * * * * * * * * * * Private Member Functions  * * * * * * * * * * * //

void Foam::periodicLaplacian::planSerial()
{
    outer_ = vector::Z;
    middle_ = vector::Y;
    nOuter_ = n_.z();
    firstOuter_ = 0;

    data_ = fftw_alloc_real(2*size_t(n_.x()/2 + 1)*n_.y()*n_.z());
    fftw_complex* spectrum = reinterpret_cast<fftw_complex*>(data_);

    forward_ = fftw_plan_dft_r2c_3d
    (
        n_.z(), n_.y(), n_.x(), data_, spectrum, planning
    );
    backward_ = fftw_plan_dft_c2r_3d
    (
        n_.z(), n_.y(), n_.x(), spectrum, data_, planning
    );
}


void Foam::periodicLaplacian::planParallel(const slab& cells)
{
    fftw_mpi_init();

    const ptrdiff_t n[] = {n_.z(), n_.y(), n_.x()};
    const ptrdiff_t nSpectrum[] = {n_.z(), n_.y(), n_.x()/2 + 1};
    const ptrdiff_t zBlock = cells.block();
    const ptrdiff_t yBlock = FFTW_MPI_DEFAULT_BLOCK;
    ptrdiff_t nz, firstZ, ny, firstY;

    const ptrdiff_t size = fftw_mpi_local_size_many_transposed
    (
        3, nSpectrum, 1, zBlock, yBlock, MPI_COMM_WORLD,
        &nz, &firstZ, &ny, &firstY
    );

    // the spectrum stays transposed, which saves two exchanges
    outer_ = vector::Y;
    middle_ = vector::Z;
    nOuter_ = ny;
    firstOuter_ = firstY;

    data_ = fftw_alloc_real(2*size);
    fftw_complex* spectrum = reinterpret_cast<fftw_complex*>(data_);

    forward_ = fftw_mpi_plan_many_dft_r2c
    (
        3, n, 1, zBlock, yBlock, data_, spectrum, MPI_COMM_WORLD,
        planning | FFTW_MPI_TRANSPOSED_OUT
    );
    backward_ = fftw_mpi_plan_many_dft_c2r
    (
        3, n, 1, yBlock, zBlock, spectrum, data_, MPI_COMM_WORLD,
        planning | FFTW_MPI_TRANSPOSED_IN
    );
}


void Foam::periodicLaplacian::divideByEigenvalues(const vector& c) const
{
    const label nInner = n_.x()/2 + 1;
    const double* x = symbols_[vector::X].begin();
    double* row = data_;

    for (label o = 0; o < nOuter_; ++o)
    for (label m = 0; m < n_[middle_]; ++m, row += 2*nInner)
    {
        const double rest =
            c[outer_]*symbols_[outer_][firstOuter_ + o]
          + c[middle_]*symbols_[middle_][m];

        // the mean has the eigenvalue zero, and is left out
        const label first = (firstOuter_ + o == 0 && m == 0);
        if (first)
        {
            row[0] = row[1] = 0;
        }

        for (label i = first; i < nInner; ++i)
        {
            const double factor = -1/(c.x()*x[i] + rest);
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
    forAll(elements_, celli)
    {
        data_[elements_[celli]] = x[celli];
    }

    fftw_execute(forward_);
    divideByEigenvalues(coefficients);
    fftw_execute(backward_);

    forAll(elements_, celli)
    {
        x[celli] = data_[elements_[celli]];
    }
}
