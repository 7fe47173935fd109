#include "linearForcing.H"
#include "allowedEntries.H"
#include "consistentStart.H"
#include "keepEarlier.H"
#include "kinematicViscosity.H"
#include "addToRunTimeSelectionTable.H"
#include "fvMatrices.H"
#include "fvmSup.H"
#include "IFstream.H"
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
    option(name, modelType, dict, mesh),
    writeFile(mesh, name, name),
    nu_(0),
    timeIndex_(-1),
    A_(0),
    kOld_(0),
    hasOld_(false)
{
    read(dict);
    fieldNames_.setSize(1, UName_);
    applied_.setSize(1, false);
    consistentStart(mesh, UName_, phiName_);
    readState();

    if (Pstream::master())
    {
        writePrecision_ = 12;
        keepEarlier(baseTimeDir()/(name + ".dat"));
        resetFile(name);
        writeFile::writeHeader(file(), "Linear forcing, SI units, per unit mass");
        writeCommented(file(), "Time");
        for
        (
            const char* column :
            {
                "k", "epsilonBudget", "epsilonGradient", "epsilonLaplacian",
                "uPrime", "ReLambda", "eta", "A", "power",
                "meanUx", "meanUy", "meanUz"
            }
        )
        {
            writeTabbed(file(), column);
        }
        file() << endl;
    }
}


Foam::fv::linearForcing::~linearForcing()
{
    if (row_.valid())
    {
        writeRow(rowTime_, row_());
    }
}


// * * * * * * * * * * * * * * * Member Functions  * * * * * * * * * * * * * //

bool Foam::fv::linearForcing::read(const dictionary& dict)
{
    option::read(dict);

    wordList entries
    ({
        "type", "active", "mode", "A", "power", "U", "phi", "libs",
        typeName + "Coeffs"
    });
    allowedEntries(dict, entries);
    allowedEntries(coeffs_, entries);

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

    UName_ = coeffs_.lookupOrDefault<word>("U", "U");
    phiName_ = coeffs_.lookupOrDefault<word>("phi", "phi");

    return true;
}


Foam::fileName Foam::fv::linearForcing::statePath(const word& timeName) const
{
    return mesh_.time().path()/timeName/"uniform"/option::name();
}


void Foam::fv::linearForcing::readState()
{
    const fileName path(statePath(mesh_.time().timeName()));

    if (Pstream::master() && isFile(path))
    {
        IFstream is(path);
        const dictionary state(is);
        state.readEntry("k", kOld_);
        state.readEntry("power", powerOld_);
        state.readEntry("deltaT", deltaTOld_);
        hasOld_ = true;
        Info<< "    Continuing from the state in " << path << endl;
    }
    Pstream::scatter(hasOld_);
    Pstream::scatter(kOld_);
    Pstream::scatter(powerOld_);
    Pstream::scatter(deltaTOld_);
}


void Foam::fv::linearForcing::writeState() const
{
    if (!Pstream::master() || !hasOld_)
    {
        return;
    }

    // under another name until it is whole
    const fileName path(statePath(mesh_.time().timeName()));
    mkDir(path.path());
    {
        OFstream os(path + ".part");
        os.precision(17);
        os  << "// state of " << typeName
            << ": energy and power one step before this time" << nl;
        os.writeEntry("k", kOld_);
        os.writeEntry("power", powerOld_);
        os.writeEntry("deltaT", deltaTOld_);
    }
    mv(path + ".part", path);
}


Foam::scalar Foam::fv::linearForcing::coefficient(const scalar k) const
{
    return
        mode_ == mode::constantCoefficient
      ? strength_
      : strength_/(2*max(k, VSMALL));
}


void Foam::fv::linearForcing::writeRow
(
    const scalar time,
    const flowStatistics& s
)
{
    const scalar power = 2*s.k*coefficient(s.k);
    const scalar uPrime = Foam::sqrt(2*s.k/3);
    const scalar epsilon = max(s.epsilonLaplacian, VSMALL);

    // over the step that ends here; at a start no step has ended
    const scalar epsilonBudget =
        hasOld_
      ? 0.5*(power + powerOld_) - (s.k - kOld_)/deltaTOld_
      : s.epsilonLaplacian;

    if (Pstream::master())
    {
        file()
            << setprecision(writePrecision_) << time
            << token::TAB << s.k
            << token::TAB << epsilonBudget
            << token::TAB << s.epsilonGradient
            << token::TAB << s.epsilonLaplacian
            << token::TAB << uPrime
            << token::TAB << Foam::sqrt(15/(nu_*epsilon))*sqr(uPrime)
            << token::TAB << Foam::pow025(pow3(nu_)/epsilon)
            << token::TAB << coefficient(s.k)
            << token::TAB << power
            << token::TAB << s.mean.x()
            << token::TAB << s.mean.y()
            << token::TAB << s.mean.z()
            << endl;
    }
}


void Foam::fv::linearForcing::beginStep(const volVectorField& U)
{
    const scalar deltaT = mesh_.time().deltaTValue();
    nu_ = kinematicViscosity(mesh_);
    const flowStatistics now(U, nu_);

    if (!std::isfinite(now.k))
    {
        FatalErrorInFunction
            << "the velocity is not finite (k = " << now.k << ") at time "
            << mesh_.time().value() - deltaT << exit(FatalError);
    }

    writeRow(mesh_.time().value() - deltaT, now);

    // energy at the end of the step, for the implicit force
    const scalar k =
        hasOld_ ? now.k + (now.k - kOld_)*deltaT/deltaTOld_ : now.k;
    A_ = coefficient(k > 0.5*now.k ? k : now.k);

    kOld_ = now.k;
    powerOld_ = 2*now.k*coefficient(now.k);
    deltaTOld_ = deltaT;
    hasOld_ = true;
}


void Foam::fv::linearForcing::addSup(fvMatrix<vector>& eqn, const label)
{
    const volVectorField& U = eqn.psi();

    if (timeIndex_ != mesh_.time().timeIndex())
    {
        timeIndex_ = mesh_.time().timeIndex();
        row_.clear();
        beginStep(U);
    }

    // A U implicit and -A mean explicit, without a matrix of their own
    const vector mean(flowStatistics::average(U));
    const scalarField& V = mesh_.V();
    scalarField& diag = eqn.diag();
    vectorField& source = eqn.source();

    forAll(V, celli)
    {
        diag[celli] += A_*V[celli];
        source[celli] += A_*V[celli]*mean;
    }
}


void Foam::fv::linearForcing::addSup
(
    const volScalarField&,
    fvMatrix<vector>&,
    const label
)
{
    FatalErrorInFunction
        << typeName << " is for incompressible solvers"
        << exit(FatalError);
}


void Foam::fv::linearForcing::removeMean
(
    volVectorField& U,
    const vector& mean
) const
{
    U -= dimensionedVector("mean", dimVelocity, mean);

    surfaceScalarField* phi =
        mesh_.getObjectPtr<surfaceScalarField>(phiName_);
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
    const vector mean(flowStatistics::average(U));

    if (mag(mean) > meanTolerance*Foam::sqrt(kOld_))
    {
        removeMean(U, mean);
    }

    if (mesh_.time().writeTime())
    {
        writeState();
    }

    // No step follows the last one, in which its row would be written. The
    // last call in a step cannot be told, so each replaces the one before.
    const Time& time = mesh_.time();
    if (time.value() > time.endTime().value() - 0.5*time.deltaTValue())
    {
        rowTime_ = time.value();
        row_.reset(new flowStatistics(U, nu_));
    }
}
