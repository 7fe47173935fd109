#include "fiberDaemon.H"
#include "besideSolver.H"
#include "scalarList.H"
#include "Switch.H"

// * * * * * * * * * * * * * * * * Constructors  * * * * * * * * * * * * * * //

Foam::fiberDaemon::fiberDaemon
(
    const dictionary& fiberProperties,
    const fileName& caseFolder,
    const daemonShare& share,
    message hello
)
:
    connection_
    (
        connection::New
        (
            fiberProperties.subOrEmptyDict("coupling"), caseFolder, share
        )
    ),
    families_(readFamilies(fiberProperties, caseFolder, share)),
    beads_(0),
    wanted_(NOTHING),
    feedback_
    (
        fiberProperties.subOrEmptyDict("coupling")
       .lookupOrDefault<Switch>("feedback", false)
    )
{
    hello.appendText(connection::nonce());
    connection_->send(hello);
    connection_->authenticate(hello);

    readWelcome
    (
        connection_->receive
        (
            message::WELCOME, hello.head.step, 24, message::maxText
        )
    );
}


// * * * * * * * * * * * * * Private Member Functions  * * * * * * * * * * * //

void Foam::fiberDaemon::readWelcome(const message& m)
{
    // what to sample, whether forces come back, how many families, then fibers,
    // beads and the first fiber of each
    const std::vector<std::int64_t> n(m.values<std::int64_t>());

    if (n[0] < NOTHING || n[0] > GRADIENT)
    {
        connection_->fail
        (
            "WELCOME asks for the unknown number " + std::to_string(n[0])
          + " beside the velocity"
        );
    }

    if (n[1] != std::int64_t(feedback_))
    {
        connection_->fail
        (
            "WELCOME has feedback " + std::to_string(n[1])
          + " and constant/fiberProperties " + std::to_string(int(feedback_))
          + ": daemon and solver are not on the same case, or it was edited in"
            " between"
        );
    }

    std::vector<std::int64_t> ours({families_.size()});
    std::int64_t beads = 0;
    for (const fiberFamily& f : families_)
    {
        ours.insert(ours.end(), {f.count, f.beads, f.first});
        beads += f.size();
    }
    const std::vector<std::int64_t> theirs(n.begin() + 2, n.end());

    if (theirs != ours || m.payload.size() % sizeof(std::int64_t))
    {
        const auto text = [](const std::vector<std::int64_t>& numbers)
        {
            std::string s;
            for (std::size_t i = 0; i < numbers.size() && i < 16; ++i)
            {
                s += (i ? " " : "") + std::to_string(numbers[i]);
            }
            return s;
        };
        connection_->fail
        (
            "WELCOME and constant/fiberProperties have different families"
            " (their number; fibers, beads and first fiber of each): "
          + text(theirs) + ", and " + text(ours)
          + ": daemon and solver are not on the same case, or it was edited"
            " in between"
        );
    }
    if (beads > labelMax/12)
    {
        connection_->fail
        (
            std::to_string(beads) + " beads are too many for one daemon, which"
            " can have " + std::to_string(labelMax/12) + ": see the entry"
            " daemons of constant/fiberProperties"
        );
    }

    wanted_ = ambient(n[0]);
    beads_ = beads;
}


void Foam::fiberDaemon::checkFinite
(
    const char* what,
    const UList<scalar>& numbers,
    const label n
) const
{
    forAll(numbers, i)
    {
        if (!std::isfinite(numbers[i]))
        {
            connection_->fail
            (
                std::string(what) + " are not finite at bead "
              + std::to_string((i/n) % beads_)
            );
        }
    }
}


void Foam::fiberDaemon::checkTime
(
    const message& m,
    const scalar time,
    const scalar tolerance
) const
{
    if (mag(m.head.time - time) > tolerance)
    {
        connection_->fail
        (
            m.name() + " are of time " + Foam::name(m.head.time)
          + ", expected time " + Foam::name(time)
        );
    }
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
    const message m
    (
        connection_->receive
        (
            message::POSITIONS,
            step,
            std::uint64_t(beads_)*sizeof(point),
            reinterpret_cast<char*>(positions.begin())
        )
    );

    checkTime(m, time, tolerance);
    checkFinite
    (
        "POSITIONS",
        UList<scalar>
        (
            reinterpret_cast<scalar*>(positions.begin()), 3*positions.size()
        ),
        3
    );

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
    const UList<scalar>& values,
    const bool keep
)
{
    const label n = 3 + components(wanted_);

    forAll(values, i)
    {
        if (!std::isfinite(values[i]))
        {
            besideSolver::fail
            (
                "the flow at bead " + std::to_string(i/n)
              + " is not finite at step " + std::to_string(step) + ", time "
              + Foam::name(time)
            );
        }
    }

    message m(message::SAMPLE, step, time);
    m.head.flags = keep ? message::keep : 0;
    m.head.size = values.size()*sizeof(scalar);
    connection_->begin(m);

    // on the wire the velocities of all beads come first, then the rest of
    // all; in parts, as one more list of all may not fit
    const label beadsOfPart = 16384;
    std::vector<scalar> part;
    const auto add = [&](const label from, const label to)
    {
        for (label bead = 0; bead < beads_ && from < to; bead += beadsOfPart)
        {
            part.clear();
            const label end = min(beads_, bead + beadsOfPart);
            for (label b = bead; b < end; ++b)
            {
                const scalar* value = values.cdata() + n*b;
                part.insert(part.end(), value + from, value + to);
            }
            connection_->add
            (
                reinterpret_cast<const char*>(part.data()),
                part.size()*sizeof(scalar)
            );
        }
    };
    part.reserve(min(beads_, beadsOfPart)*max(label(3), n - 3));
    add(0, 3);
    add(3, n);
}


void Foam::fiberDaemon::receiveForces
(
    const label step,
    const scalar time,
    const scalar tolerance,
    UList<scalar> loads
)
{
    // on the wire the forces of all beads come before the torques of all
    scalarList came(loads.size());
    const message m
    (
        connection_->receive
        (
            message::FORCES,
            step,
            std::uint64_t(came.size())*sizeof(scalar),
            reinterpret_cast<char*>(came.begin())
        )
    );
    checkTime(m, time, tolerance);
    checkFinite("FORCES", came, 3);

    for (label bead = 0; bead < beads_; ++bead)
    {
        std::copy_n(came.cdata() + 3*bead, 3, loads.begin() + 6*bead);
        std::copy_n
        (
            came.cdata() + 3*(beads_ + bead), 3, loads.begin() + 6*bead + 3
        );
    }
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
    connection_->finish();
    connection_.clear();
}
