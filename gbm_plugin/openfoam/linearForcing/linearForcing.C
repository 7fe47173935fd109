#include "linearForcing.H"
#include "addToRunTimeSelectionTable.H"
#include "fvMatrices.H"
#include "surfaceFields.H"

namespace Foam
{
namespace fv
{
    defineTypeNameAndDebug(linearForcing, 0);
    addToRunTimeSelectionTable(option, linearForcing, dictionary);
}
}

const Foam::Enum<Foam::fv::linearForcing::mode>
Foam::fv::linearForcing::modeNames
({
    { mode::constantCoefficient, "constantCoefficient" },
    { mode::constantPower, "constantPower" }
});


// * * * * * * * * * * * * * * * * Constructors  * * * * * * * * * * * * * * //

Foam::fv::linearForcing::linearForcing
(
    const word& name,
    const word& modelType,
    const dictionary& dict,
    const fvMesh& mesh
)
:
    turbulenceForcing(name, modelType, dict, mesh),
    A_(0)
{
    read(dict);
    start();
}


// * * * * * * * * * * * * * * * Member Functions  * * * * * * * * * * * * * //

bool Foam::fv::linearForcing::read(const dictionary& dict)
{
    readCommon(dict, {"mode", "A", "power"});

    mode_ = modeNames.get("mode", coeffs_);

    const bool power = (mode_ == mode::constantPower);
    const word wanted(power ? "power" : "A");
    const word unused(power ? "A" : "power");

    strength_ = coeffs_.get<scalar>(wanted);

    if (coeffs_.found(unused))
    {
        FatalIOErrorInFunction(coeffs_)
            << "entry '" << unused << "' does not go with mode "
            << modeNames[mode_] << ", which reads '" << wanted << "'"
            << exit(FatalIOError);
    }
    if (strength_ < 0)
    {
        FatalIOErrorInFunction(coeffs_)
            << wanted << " = " << strength_ << " must not be negative"
            << exit(FatalIOError);
    }

    return true;
}


Foam::scalar Foam::fv::linearForcing::coefficient(const scalar k) const
{
    return
        mode_ == mode::constantCoefficient
      ? strength_
      : strength_/(2*max(k, VSMALL));
}


Foam::scalar Foam::fv::linearForcing::power
(
    const volVectorField&,
    const flowStatistics& s
) const
{
    return power(s);
}


Foam::scalar Foam::fv::linearForcing::power(const flowStatistics& s) const
{
    return 2*s.k*coefficient(s.k);
}


void Foam::fv::linearForcing::refuseRest(const flowStatistics& now) const
{
    const scalar rounding = 0.5*magSqr(meanTolerance*now.mean);

    if (mode_ == mode::constantPower && now.k <= max(rounding, VSMALL))
    {
        FatalErrorInFunction
            << "the forcing " << option::name() << " has nothing to force at"
            << " time " << mesh_.time().timeName() << ": k = " << now.k
            << " beside a mean velocity of " << mag(now.mean)
            << "; power = " << strength_ << " needs a flow that fluctuates"
            << exit(FatalError);
    }
}


void Foam::fv::linearForcing::choose(const flowStatistics& now)
{
    refuseRest(now);
    A_ = coefficient(energyAtEnd(now.k));
}


void Foam::fv::linearForcing::follow(const flowStatistics& now)
{
    refuseRest(now);
    A_ = coefficient(now.k);
}


void Foam::fv::linearForcing::add(fvMatrix<vector>& eqn) const
{
    // A U implicit and -A mean explicit, without a matrix of their own
    const vector mean(flowStatistics::average(eqn.psi()));
    const scalarField& V = mesh_.V();
    scalarField& diag = eqn.diag();
    vectorField& source = eqn.source();

    forAll(V, celli)
    {
        diag[celli] += A_*V[celli];
        source[celli] += A_*V[celli]*mean;
    }
}


void Foam::fv::linearForcing::addRate(const latticeLayer& layer)
{
    for (direction c = 0; c < vector::nComponents; ++c)
    for (label y = 0; y < layer.n.y(); ++y)
    {
        const double* __restrict__ u = layer.velocity[c] + y*layer.stride;
        double* __restrict__ rate = layer.rate[c] + y*layer.n.x();
        const scalar A = A_;
        const scalar mean = shown().mean[c];

        for (label x = 0; x < layer.n.x(); ++x)
        {
            rate[x] += A*(u[x] - mean);
        }
    }
}


void Foam::fv::linearForcing::removeMean
(
    volVectorField& U,
    const vector& mean
) const
{
    U -= dimensionedVector("mean", dimVelocity, mean);

    surfaceScalarField* phi =
        mesh_.getObjectPtr<surfaceScalarField>(phiName());
    if (!phi)
    {
        return;
    }

    // kept before it changes: in the first step nobody has asked for it
    phi->oldTime();

    const surfaceVectorField& Sf = mesh_.Sf();
    scalarField& flux = phi->primitiveFieldRef();
    forAll(flux, facei)
    {
        flux[facei] -= mean & Sf[facei];
    }
    for (fvsPatchScalarField& fluxp : phi->boundaryFieldRef())
    {
        fluxp -= mean & Sf.boundaryField()[fluxp.patch().index()];
    }
}


void Foam::fv::linearForcing::correct(volVectorField& U)
{
    const scalar small = meanTolerance*Foam::sqrt(energy());

    // the step of an explicit solver has kept that of the state
    if (!isExplicit() || mag(shown().mean) > small)
    {
        const vector mean(flowStatistics::average(U));

        if (mag(mean) > small)
        {
            removeMean(U, mean);
        }
    }
    turbulenceForcing::correct(U);
}
