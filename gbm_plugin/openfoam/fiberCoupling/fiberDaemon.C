#include "fiberDaemon.H"

// * * * * * * * * * * * * * * * * Constructors  * * * * * * * * * * * * * * //

Foam::fiberDaemon::fiberDaemon
(
    const dictionary& coupling,
    const fileName& caseFolder,
    const daemonShare& share,
    message hello
)
:
    connection_(connection::New(coupling, caseFolder, share)),
    beads_(0),
    wanted_(NOTHING)
{
    hello.appendText(connection_->token());
    connection_->send(hello);

    readWelcome
    (
        connection_->receive
        (
            message::WELCOME, hello.head.step, 40, message::maxText
        )
    );
}


// * * * * * * * * * * * * * Private Member Functions  * * * * * * * * * * * //

void Foam::fiberDaemon::readWelcome(const message& m)
{
    // what to sample, how many families, then fibers, beads and the first
    // fiber of each
    const std::vector<std::int64_t> n(m.values<std::int64_t>());

    bool valid = n[0] >= NOTHING && n[0] <= GRADIENT
     && m.payload.size() == sizeof(std::int64_t)*n.size()
     && n.size() % 3 == 2 && n[1] == std::int64_t(n.size()/3);

    std::int64_t beads = 0;
    for (std::size_t i = 2; valid && i < n.size(); i += 3)
    {
        valid = n[i] > 0 && n[i + 1] > 0 && n[i] <= labelMax/n[i + 1]
         && n[i + 2] >= 0 && n[i + 2] <= labelMax - n[i];
        if (valid)
        {
            beads += n[i]*n[i + 1];
            families_.append
            ({
                families_.size(), label(n[i]), label(n[i + 1]), label(n[i + 2])
            });
        }
    }
    // all that a bead is sampled for has a number
    if (!valid || beads > labelMax/12)
    {
        connection_->fail("WELCOME holds numbers that are not allowed");
    }

    wanted_ = ambient(n[0]);
    beads_ = beads;
}


// * * * * * * * * * * * * * * * Member Functions  * * * * * * * * * * * * * //

std::uint32_t Foam::fiberDaemon::receivePositions
(
    const label step,
    const scalar time,
    const scalar tolerance,
    UList<point> positions
)
{
    const std::uint64_t size = std::uint64_t(beads_)*sizeof(point);
    const message m(connection_->receive(message::POSITIONS, step, size));

    // isfinite first: comparing with NaN would raise SIGFPE
    if (!std::isfinite(m.head.time) || mag(m.head.time - time) > tolerance)
    {
        connection_->fail
        (
            "POSITIONS are of time " + Foam::name(m.head.time)
          + ", expected time " + Foam::name(time)
        );
    }

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
            connection_->fail
            (
                "POSITIONS are not finite at bead " + std::to_string(i)
            );
        }
    }

    return m.head.flags;
}


void Foam::fiberDaemon::save
(
    const label step,
    const scalar time,
    const std::string& folder
)
{
    message m(message::SAVE, step, time);
    m.appendText(folder);
    connection_->send(m);
}


void Foam::fiberDaemon::sendSample
(
    const label step,
    const scalar time,
    const UList<scalar>& values
)
{
    // on the wire the velocities of all beads come first
    const label extra = components(wanted_);
    message m(message::SAMPLE, step, time);
    scalar* velocity =
        reinterpret_cast<scalar*>(m.extend(values.size()*sizeof(scalar)));
    scalar* ambient = velocity + 3*beads_;
    const scalar* value = values.cdata();

    for (label bead = 0; bead < beads_; ++bead)
    {
        scalar sum = 0;
        for (label i = 0; i < 3 + extra; ++i)
        {
            sum += mag(value[i]);
        }
        if (!std::isfinite(sum))
        {
            FatalErrorInFunction
                << "the flow at bead " << bead << " is not finite at step "
                << step << ", time " << time << exit(FatalError);
        }
        velocity = std::copy_n(value, 3, velocity);
        ambient = std::copy_n(value + 3, extra, ambient);
        value += 3 + extra;
    }

    connection_->send(m);
}


void Foam::fiberDaemon::end(const label step, const scalar time)
{
    connection_->send(message(message::END, step, time));

    // the daemon is one step ahead: its last positions are not needed
    connection_->receive
    (
        message::POSITIONS,
        step + 1,
        std::uint64_t(beads_)*sizeof(point)
    );
    connection_->receive(message::GOODBYE, step, 0);
    connection_.clear();
}
