#include "fiberCoupling.H"
#include "allowedEntries.H"
#include "consistentStart.H"
#include "keepEarlier.H"
#include "kinematicViscosity.H"
#include "addToRunTimeSelectionTable.H"
#include "fvc.H"

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
    beads_(0),
    ambient_(NOTHING)
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
    sampler_ = sampler::New(fiberProperties, mesh_, box_());

    if (Pstream::master())
    {
        keepEarlier(baseTimeDir()/"coupling.dat");
        resetFile("coupling");
        writeHeader(file(), "Fiber coupling: seconds per step");
        writeCommented(file(), "Time");
        for
        (
            const char* column :
            {
                "wait", "derivative", "interpolation", "sending",
                "arrivedAt", "sentAt"
            }
        )
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

    if (Pstream::master())
    {
        daemon_ = connection::New
        (
            fiberProperties.subOrEmptyDict("coupling"),
            time_.globalPath()
        );

        message hello(message::HELLO, step_, time_.value());
        hello.append<double>(kinematicViscosity(mesh_));
        hello.append<double>(deltaT_);
        hello.append(box_->min().cdata(), 3);
        hello.append(box_->max().cdata(), 3);
        hello.append(cells);
        const std::string folder(timeFolder());
        hello.append<std::int64_t>(folder.size());
        hello.appendText(folder);
        hello.appendText(daemon_->token());
        daemon_->send(hello);

        readWelcome
        (
            daemon_->receive(message::WELCOME, step_, 32, message::maxText)
        );

        Info<< type() << ": " << families_.size() << " families with "
            << beads_ << " beads, daemon on " << daemon_->peer().c_str()
            << endl;
    }

    Pstream::scatter(beads_);
    label wanted = ambient_;
    Pstream::scatter(wanted);
    ambient_ = wanted;

    labelList sizes(2*families_.size());
    forAll(families_, i)
    {
        sizes[2*i] = families_[i].count;
        sizes[2*i + 1] = families_[i].beads;
    }
    Pstream::scatter(sizes);
    families_.setSize(sizes.size()/2);
    forAll(families_, i)
    {
        families_[i] = {sizes[2*i], sizes[2*i + 1]};
    }
}


void Foam::functionObjects::fiberCoupling::readWelcome(const message& m)
{
    // what to sample, how many families, then fibers and beads of each
    const std::vector<std::int64_t> n(m.values<std::int64_t>());

    bool valid = n[0] >= NOTHING && n[0] <= GRADIENT
     && m.payload.size() == sizeof(std::int64_t)*n.size()
     && n.size() % 2 == 0 && n[1] == std::int64_t(n.size()/2 - 1);

    std::int64_t beads = 0;
    for (std::size_t i = 2; valid && i < n.size(); i += 2)
    {
        valid = n[i] > 0 && n[i + 1] > 0 && n[i] <= labelMax/n[i + 1];
        if (valid)
        {
            beads += n[i]*n[i + 1];
            families_.append({label(n[i]), label(n[i + 1])});
        }
    }
    if (!valid || beads > labelMax)
    {
        daemon_->fail("WELCOME holds numbers that are not allowed");
    }

    ambient_ = n[0];
    beads_ = beads;
}


bool Foam::functionObjects::fiberCoupling::receivePositions
(
    List<point>& positions,
    times& t
)
{
    bool provisional = false;
    bool stop = false;
    stopwatch watch;

    if (Pstream::master())
    {
        const std::uint64_t size = std::uint64_t(beads_)*sizeof(point);
        const message m(daemon_->receive(message::POSITIONS, step_, size));
        provisional = m.head.flags & message::provisional;
        stop = m.head.flags & message::stop;

        // isfinite first: comparing with NaN would raise SIGFPE
        if
        (
            !std::isfinite(m.head.time)
         || mag(m.head.time - time_.value()) > 1e-6*deltaT_
        )
        {
            daemon_->fail
            (
                "POSITIONS are of time " + Foam::name(m.head.time)
              + ", expected time " + Foam::name(time_.value())
            );
        }

        positions.setSize(beads_);
        std::memcpy(positions.begin(), m.payload.data(), size);
        forAll(positions, i)
        {
            const point& p = positions[i];
            if
            (
                !std::isfinite(p.x())
             || !std::isfinite(p.y())
             || !std::isfinite(p.z())
            )
            {
                daemon_->fail
                (
                    "POSITIONS are not finite at bead " + std::to_string(i)
                );
            }
        }
    }

    Pstream::scatter(provisional);
    Pstream::scatter(stop);
    Pstream::scatter(positions);

    if (stop)
    {
        Info<< type() << ": the daemon was asked to end the run:"
            << " writing and stopping after the next step" << endl;
        time_.stopAt(Time::stopAtControls::saWriteNow);
    }

    t.wait += watch.lap();

    return provisional;
}


template<class Type>
void Foam::functionObjects::fiberCoupling::collect
(
    const Field<Type>& mine,
    message& m
) const
{
    List<labelList> indices(Pstream::nProcs());
    List<Field<Type>> values(Pstream::nProcs());
    indices[Pstream::myProcNo()] = sampler_->indices();
    values[Pstream::myProcNo()] = mine;
    Pstream::gatherList(indices);
    Pstream::gatherList(values);

    if (!Pstream::master())
    {
        return;
    }

    Field<Type> all(beads_);
    label found = 0;
    forAll(indices, rank)
    {
        UIndirectList<Type>(all, indices[rank]) = values[rank];
        found += indices[rank].size();
    }
    if (found != beads_)
    {
        FatalErrorInFunction
            << found << " of " << beads_ << " beads were found in the mesh"
            << exit(FatalError);
    }
    forAll(all, i)
    {
        if (!std::isfinite(magSqr(all[i])))
        {
            FatalErrorInFunction
                << "the flow at bead " << i << " is not finite at step "
                << step_ << ", time " << time_.value() << exit(FatalError);
        }
    }

    m.append(all.cdata(), all.size());
}


void Foam::functionObjects::fiberCoupling::sendSample
(
    bool provisional,
    times& t
)
{
    const volVectorField& U = mesh_.lookupObject<volVectorField>(UName_);
    stopwatch watch;

    tmp<volVectorField> rotation;
    tmp<volTensorField> gradient;
    if (ambient_ == ROTATION)
    {
        rotation = 0.5*fvc::curl(U);
    }
    else if (ambient_ == GRADIENT)
    {
        // OpenFOAM's gradient is the transpose of du_i/dx_j
        gradient = fvc::grad(U)().T();
    }
    t.derivative += watch.lap();

    message sample(message::SAMPLE, step_, time_.value());

    collect(sampler_->sample(U), sample);
    if (rotation.valid())
    {
        collect(sampler_->sample(rotation()), sample);
    }
    if (gradient.valid())
    {
        collect(sampler_->sample(gradient()), sample);
    }
    t.interpolation += watch.lap();

    if (Pstream::master())
    {
        // with the case's own fields of this time, which are on disk already
        if (time_.writeTime() && !provisional)
        {
            message save(message::SAVE, step_, time_.value());
            save.appendText(timeFolder());
            daemon_->send(save);
        }
        daemon_->send(sample);
    }
    t.sending += watch.lap();
}


void Foam::functionObjects::fiberCoupling::exchange()
{
    times t{0, 0, 0, 0};
    scalar arrived = 0;
    bool provisional = true;

    while (provisional)
    {
        List<point> positions;
        provisional = receivePositions(positions, t);
        arrived = timeOfDay();

        stopwatch watch;
        sampler_->locate(positions);
        t.interpolation += watch.lap();

        // before the daemon writes its state, which completes a time folder
        if (writeCloud_ && time_.writeTime() && !provisional)
        {
            writeFiberCloud(mesh_, sampler_(), families_);
        }

        sendSample(provisional, t);
    }

    writeTimes(t, arrived, timeOfDay());
}


void Foam::functionObjects::fiberCoupling::writeTimes
(
    const times& t,
    scalar arrived,
    scalar left
)
{
    if (Pstream::master())
    {
        writeCurrentTime(file());
        file()
            << token::TAB << t.wait << token::TAB << t.derivative
            << token::TAB << t.interpolation << token::TAB << t.sending
            << setprecision(17)
            << token::TAB << arrived << token::TAB << left
            << setprecision(writePrecision_) << endl;
    }
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

    if (postProcess || time_.timeIndex() == step_)
    {
        return true;    // executed again at the end of the run
    }

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

    ++step_;
    exchange();

    return true;
}


bool Foam::functionObjects::fiberCoupling::end()
{
    const fatalErrors guard;

    if (daemon_.valid())
    {
        daemon_->send(message(message::END, step_, time_.value()));

        // the daemon is one step ahead: its last positions are not needed
        daemon_->receive
        (
            message::POSITIONS,
            step_ + 1,
            std::uint64_t(beads_)*sizeof(point)
        );
        daemon_->receive(message::GOODBYE, step_, 0);
        daemon_.clear();
    }

    return true;
}
