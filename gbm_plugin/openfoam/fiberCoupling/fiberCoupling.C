#include "fiberCoupling.H"
#include "allowedEntries.H"
#include "besideSolver.H"
#include "consistentStart.H"
#include "feedback.H"
#include "keepEarlier.H"
#include "kinematicViscosity.H"
#include "addToRunTimeSelectionTable.H"

namespace Foam
{
namespace functionObjects
{
    defineTypeNameAndDebug(fiberCoupling, 0);
    addToRunTimeSelectionTable(functionObject, fiberCoupling, dictionary);
}
}

namespace
{

//- While one exists, an error ends the run. Function objects' errors are
//  otherwise warnings, and the flow would go on without its fibers.
class fatalErrors
{
    const bool error_ = Foam::FatalError.throwExceptions(false);
    const bool ioError_ = Foam::FatalIOError.throwExceptions(false);

public:

    ~fatalErrors()
    {
        Foam::FatalError.throwExceptions(error_);
        Foam::FatalIOError.throwExceptions(ioError_);
    }
};


//- Seconds since the last call
class stopwatch
{
    using clock = std::chrono::steady_clock;
    clock::time_point last_ = clock::now();

public:

    Foam::scalar lap()
    {
        const auto now = clock::now();
        const std::chrono::duration<double> d(now - last_);
        last_ = now;
        return d.count();
    }
};

Foam::scalar timeOfDay()
{
    const auto now = std::chrono::system_clock::now().time_since_epoch();
    return std::chrono::duration<double>(now).count();
}

}


// * * * * * * * * * * * * * * * * Constructors  * * * * * * * * * * * * * * //

Foam::functionObjects::fiberCoupling::fiberCoupling
(
    const word& name,
    const Time& time,
    const dictionary& dict
)
:
    fvMeshFunctionObject(name, time, dict),
    writeFile(mesh_, name, "coupling"),
    deltaT_(time.deltaTValue()),
    step_(time.timeIndex()),
    saved_(step_),
    feedback_(nullptr),
    nCells_(0),
    cellMass_(0),
    wanted_(NOTHING)
{
    const fatalErrors guard;

    read(dict);

    if (postProcess)
    {
        Info<< type() << " " << name
            << ": nothing to do in post-processing" << endl;
        return;
    }

    const IOdictionary fiberProperties
    (
        IOobject
        (
            "fiberProperties",
            time.constant(),
            mesh_,
            IOobject::MUST_READ,
            IOobject::NO_WRITE,
            false
        )
    );

    box_.reset(new periodicBox(mesh_));
    sampler_ = sampler::New(fiberProperties, mesh_);
    beads_.reset(new beadExchange(box_(), locator::of(mesh_)));

    if (feedback::wanted(time))
    {
        const scalar rho = fiberProperties.lookupOrDefault<scalar>("rho", 1);
        nCells_ = returnReduce(scalar(mesh_.nCells()), sumOp<scalar>());
        cellMass_ = rho*gSum(mesh_.V().field())/nCells_;
        feedback_ = &fv::fiberFeedback::addTo(mesh_, UName_);
        feedback_->renewWith([this]() { const fatalErrors fatal; advance(); });
    }

    if (Pstream::master())
    {
        keepEarlier(baseTimeDir()/"coupling.dat");
        resetFile("coupling");
        writeHeader(file(), "Fiber coupling: seconds per step");
        writeCommented(file(), "Time");
        wordList columns({"wait", "location", "sampling", "sending"});
        if (feedback_)
        {
            columns.append(wordList({"forces", "spreading"}));
        }
        columns.append(wordList({"held", "arrivedAt", "sentAt"}));
        for (const word& column : columns)
        {
            writeTabbed(file(), column);
        }
        file() << endl;
    }

    shakeHands(fiberProperties);

    consistentStart(mesh_, UName_, "phi");

    // The fibers start, or continue, from the flow at this time. Function
    // objects are not executed before the first step.
    exchange();
}


// * * * * * * * * * * * * * Private Member Functions  * * * * * * * * * * * //

std::string Foam::functionObjects::fiberCoupling::timeFolder() const
{
    return (Pstream::parRun() ? "processor0/" : "") + time_.timeName();
}


void Foam::functionObjects::fiberCoupling::shakeHands
(
    const IOdictionary& fiberProperties
)
{
    const double cells = returnReduce(double(mesh_.nCells()), sumOp<double>());
    const dictionary coupling(fiberProperties.subOrEmptyDict("coupling"));
    const label count = coupling.lookupOrDefault<label>("daemons", 1);

    if (count < 1)
    {
        FatalIOErrorInFunction(coupling)
            << "daemons = " << count << " must be at least 1"
            << exit(FatalIOError);
    }

    message hello(message::HELLO, step_, time_.value());
    hello.append<double>(kinematicViscosity(mesh_));
    hello.append<double>(deltaT_);
    hello.append(box_->min().cdata(), 3);
    hello.append(box_->max().cdata(), 3);
    hello.append(cells);

    for (label daemon = 0; daemon < count; ++daemon)
    {
        if ((daemon*Pstream::nProcs())/count == Pstream::myProcNo())
        {
            const std::string folder(timeFolder());
            message own(hello);
            own.append<std::int64_t>(daemon + 1);
            own.append<std::int64_t>(count);
            own.append<std::int64_t>(folder.size());
            own.appendText(folder);

            daemons_.append
            (
                new fiberDaemon
                (
                    fiberProperties,
                    time_.globalPath(),
                    {daemon + 1, count},
                    own
                )
            );
        }
    }
    learnFamilies();

    if (Pstream::master())
    {
        label beads = 0;
        for (const List<fiberFamily>& families : families_)
        {
            for (const fiberFamily& f : families)
            {
                beads += f.size();
            }
        }
        Info<< type() << ": " << beads << " beads, " << count
            << (count > 1 ? " daemons, the first on " : " daemon, on ")
            << daemons_[0].peer().c_str() << endl;
    }
}


void Foam::functionObjects::fiberCoupling::learnFamilies()
{
    List<labelList> all(Pstream::nProcs());
    labelList& mine = all[Pstream::myProcNo()];

    for (const fiberDaemon& daemon : daemons_)
    {
        for (const fiberFamily& f : daemon.families())
        {
            mine.append(labelList({f.family, f.count, f.beads, f.first}));
        }
    }
    Pstream::gatherList(all);
    Pstream::scatterList(all);

    families_.setSize(all.size());
    forAll(all, rank)
    {
        const labelList& n = all[rank];
        for (label i = 0; i < n.size(); i += 4)
        {
            families_[rank].append({n[i], n[i + 1], n[i + 2], n[i + 3]});
        }
    }

    // the same in all shares of the fibers
    label wanted = daemons_.size() ? daemons_[0].wanted() : NOTHING;
    reduce(wanted, maxOp<label>());
    wanted_ = ambient(wanted);
    for (const fiberDaemon& daemon : daemons_)
    {
        if (daemon.wanted() != wanted_)
        {
            FatalErrorInFunction
                << "the daemons want different fields: they are not of one"
                << " version of one case" << exit(FatalError);
        }
    }
}


Foam::Pair<bool> Foam::functionObjects::fiberCoupling::receivePositions
(
    List<point>& positions,
    times& t
)
{
    stopwatch watch;

    label beads = 0;
    for (const fiberDaemon& daemon : daemons_)
    {
        beads += daemon.beads();
    }
    positions.setSize(beads);

    // how many there are, will correct these positions, and ask for the end
    Vector<label> daemons(Zero);
    label start = 0;
    for (fiberDaemon& daemon : daemons_)
    {
        const std::uint32_t flags = daemon.receivePositions
        (
            step_,
            t.time,
            1e-6*deltaT_,
            SubList<point>(positions, daemon.beads(), start)
        );
        daemons += Vector<label>
        (
            1,
            (flags & message::provisional) ? 1 : 0,
            (flags & message::stop) ? 1 : 0
        );
        start += daemon.beads();
    }
    reduce(daemons, sumOp<Vector<label>>());

    if (daemons.y() && daemons.y() != daemons.x())
    {
        FatalErrorInFunction
            << "at step " << step_ << " some daemons will correct their"
            << " positions and others not: they did not start from the same"
            << " time" << exit(FatalError);
    }
    t.wait += watch.lap();

    return {daemons.y() > 0, daemons.z() > 0};
}


Foam::scalarList Foam::functionObjects::fiberCoupling::sendSample
(
    bool provisional,
    times& t
)
{
    const label n = 3 + components(wanted_);
    stopwatch watch;

    scalarList sampled
    (
        sampler_->sample(wanted_, beads_())
    );
    t.sampling += watch.lap();

    scalarList values(beads_->collect(std::move(sampled), n));

    label start = 0;
    for (fiberDaemon& daemon : daemons_)
    {
        daemon.sendSample
        (
            step_,
            t.time,
            SubList<scalar>(values, n*daemon.beads(), start),
            t.keep && !provisional
        );
        start += n*daemon.beads();
    }
    t.sending += watch.lap();

    return values;
}


void Foam::functionObjects::fiberCoupling::receiveForces
(
    const scalarList& sampled,
    times& t
)
{
    stopwatch watch;
    const label n = 3 + components(wanted_);
    const label beads = sampled.size()/n;
    scalarList loads(6*beads);

    label start = 0;
    for (fiberDaemon& daemon : daemons_)
    {
        daemon.receiveForces
        (
            step_,
            time_.value(),
            1e-6*deltaT_,
            SubList<scalar>(loads, 6*daemon.beads(), start)
        );
        start += 6*daemon.beads();
    }

    // the power of a bead, in the words of what was sampled; and its loads by
    // the mass of a cell, one for all: sampler refuses to spread on others
    // than a uniform box
    scalar exchange = 0;
    const scalar perCellMass = 1/cellMass_;
    for (label bead = 0; bead < beads; ++bead)
    {
        const scalar* u = sampled.cdata() + n*bead;
        scalar* load = loads.begin() + 6*bead;
        const vector rotation
        (
            wanted_ == ROTATION
          ? vector(u[3], u[4], u[5])
          : 0.5*vector(u[10] - u[8], u[5] - u[9], u[6] - u[4])
        );
        exchange +=
            (vector(load[0], load[1], load[2]) & vector(u[0], u[1], u[2]))
          + (vector(load[3], load[4], load[5]) & rotation);
        for (label i = 0; i < 6; ++i)
        {
            load[i] *= perCellMass;
        }
    }
    reduce(exchange, sumOp<scalar>());

    *feedback::exchange() = exchange/(nCells_*cellMass_);

    const scalarList own(beads_->distribute(std::move(loads), 6));
    // only now, as ranks without a daemon wait for others until here
    t.forces += watch.lap();

    sampler_->spread
    (
        own, beads_(), feedback_->next(), feedback_->nextFilled()
    );
    feedback_->renewed(step_);
    t.spreading += watch.lap();
}


bool Foam::functionObjects::fiberCoupling::serve(scalarList& sampled, times& t)
{
    bool provisional = true;
    bool stop = false;

    while (provisional)
    {
        List<point> positions;
        const Pair<bool> flags(receivePositions(positions, t));
        provisional = flags.first();
        stop = stop || flags.second();
        t.arrived = timeOfDay();

        stopwatch watch;
        beads_->locate(std::move(positions));
        t.location += watch.lap();

        sampled = sendSample(provisional, t);
    }
    t.left = timeOfDay();

    return stop;
}


void Foam::functionObjects::fiberCoupling::conclude
(
    const bool stop,
    const scalar held,
    const times& t
)
{
    // once: asked again, at the step with which it ends, the run would go on
    if (stop && time_.stopAt() != Time::stopAtControls::saWriteNow)
    {
        Info<< type() << ": a daemon was asked to end the run:"
            << " writing and stopping after the next step" << endl;
        time_.stopAt(Time::stopAtControls::saWriteNow);
    }
    writeTimes(t, held);
}


void Foam::functionObjects::fiberCoupling::exchange()
{
    sampler_->look(mesh_.lookupObject<volVectorField>(UName_));

    // at write times the daemons' state is next, and forces are needed now
    const bool beside =
        besideSolver::offered()
     && time_.timeIndex() != time_.startTimeIndex()
     && !time_.writeTime()
     && !Pstream::parRun()
     && !feedback_
     && sampler_->onlyReads();

    times t{};
    t.time = time_.value();
    t.keep = time_.writeTime();

    if (beside)
    {
        struct turn { times t; bool stop; };
        const std::shared_ptr<turn> now(new turn{t, false});

        besideSolver::start
        (
            [this, now]()
            {
                scalarList sampled;
                now->stop = serve(sampled, now->t);
            },
            [this, now](const scalar waited)
            {
                conclude(now->stop, waited, now->t);
            }
        );
        return;
    }

    scalarList sampled;
    stopwatch watch;
    const bool stop = serve(sampled, t);
    if (feedback_)
    {
        receiveForces(sampled, t);
        t.left = timeOfDay();
    }
    conclude(stop, watch.lap(), t);
}


void Foam::functionObjects::fiberCoupling::writeTimes
(
    const times& t,
    const scalar held
)
{
    scalarList spent({t.wait, t.location, t.sampling, t.sending});
    if (feedback_)
    {
        spent.append(scalarList({t.forces, t.spreading}));
    }
    spent.append(held);
    Pstream::listCombineGather(spent, maxEqOp<scalar>());

    if (Pstream::master())
    {
        file() << setw(charWidth()) << Time::timeName(t.time);
        for (const scalar seconds : spent)
        {
            file() << token::TAB << seconds;
        }
        file()
            << setprecision(17)
            << token::TAB << t.arrived << token::TAB << t.left
            << setprecision(writePrecision_) << endl;
    }
}


void Foam::functionObjects::fiberCoupling::advance()
{
    if (mag(time_.deltaTValue() - deltaT_) > 1e-9*deltaT_)
    {
        FatalErrorInFunction
            << "deltaT changed from " << deltaT_ << " to "
            << time_.deltaTValue() << " during the run: fibers move with a"
            << " fixed time step, which may change at a restart"
            << exit(FatalError);
    }
    if (time_.timeIndex() != step_ + 1)
    {
        FatalErrorInFunction
            << "step " << time_.timeIndex() << " follows step " << step_
            << ": the coupling must be executed in every step"
            << exit(FatalError);
    }

    besideSolver::finish();
    ++step_;
    exchange();
}


void Foam::functionObjects::fiberCoupling::save()
{
    if (!time_.writeTime() || saved_ == step_)
    {
        return;
    }
    saved_ = step_;

    // before the daemons write their state, which completes a time folder
    if (writeCloud_)
    {
        writeFiberCloud(mesh_, beads_(), families_);
    }
    for (fiberDaemon& daemon : daemons_)
    {
        daemon.save(step_, time_.value(), timeFolder());
    }
}


// * * * * * * * * * * * * * * * * Destructor  * * * * * * * * * * * * * * * //

Foam::functionObjects::fiberCoupling::~fiberCoupling()
{
    besideSolver::finish();
}


// * * * * * * * * * * * * * * * Member Functions  * * * * * * * * * * * * * //

bool Foam::functionObjects::fiberCoupling::read(const dictionary& dict)
{
    fvMeshFunctionObject::read(dict);
    writeFile::read(dict);

    // beside ours, what function objects in general have
    allowedEntries
    (
        dict,
        {
            "type", "libs", "functionObjectLibs", "enabled", "log", "region",
            "errors", "timeStart", "timeEnd", "writePrecision", "writeToFile",
            "useUserTime", "U", "writeCloud"
        }
    );

    UName_ = dict.lookupOrDefault<word>("U", "U");
    writeCloud_ = dict.lookupOrDefault("writeCloud", true);

    if (time_.controlDict().lookupOrDefault("adjustTimeStep", false))
    {
        FatalIOErrorInFunction(time_.controlDict())
            << "adjustTimeStep yes: fibers move with a fixed time step, as"
            << " they are sent ahead of the flow. Set adjustTimeStep no and"
            << " deltaT to the smallest step that the flow needs"
            << exit(FatalIOError);
    }

    return true;
}


bool Foam::functionObjects::fiberCoupling::execute()
{
    const fatalErrors guard;

    if (postProcess)
    {
        return true;
    }

    // executed again at the end of the run, or after a solver that had to know
    // the forces of this step
    if (time_.timeIndex() != step_)
    {
        advance();
    }
    if (feedback_ && feedback_->used() != step_)
    {
        FatalErrorInFunction
            << "feedback is yes, and " << time_.controlDict().lookupOrDefault
               <word>("application", "this solver")
            << " does not look at fvOptions, which bring it; pimpleFoam,"
            << " pisoFoam and boxFoam do" << exit(FatalError);
    }

    // with the case's own fields of this time, which are on disk already
    save();

    return true;
}


bool Foam::functionObjects::fiberCoupling::end()
{
    const fatalErrors guard;

    besideSolver::finish();
    for (fiberDaemon& daemon : daemons_)
    {
        daemon.end(step_, time_.value());
    }
    daemons_.clear();

    return true;
}
