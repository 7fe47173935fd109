#include "eswaranPope.H"
#include "periodicBox.H"
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


void Foam::fv::eswaranPope::findPlaces(const Vector<label>& n)
{
    const List<labelVector>& k = process_->k();
    DynamicList<place> places;

    for (label i = 0; i < 2*k.size(); ++i)
    {
        const label mode = i/2;
        const bool conjugate = i % 2;
        const labelVector q(conjugate ? -k[mode] : k[mode]);

        if (q.x() >= 0)
        {
            // of the first cell centre
            scalar angle = 0;
            for (direction d = 0; d < vector::nComponents; ++d)
            {
                angle += constant::mathematical::pi*q[d]/n[d];
            }
            places.append
            (
                place
                {
                    mode, conjugate,
                    (q.y() + n.y()) % n.y(), (q.z() + n.z()) % n.z(), q.x(),
                    complex(std::cos(angle), std::sin(angle))
                }
            );
        }
    }
    places_.transfer(places);
}


Foam::complex Foam::fv::eswaranPope::modeAt
(
    const place& p,
    const direction d
) const
{
    const amplitude& f = force_[p.mode];

    return complex(f.re[d], p.conjugate ? -f.im[d] : f.im[d])*p.phase;
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
    return returnReduce(work_, sumOp<scalar>());
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


void Foam::fv::eswaranPope::show(const modeColumn& u)
{
    if (places_.empty())
    {
        findPlaces(u.n);
    }

    for (const place& p : places_)
    {
        if (p.y != u.y)
        {
            continue;
        }
        for (direction d = 0; d < vector::nComponents; ++d)
        {
            const double* mode = u.row(p.z, d) + 2*p.x;
            const complex f(modeAt(p, d));

            // modes with negative kx are not stored
            work_ += (p.x ? 2 : 1)*(mode[0]*f.real() + mode[1]*f.imag());
        }
    }
}


void Foam::fv::eswaranPope::addModes
(
    const modeColumn& rate,
    const double factor
) const
{
    for (const place& p : places_)
    {
        if (p.y != rate.y)
        {
            continue;
        }
        for (direction d = 0; d < vector::nComponents; ++d)
        {
            double* mode = rate.row(p.z, d) + 2*p.x;
            const complex f(modeAt(p, d));

            mode[0] += factor*f.real();
            mode[1] += factor*f.imag();
        }
    }
}
