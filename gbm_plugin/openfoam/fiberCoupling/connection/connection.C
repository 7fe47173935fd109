#include "connection.H"
#include "allowedEntries.H"
#include "besideSolver.H"
#include "socketConnection.H"
#include "fileConnection.H"
#include "OSspecific.H"

#include <cerrno>
#include <cstring>
#include <unistd.h>

std::string Foam::daemonShare::name
(
    const std::string& stem,
    const std::string& suffix
) const
{
    if (of == 1)
    {
        return stem + suffix;
    }
    return
        stem + "." + std::to_string(number) + "of" + std::to_string(of)
      + suffix;
}


Foam::autoPtr<Foam::connection> Foam::connection::New
(
    const dictionary& coupling,
    const fileName& caseFolder,
    const daemonShare& share
)
{
    allowedEntries
    (
        coupling,
        {
            "transport", "timeout", "host", "port", "daemons", "feedback",
            "ownDisturbance"
        }
    );

    const word transport =
        coupling.lookupOrDefault<word>("transport", "socket");

    if (transport == "socket" || transport == "tcp")
    {
        return autoPtr<connection>
        (
            new socketConnection
            (
                coupling, caseFolder, share, transport == "tcp"
            )
        );
    }
    if (transport == "file")
    {
        return autoPtr<connection>(
            new fileConnection(coupling, caseFolder, share)
        );
    }

    FatalIOErrorInFunction(coupling)
        << "transport '" << transport
        << "' is unknown; allowed: socket tcp file" << exit(FatalIOError);

    return nullptr;
}


Foam::connection::connection
(
    const dictionary& coupling,
    const fileName& caseFolder,
    const daemonShare& share
)
:
    case_(caseFolder),
    share_(share),
    timeout_(coupling.lookupOrDefault<scalar>("timeout", 120)),
    step_(-1),
    missing_(0)
{
    if (timeout_ <= 0)
    {
        FatalIOErrorInFunction(coupling)
            << "timeout = " << timeout_ << " must be positive [s]"
            << exit(FatalIOError);
    }
}


std::string Foam::connection::nonce()
{
    std::string bytes(32, '\0');

    if (::getentropy(&bytes[0], bytes.size()) != 0)
    {
        FatalErrorInFunction
            << "no random numbers: " << std::strerror(errno)
            << exit(FatalError);
    }
    return bytes;
}


Foam::string Foam::connection::startCommand() const
{
    return
        "gbm daemon " + case_
      + (share_.of > 1 ? " --share " + std::to_string(share_.number) : "");
}


Foam::connection::clock::time_point Foam::connection::deadline() const
{
    return clock::now() + std::chrono::microseconds(std::int64_t(timeout_*1e6));
}


void Foam::connection::fail(const string& what) const
{
    besideSolver::fail
    (
        "fiber coupling, step " + std::to_string(step_) + ": " + what
      + " (daemon on " + peer_ + ", its log: "
      + (case_/share_.name("log.gbmDaemon")) + ")"
    );
}


void Foam::connection::send(const message& m)
{
    begin(m);
    if (m.head.size)
    {
        add(m.payload.data(), m.payload.size());
    }
}


void Foam::connection::begin(const message& m)
{
    step_ = m.head.step;
    missing_ = m.head.size;
    put(reinterpret_cast<const char*>(&m.head), sizeof(m.head), !missing_);
}


void Foam::connection::add(const char* data, const std::size_t size)
{
    missing_ -= size;
    put(data, size, !missing_);
}


Foam::message Foam::connection::receive
(
    message::type expected,
    std::int64_t step,
    std::uint64_t least,
    std::uint64_t most,
    char* payload
)
{
    message m;
    const auto next = [&]()
    {
        get(m.head);
        const string problem(m.problem(most));
        if (!problem.empty())
        {
            fail(problem);
        }
        if (m.head.type != expected || !payload)
        {
            m.payload.resize(m.head.size);
            get(m.payload.data(), m.head.size);
        }
    };
    next();

    // each a sign of life, after which the patience is as long again
    while (m.head.type == message::WAIT && expected == message::WELCOME)
    {
        Info<< "fiber coupling: " << m.line().c_str() << endl;
        next();
    }

    if (m.head.type == message::ERROR)
    {
        fail("the daemon stopped: " + m.line());
    }
    if (m.head.type != expected)
    {
        fail
        (
            "expected " + message(expected, step, 0).name() + ", received "
          + m.name()
        );
    }
    if (m.head.step != step)
    {
        fail
        (
            m.name() + " is of step " + std::to_string(m.head.step)
          + ", expected step " + std::to_string(step)
        );
    }
    if (m.head.size < least || m.head.size > most)
    {
        fail
        (
            m.name() + " has " + std::to_string(m.head.size)
          + " bytes, expected " + std::to_string(least)
        );
    }
    if (payload)
    {
        get(payload, m.head.size);
    }

    return m;
}


Foam::string Foam::connection::lastWord()
{
    message last;
    get(last.head);
    if (!last.problem(message::maxText).empty())
    {
        return string();
    }
    last.payload.resize(last.head.size);
    get(last.payload.data(), last.head.size);

    return last.head.type == message::ERROR ? last.line() : std::string();
}
