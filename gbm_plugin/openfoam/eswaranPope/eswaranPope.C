#include "eswaranPope.H"
#include "periodicBox.H"
#include "vectorised.H"
#include "addToRunTimeSelectionTable.H"
#include "fvMatrices.H"
#include "mathematicalConstants.H"

namespace Foam
{
namespace fv
{
    defineTypeNameAndDebug(eswaranPope, 0);
    addToRunTimeSelectionTable(option, eswaranPope, dictionary);
}
}

namespace
{

//- rate += f; the sum of u f, in partial sums that vectorise
VECTORISED
double addForce
(
    const Foam::label n,
    const double* __restrict__ f,
    const double* __restrict__ u,
    double* __restrict__ rate
)
{
    constexpr Foam::label lanes = 8;
    double sums[lanes] = {};
    Foam::label i = 0;

    for (; i + lanes <= n; i += lanes)
    {
        for (Foam::label j = 0; j < lanes; ++j)
        {
            sums[j] += u[i + j]*f[i + j];
            rate[i + j] += f[i + j];
        }
    }
    double sum = 0;
    for (; i < n; ++i)
    {
        sum += u[i]*f[i];
        rate[i] += f[i];
    }
    for (const double s : sums)
    {
        sum += s;
    }
    return sum;
}

}


// * * * * * * * * * * * * * * * * Constructors  * * * * * * * * * * * * * * //

Foam::fv::eswaranPope::eswaranPope
(
    const word& name,
    const word& modelType,
    const dictionary& dict,
    const fvMesh& mesh
)
:
    turbulenceForcing(name, modelType, dict, mesh),
    reached_(mesh.time().timeIndex()),
    work_(0)
{
    read(dict);
    modes_.reset(new waveSum(process_->k()));
    start();
    force_ = process_->force();
}


// * * * * * * * * * * * * * Private Member Functions  * * * * * * * * * * * //

Foam::scalar Foam::fv::eswaranPope::positive(const word& entry) const
{
    const scalar value = coeffs_.get<scalar>(entry);

    if (!(value > 0))
    {
        FatalIOErrorInFunction(coeffs_)
            << entry << " = " << value << " must be positive"
            << exit(FatalIOError);
    }
    return value;
}


void Foam::fv::eswaranPope::checkMesh(const scalar cutoff) const
{
    string why(periodicBox::problem(mesh_));
    const vector L(mesh_.bounds().span());

    if (why.empty() && max(mag(L.y() - L.x()), mag(L.z() - L.x())) > 1e-6*L.x())
    {
        OStringStream sides;
        sides << "its sides are " << L.x() << ", " << L.y() << " and " << L.z();
        why = sides.str();
    }
    if (!why.empty())
    {
        FatalErrorInFunction
            << type() << " forces a periodic cube: " << why.c_str()
            << exit(FatalError);
    }

    // of the finest waves that the spectral solver keeps
    const label cells = returnReduce(mesh_.nCells(), sumOp<label>());
    const scalar n = std::cbrt(scalar(cells));
    const label limit = label((n + 1e-6 - 1)/3);

    if (cutoff > limit)
    {
        FatalIOErrorInFunction(coeffs_)
            << "cutoff = " << cutoff << " must not exceed " << limit
            << " at " << label(n + 0.5) << " cells per edge"
            << exit(FatalIOError);
    }
}


void Foam::fv::eswaranPope::reach()
{
    const Time& time = mesh_.time();

    if (reached_ != time.timeIndex())
    {
        reached_ = time.timeIndex();
        process_->advance(time.deltaTValue());
        force_ = process_->force();
    }
}


void Foam::fv::eswaranPope::forAllRows(const cellRows::use& f) const
{
    if (!cells_.valid())
    {
        cells_.reset(new cellRows(mesh_, modes_()));
    }
    cells_->forAllRows(modes_(), force_, f);
}


// * * * * * * * * * * * * Protected Member Functions  * * * * * * * * * * * //

Foam::scalar Foam::fv::eswaranPope::power
(
    const volVectorField& U,
    const flowStatistics&
) const
{
    const scalarField& V = mesh_.V();
    const vectorField& u = U.primitiveField();
    scalar sum = 0;
    scalar volume = 0;

    forAllRows
    (
        [&](const label first, const scalarField (&f)[vector::nComponents])
        {
            forAll(f[0], i)
            {
                const label celli = first + i;
                sum += V[celli]*(u[celli] & vector(f[0][i], f[1][i], f[2][i]));
                volume += V[celli];
            }
        }
    );
    reduce(sum, sumOp<scalar>());
    reduce(volume, sumOp<scalar>());

    return sum/volume;
}


Foam::scalar Foam::fv::eswaranPope::power(const flowStatistics&) const
{
    const scalar cells = returnReduce(scalar(mesh_.nCells()), sumOp<scalar>());

    return returnReduce(work_, sumOp<scalar>())/cells;
}


void Foam::fv::eswaranPope::choose(const flowStatistics&)
{
    reach();
}


void Foam::fv::eswaranPope::follow(const flowStatistics&)
{
    reach();
    work_ = 0;
}


void Foam::fv::eswaranPope::add(fvMatrix<vector>& eqn) const
{
    const scalarField& V = mesh_.V();
    vectorField& source = eqn.source();

    forAllRows
    (
        [&](const label first, const scalarField (&f)[vector::nComponents])
        {
            forAll(f[0], i)
            {
                const label celli = first + i;
                source[celli] -= V[celli]*vector(f[0][i], f[1][i], f[2][i]);
            }
        }
    );
}


void Foam::fv::eswaranPope::readState(const dictionary& state)
{
    process_->read(state);
}


void Foam::fv::eswaranPope::writeState(Ostream& os) const
{
    process_->write(os);
}


// * * * * * * * * * * * * * * * Member Functions  * * * * * * * * * * * * * //

bool Foam::fv::eswaranPope::read(const dictionary& dict)
{
    readCommon(dict, {"variance", "timeScale", "cutoff", "seed"});

    const scalar variance = positive("variance");
    const scalar timeScale = positive("timeScale");
    const scalar cutoff = positive("cutoff");
    const label seed = coeffs_.lookupOrDefault<label>("seed", 1);

    if (cutoff < 1)
    {
        FatalIOErrorInFunction(coeffs_)
            << "cutoff = " << cutoff << " must be at least 1, in waves per edge"
            << exit(FatalIOError);
    }
    if (seed < 0)
    {
        FatalIOErrorInFunction(coeffs_)
            << "seed = " << seed << " must not be negative"
            << exit(FatalIOError);
    }
    checkMesh(cutoff);
    process_.reset(new shellProcess(variance, timeScale, cutoff, seed));

    return true;
}


void Foam::fv::eswaranPope::correct(volVectorField& U)
{
    reach();
    turbulenceForcing::correct(U);
}


void Foam::fv::eswaranPope::addRate(const latticeLayer& layer)
{
    const auto centre = [&](const label i, const direction d)
    {
        return constant::mathematical::twoPi*(i + 0.5)/layer.n[d];
    };
    const label n = layer.n.x();

    if (waves_.empty())
    {
        scalarField x(n);
        forAll(x, i)
        {
            x[i] = centre(i, vector::X);
        }
        waves_ = modes_->along(x);
    }

    modes_->toPlane(force_, centre(layer.k, vector::Z));
    for (label y = 0; y < layer.n.y(); ++y)
    {
        modes_->toRow(centre(y, vector::Y));
        modes_->values(waves_, values_);

        for (direction d = 0; d < vector::nComponents; ++d)
        {
            work_ += addForce
            (
                n, values_[d].cdata(),
                layer.velocity[d] + y*layer.stride, layer.rate[d] + y*n
            );
        }
    }
}
