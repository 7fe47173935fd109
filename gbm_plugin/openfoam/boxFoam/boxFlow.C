#include "boxFlow.H"
#include "besideSolver.H"
#include "kernels.H"

// * * * * * * * * * * * * * * * * Constructors  * * * * * * * * * * * * * * //

Foam::boxFlow::boxFlow
(
    const fvMesh& mesh,
    const differences& D,
    const scalar nu
)
:
    cells_(mesh),
    h_(uniformBox::New(mesh).cellSize()),
    D_(D),
    k_(D, cells_.n(), h_),
    nu_(nu),
    u_(cells_, D.reach()),
    transform_(cells_, 3, u_.rowStride()),
    modes_(size(), Zero),
    column_(transform_.columnSize()),
    plane_(3*cells_.n().x()*cells_.n().y() + cells_.n().x()),
    inColumns_(false),
    sources_(nullptr),
    now_(),
    energy_(width(), Zero),
    firsts_(width(), Zero),
    seconds_(width(), Zero),
    largestSpeed_(0),
    meanSpeed_(0),
    meanMagDivergence_(0),
    meanDivergence_(0)
{
    const label fewest =
        returnReduce(cells_.layers() ? cells_.layers() : labelMax, minOp<label>());

    if (Pstream::parRun() && fewest < D.reach())
    {
        FatalErrorInFunction
            << "a rank holds " << fewest << " layers of cells, and "
            << D.name() << " reaches " << D.reach()
            << " cells far: use fewer ranks" << exit(FatalError);
    }
}


// * * * * * * * * * * * * * Private Member Functions  * * * * * * * * * * * //

void Foam::boxFlow::rowsOf
(
    double* column,
    const label z,
    double* (&rows)[3]
) const
{
    for (label c = 0; c < 3; ++c)
    {
        rows[c] = column + place(0, z, c);
    }
}


Foam::modeColumn Foam::boxFlow::columnAt(const label y, double* modes) const
{
    return modeColumn{cells_.n(), firstRow() + y, width(), modes};
}


void Foam::boxFlow::rateColumn(const label y)
{
    transform_.columnForward(y, column_.begin());

    if (sources_)
    {
        sources_->addModes(columnAt(y, column_.begin()), nCells());
    }
}


void Foam::boxFlow::tally(const label y, double* column)
{
    const label row = firstRow() + y;
    double* u[3];

    for (label z = 0; z < cells_.n().z(); ++z)
    {
        rowsOf(column, z, u);
        kernels::tally
        (
            width(), u,
            sqr(k_.first(vector::Y)[row]) + sqr(k_.first(vector::Z)[z]),
            k_.second(vector::Y)[row] + k_.second(vector::Z)[z],
            energy_.begin(), firsts_.begin(), seconds_.begin()
        );
    }

    if (row == 0)
    {
        rowsOf(column, 0, u);
        now_.mean = vector(u[0][0], u[1][0], u[2][0]);
    }
}


void Foam::boxFlow::finishStatistics()
{
    scalarList sums(6, Zero);

    forAll(energy_, i)
    {
        const scalar w = k_.weights()[i];
        sums[0] += w*energy_[i];
        sums[1] += w*(energy_[i]*sqr(k_.first(vector::X)[i]) + firsts_[i]);
        sums[2] += w*(energy_[i]*k_.second(vector::X)[i] + seconds_[i]);
    }
    if (nRows() && firstRow() == 0)
    {
        sums[0] -= magSqr(now_.mean);
        std::copy_n(now_.mean.cdata(), 3, sums.begin() + 3);
    }
    Pstream::listCombineGather(sums, plusEqOp<scalar>());
    Pstream::listCombineScatter(sums);

    now_.k = 0.5*sums[0];
    now_.epsilonGradient = nu_*sums[1];
    now_.epsilonLaplacian = nu_*sums[2];
    now_.mean = vector(sums[3], sums[4], sums[5]);

    energy_ = 0;
    firsts_ = 0;
    seconds_ = 0;
}


void Foam::boxFlow::toCells()
{
    finishStatistics();
    transform_.toPlanes();

    for (label z = 0; z < cells_.layers(); ++z)
    {
        for (label c = 0; c < 3; ++c)
        {
            transform_.planeBackward(u_.plane(z, c), z, c);
        }
        u_.closeRows(z);
    }
    u_.exchange();
    inColumns_ = false;
}


// * * * * * * * * * * * * * * * Member Functions  * * * * * * * * * * * * * //

Foam::scalar Foam::boxFlow::set(const vectorField& U)
{
    for (label z = 0; z < cells_.layers(); ++z)
    for (label c = 0; c < 3; ++c)
    {
        u_.load(U, z, c, plane_.begin());
        transform_.planeForward(plane_.begin(), z, c);
    }
    inColumns_ = false;
    sources_ = nullptr;

    const FixedList<scalarList, 3> resolved(k_.decay(0));
    const scalar normal = 1/nCells();

    advance
    (
        [&](const label y, const label z, double* const (&v)[3])
        {
            const scalar keep =
                normal
               *resolved[vector::Y][firstRow() + y]
               *resolved[vector::Z][z];

            for (label c = 0; c < 3; ++c)
            {
                double* mode = modes_.begin() + place(y, z, c);
                for (label i = 0; i < width(); ++i)
                {
                    mode[i] = v[c][i] *= keep*resolved[vector::X][i];
                }
            }
        }
    );

    // as a sum over cells: that over modes would end in rounding
    scalar sum = 0;
    for (label z = 0; z < cells_.layers(); ++z)
    for (label y = 0; y < cells_.n().y(); ++y)
    for (label c = 0; c < 3; ++c)
    {
        const double* row = u_.row(z, c, y);
        for (label x = 0; x < cells_.n().x(); ++x)
        {
            sum += sqr(U[u_.cell(z, y, x)][c] - row[x]);
        }
    }

    return Foam::sqrt(returnReduce(sum, sumOp<scalar>())/nCells());
}


void Foam::boxFlow::set(const List<double>& modes)
{
    modes_ = modes;
    // nobody is at work on planes any more
    transform_.toColumns();

    for (label y = 0; y < nRows(); ++y)
    {
        std::copy_n(modes_.begin() + place(y, 0, 0), column_.size(), column_.begin());
        tally(y, column_.begin());
        transform_.columnBackward(y, column_.begin());
    }
    toCells();
}


void Foam::boxFlow::store(volVectorField& U) const
{
    vectorField& cells = U.primitiveFieldRef();
    besideSolver::replace(cells);

    for (label z = 0; z < cells_.layers(); ++z)
    {
        u_.store(z, cells);
    }
}


void Foam::boxFlow::evaluate(momentumSources& sources)
{
    const label nx = cells_.n().x();
    const label ny = cells_.n().y();
    const label firstLayer = min(cells_.n().z(), cells_.block()*Pstream::myProcNo());

    kernels::coefficients half;
    double perCell[3];
    for (direction d = 0; d < 3; ++d)
    {
        perCell[d] = 1/h_[d];
        forAll(D_.coefficients(), m)
        {
            half.a[d][m] = 0.5*D_.coefficients()[m]/h_[d];
        }
    }

    double* const plane[3] =
    {
        plane_.begin(), plane_.begin() + nx*ny, plane_.begin() + 2*nx*ny
    };
    double* divergence = plane_.begin() + 3*nx*ny;

    scalar largest = 0, speed = 0, magnitudes = 0, sum = 0;
    sources.begin(now_);
    sources_ = &sources;
    for (label y = 0; y < nRows(); ++y)
    {
        sources.show(columnAt(y, modes_.begin() + place(y, 0, 0)));
    }

    for (label z = 0; z < cells_.layers(); ++z)
    {
        for (label y = 0; y < ny; ++y)
        {
            double* const rate[3] =
            {
                plane[0] + y*nx, plane[1] + y*nx, plane[2] + y*nx
            };
            const double* const u[3] =
            {
                u_.row(z, 0, y), u_.row(z, 1, y), u_.row(z, 2, y)
            };
            kernels::convect(D_.reach(), nx, u_.around(z, y), half, rate, divergence);
            kernels::sums(nx, divergence, magnitudes, sum);
            kernels::courant(nx, u, perCell, largest, speed);
        }

        const latticeLayer layer
        {
            cells_.n(), firstLayer + z,
            {u_.plane(z, 0), u_.plane(z, 1), u_.plane(z, 2)}, u_.rowStride(),
            {plane[0], plane[1], plane[2]}
        };
        sources.add(u_, z, layer);

        for (label c = 0; c < 3; ++c)
        {
            transform_.planeForward(plane[c], z, c);
        }
    }
    inColumns_ = false;
    sources.end();

    largestSpeed_ = returnReduce(largest, maxOp<scalar>());
    vector sums(speed, magnitudes, sum);
    reduce(sums, sumOp<vector>());
    meanSpeed_ = sums.x()/nCells();
    meanMagDivergence_ = sums.y()/nCells();
    meanDivergence_ = sums.z()/nCells();
}


void Foam::boxFlow::pressure(volScalarField& p)
{
    if (!inColumns_)
    {
        transform_.toColumns();
        inColumns_ = true;
    }

    // of zero mean: i k' p = N where the rate N has a part along k'
    if (!pressure_)
    {
        pressure_.reset(new slabTransform(cells_, 1, cells_.n().x()));
    }
    slabTransform& transform = *pressure_;
    const scalarList& kx = k_.first(vector::X);
    List<double> modes(transform.columnSize());

    for (label y = 0; y < nRows(); ++y)
    {
        rateColumn(y);
        const scalar ky = k_.first(vector::Y)[firstRow() + y];

        for (label z = 0; z < cells_.n().z(); ++z)
        {
            const scalar kz = k_.first(vector::Z)[z];
            const bool resolved =
                k_.resolved(vector::Y, firstRow() + y)
             && k_.resolved(vector::Z, z);
            double* N[3];
            rowsOf(column_.begin(), z, N);
            double* row = modes.begin() + z*width();

            for (label i = 0; i < width(); i += 2)
            {
                const scalar k2 = sqr(kx[i]) + sqr(ky) + sqr(kz);
                const scalar factor =
                    resolved && k_.resolved(vector::X, i) && k2 > 0
                  ? 1/(k2*nCells())
                  : 0;

                row[i] =
                    factor*(kx[i]*N[0][i + 1] + ky*N[1][i + 1] + kz*N[2][i + 1]);
                row[i + 1] =
                    -factor*(kx[i]*N[0][i] + ky*N[1][i] + kz*N[2][i]);
            }
        }
        transform.columnBackward(y, modes.begin());
    }
    transform.toPlanes();

    scalarField& cells = p.primitiveFieldRef();
    for (label z = 0; z < cells_.layers(); ++z)
    {
        transform.planeBackward(plane_.begin(), z, 0);
        const double* value = plane_.begin();

        for (label y = 0; y < cells_.n().y(); ++y)
        for (label x = 0; x < cells_.n().x(); ++x)
        {
            cells[u_.cell(z, y, x)] = *value++;
        }
    }
    p.correctBoundaryConditions();
}


void Foam::boxFlow::fluxes(surfaceScalarField& phi) const
{
    u_.fluxes(D_.faceWeights(), phi);
}


void Foam::boxFlow::advance(const update& newModes)
{
    if (!inColumns_)
    {
        transform_.toColumns();
    }

    const double* kx = k_.first(vector::X).begin();
    double* rows[3];

    for (label y = 0; y < nRows(); ++y)
    {
        rateColumn(y);

        const scalar ky = k_.first(vector::Y)[firstRow() + y];
        for (label z = 0; z < cells_.n().z(); ++z)
        {
            rowsOf(column_.begin(), z, rows);
            kernels::project(width(), rows, kx, ky, k_.first(vector::Z)[z]);
            newModes(y, z, rows);
        }

        tally(y, column_.begin());
        transform_.columnBackward(y, column_.begin());
    }
    toCells();
}
