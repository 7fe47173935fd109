#include "turbulenceForcing.H"
#include "allowedEntries.H"
#include "consistentStart.H"
#include "keepEarlier.H"
#include "kinematicViscosity.H"
#include "fvMatrices.H"
#include "IFstream.H"

// * * * * * * * * * * * * * * * * Constructors  * * * * * * * * * * * * * * //

Foam::fv::turbulenceForcing::turbulenceForcing
(
    const word& name,
    const word& modelType,
    const dictionary& dict,
    const fvMesh& mesh
)
:
    incompressibleSource(name, modelType, dict, mesh),
    writeFile(mesh, name, name),
    nu_(0),
    timeIndex_(-1),
    kOld_(0),
    powerOld_(0),
    deltaTOld_(0),
    hasOld_(false),
    explicit_(false),
    first_(false),
    rowTime_(0),
    rowPower_(0)
{}


Foam::fv::turbulenceForcing::~turbulenceForcing()
{
    if (row_.valid())
    {
        writeRow(rowTime_, row_(), rowPower_);
    }
}


// * * * * * * * * * * * * Protected Member Functions  * * * * * * * * * * * //

void Foam::fv::turbulenceForcing::readCommon
(
    const dictionary& dict,
    const wordList& entries
)
{
    option::read(dict);

    wordList allowed
    ({
        "type", "active", "U", "phi", "libs", "writeToFile",
        word(type() + "Coeffs")
    });
    allowed.append(entries);
    allowedEntries(dict, allowed);
    allowedEntries(coeffs_, allowed);

    UName_ = coeffs_.lookupOrDefault<word>("U", "U");
    phiName_ = coeffs_.lookupOrDefault<word>("phi", "phi");
    writeToFile_ = coeffs_.lookupOrDefault<bool>("writeToFile", true);
}


void Foam::fv::turbulenceForcing::start()
{
    fieldNames_.setSize(1, UName_);
    applied_.setSize(1, false);
    consistentStart(mesh_, UName_, phiName_);
    restoreState();
    if (feedback::wanted(mesh_.time()))
    {
        exchange_ = feedback::exchange();
    }

    if (writeToFile() && Pstream::master())
    {
        const word& name = option::name();

        writePrecision_ = 12;
        keepEarlier(baseTimeDir()/(name + ".dat"));
        resetFile(name);
        writeFile::writeHeader(file(), type() + ", SI units, per unit mass");
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
        if (exchange_)
        {
            writeTabbed(file(), "exchange");
        }
        file() << endl;
    }
}


Foam::scalar Foam::fv::turbulenceForcing::energyAtEnd(const scalar k) const
{
    if (!hasOld_)
    {
        return k;
    }
    const scalar deltaT = mesh_.time().deltaTValue();
    const scalar extrapolated = k + (k - kOld_)*deltaT/deltaTOld_;

    return extrapolated > 0.5*k ? extrapolated : k;
}


// * * * * * * * * * * * * * Private Member Functions  * * * * * * * * * * * //

Foam::fileName Foam::fv::turbulenceForcing::statePath
(
    const word& timeName
) const
{
    return mesh_.time().path()/timeName/"uniform"/option::name();
}


void Foam::fv::turbulenceForcing::restoreState()
{
    const fileName path(statePath(mesh_.time().timeName()));
    dictionary state;

    if (Pstream::master() && isFile(path))
    {
        IFstream is(path);
        state.read(is);
        Info<< "    Continuing from the state in " << path << endl;
    }
    Pstream::scatter(state);

    if (!state.empty())
    {
        state.name() = path;
        state.readEntry("k", kOld_);
        state.readEntry("power", powerOld_);
        state.readEntry("deltaT", deltaTOld_);
        hasOld_ = true;
        readState(state);
    }
}


void Foam::fv::turbulenceForcing::saveState() const
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
        os  << "// state of " << type()
            << ": energy and power one step before this time" << nl;
        os.writeEntry("k", kOld_);
        os.writeEntry("power", powerOld_);
        os.writeEntry("deltaT", mesh_.time().deltaTValue());
        writeState(os);
    }
    mv(path + ".part", path);
}


void Foam::fv::turbulenceForcing::writeRow
(
    const scalar time,
    const flowStatistics& s,
    const scalar power
)
{
    if (!writeToFile())
    {
        return;
    }
    const scalar uPrime = Foam::sqrt(2*s.k/3);
    const scalar epsilon = max(s.epsilonLaplacian, VSMALL);     // at rest

    // over the step that ends here; at a start no step has ended
    const scalar epsilonBudget =
        hasOld_
      ? 0.5*(power + exchange() + powerOld_) - (s.k - kOld_)/deltaTOld_
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
            << token::TAB << sqr(uPrime)*Foam::sqrt(15/nu_)/Foam::sqrt(epsilon)
            << token::TAB << Foam::pow(nu_, 0.75)/Foam::pow025(epsilon)
            << token::TAB << power/(2*max(s.k, VSMALL))
            << token::TAB << power
            << token::TAB << s.mean.x()
            << token::TAB << s.mean.y()
            << token::TAB << s.mean.z();
        if (exchange_)
        {
            file() << token::TAB << exchange();
        }
        file() << endl;
    }
}


// before anything is made of it: OpenFOAM's own traps would end the run there
static void checkFinite(const Foam::flowStatistics& now, const Foam::scalar time)
{
    if (!std::isfinite(now.k))
    {
        FatalErrorInFunction
            << "the velocity is not finite (k = " << now.k << ") at time "
            << time << Foam::exit(Foam::FatalError);
    }
}


void Foam::fv::turbulenceForcing::keep
(
    const flowStatistics& now,
    const scalar power
)
{
    kOld_ = now.k;
    powerOld_ = power + exchange();
    deltaTOld_ = mesh_.time().deltaTValue();
    hasOld_ = true;
}


void Foam::fv::turbulenceForcing::beginStep(const volVectorField& U)
{
    nu_ = kinematicViscosity(mesh_);
    const flowStatistics now(U, nu_, writeToFile());
    const scalar start = mesh_.time().value() - mesh_.time().deltaTValue();
    checkFinite(now, start);
    const scalar powerNow = writeToFile() ? power(U, now) : 0;

    writeRow(start, now, powerNow);
    choose(now);
    keep(now, powerNow);
}


// * * * * * * * * * * * * * * * Member Functions  * * * * * * * * * * * * * //

void Foam::fv::turbulenceForcing::addSup(fvMatrix<vector>& eqn, const label)
{
    if (timeIndex_ != mesh_.time().timeIndex())
    {
        timeIndex_ = mesh_.time().timeIndex();
        row_.clear();
        beginStep(eqn.psi());
    }
    add(eqn);
}


void Foam::fv::turbulenceForcing::beginRate(const flowStatistics& now)
{
    first_ = (timeIndex_ != mesh_.time().timeIndex());
    now_ = now;

    if (first_)
    {
        timeIndex_ = mesh_.time().timeIndex();
        nu_ = kinematicViscosity(mesh_);

        // of the step that has ended; after a restart it is that of the state
        if (explicit_)
        {
            deltaTOld_ = mesh_.time().deltaTValue();
        }
        explicit_ = true;
        checkFinite(now, mesh_.time().value());
    }
    follow(now);
}


void Foam::fv::turbulenceForcing::endRate()
{
    if (first_)
    {
        const scalar powerNow = writeToFile() ? power(now_) : 0;
        writeRow(mesh_.time().value(), now_, powerNow);
        keep(now_, powerNow);
    }
}


void Foam::fv::turbulenceForcing::correct(volVectorField& U)
{
    if (mesh_.time().writeTime())
    {
        saveState();
    }

    // No step follows the last one, in which its row would be written. The
    // last call in a step cannot be told, so each replaces the one before.
    const Time& time = mesh_.time();
    if (writeToFile() && !explicit_ && time.value() > time.endTime().value() - 0.5*time.deltaTValue())
    {
        rowTime_ = time.value();
        row_.reset(new flowStatistics(U, nu_));
        rowPower_ = power(U, row_());
    }
}
