#include "fileConnection.H"
#include "OSspecific.H"

#include <cerrno>
#include <cstdio>
#include <cstring>
#include <fstream>
#include <unistd.h>

// * * * * * * * * * * * * * * * * Constructors  * * * * * * * * * * * * * * //

Foam::fileConnection::fileConnection
(
    const dictionary& coupling,
    const fileName& caseFolder,
    const daemonShare& share
)
:
    connection(coupling, caseFolder, share),
    folder_(case_/share.name("exchange")),
    sent_(0),
    received_(0)
{
    peer_ = folder_;

    const auto end = deadline();
    while ((session_ = session()).empty())
    {
        if (clock::now() > end)
        {
            fail
            (
                "no daemon answers: there is no file " + folder_/"session"
              + "; start it with '" + startCommand() + "'"
            );
        }
        ::usleep(20000);
    }
}


// * * * * * * * * * * * * * Private Member Functions  * * * * * * * * * * * //

std::string Foam::fileConnection::session() const
{
    std::ifstream is(folder_/"session");
    std::string word;
    is >> word;
    return word;
}


Foam::fileName Foam::fileConnection::path
(
    const char* from,
    const label n
) const
{
    return folder_/(session_ + "." + from + "." + std::to_string(n));
}


void Foam::fileConnection::write(const message& m)
{
    if (sent_ == 0)
    {
        first_ = m;
    }
    const fileName target(path("flow", sent_++));
    const fileName part(target + ".part");
    {
        std::ofstream os(part, std::ios::binary);
        os.write(reinterpret_cast<const char*>(&m.head), sizeof(m.head));
        os.write(m.payload.data(), m.payload.size());
        os.close();
        if (!os)
        {
            fail("cannot write " + part + ": " + std::strerror(errno));
        }
    }
    if (std::rename(part.c_str(), target.c_str()) != 0)
    {
        fail("cannot rename " + part + ": " + std::strerror(errno));
    }
}


void Foam::fileConnection::read(message& m, std::uint64_t most)
{
    fileName source(path("fibers", received_++));
    const auto end = deadline();
    useconds_t pause = 50;

    // Sleeps that grow with the wait: short beside what was waited for
    // already, so late by 10 % at most and never busy
    std::ifstream is;
    while (true)
    {
        // asked before the file is: a daemon's last word precedes its end
        const std::string now = session();
        is.open(source, std::ios::binary);
        if (is.is_open())
        {
            break;
        }
        if (now != session_)
        {
            if (received_ > 1 || now.empty())
            {
                fail("the daemon ended, or another one has taken its place");
            }
            // the file was one that a killed daemon had left
            session_ = now;
            sent_ = 0;
            write(first_);
            source = path("fibers", 0);
        }
        if (clock::now() > end)
        {
            fail
            (
                "the daemon was silent for " + Foam::name(timeout_)
              + " s (entry timeout of constant/fiberProperties)"
            );
        }
        ::usleep(pause);
        pause = min(useconds_t(1 + pause*11/10), useconds_t(20000));
    }

    is.read(reinterpret_cast<char*>(&m.head), sizeof(m.head));
    if (!is)
    {
        fail("short message in " + source);
    }
    const string problem(m.problem(most));
    if (!problem.empty())
    {
        fail(problem);
    }

    is.seekg(0, std::ios::end);
    if (std::uint64_t(is.tellg()) != sizeof(m.head) + m.head.size)
    {
        fail("message of the wrong length in " + source);
    }
    is.seekg(sizeof(m.head));
    m.payload.resize(m.head.size);
    is.read(m.payload.data(), m.payload.size());
    is.close();
    std::remove(source.c_str());
}
