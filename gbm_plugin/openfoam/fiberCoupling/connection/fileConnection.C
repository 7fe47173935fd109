#include "fileConnection.H"

#include <cerrno>
#include <cstdio>
#include <cstring>
#include <fcntl.h>
#include <fstream>
#include <sys/stat.h>
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
    folder_(-1),
    sent_(0),
    received_(0)
{
    peer_ = case_/share.name("exchange");

    const auto end = deadline();
    string why;
    while (!openFolder(why) || (session_ = session()).empty())
    {
        if (clock::now() > end)
        {
            fail
            (
                "no daemon answers: "
              + (why.empty() ? "there is no file " + peer_ + "/session" : why)
              + "; start it with '" + startCommand() + "'"
            );
        }
        ::usleep(20000);
    }
}


Foam::fileConnection::~fileConnection()
{
    if (folder_ >= 0)
    {
        ::close(folder_);
    }
}


// * * * * * * * * * * * * * Private Member Functions  * * * * * * * * * * * //

bool Foam::fileConnection::openFolder(string& why)
{
    if (folder_ >= 0)
    {
        return true;
    }

    const int fd = ::open
    (
        peer_.c_str(), O_PATH | O_DIRECTORY | O_NOFOLLOW | O_CLOEXEC
    );
    struct stat found;
    if (fd < 0 || ::fstat(fd, &found) != 0)
    {
        why = peer_ + ": " + std::strerror(errno);
        return false;
    }
    if (found.st_uid != ::geteuid() || (found.st_mode & 077))
    {
        why = peer_ + " is not of this user, or others may enter it";
        ::close(fd);
        return false;
    }

    why.clear();
    folder_ = fd;
    return true;
}


std::string Foam::fileConnection::path(const std::string& name) const
{
    return "/proc/self/fd/" + std::to_string(folder_) + "/" + name;
}


std::string Foam::fileConnection::session() const
{
    std::ifstream is(path("session"));
    std::string word;
    is >> word;
    return word;
}


std::string Foam::fileConnection::messageName
(
    const char* from,
    const label n
) const
{
    return session_ + "." + from + "." + std::to_string(n);
}


void Foam::fileConnection::write(const message& m)
{
    if (sent_ == 0)
    {
        first_ = m;
    }
    const std::string target(messageName("flow", sent_++));
    const std::string part(target + ".part");

    const int fd = ::open
    (
        path(part).c_str(),
        O_WRONLY | O_CREAT | O_EXCL | O_NOFOLLOW | O_CLOEXEC,
        0600
    );
    bool written = (fd >= 0);
    const auto put = [&](const char* data, std::size_t size)
    {
        while (written && size)
        {
            const ssize_t n = ::write(fd, data, size);
            written = (n > 0 || errno == EINTR);
            data += max(n, ssize_t(0));
            size -= max(n, ssize_t(0));
        }
    };
    put(reinterpret_cast<const char*>(&m.head), sizeof(m.head));
    put(m.payload.data(), m.payload.size());

    if (!written || ::close(fd) != 0)
    {
        fail("cannot write " + peer_ + "/" + part + ": " + std::strerror(errno));
    }
    if (std::rename(path(part).c_str(), path(target).c_str()) != 0)
    {
        fail("cannot rename " + peer_ + "/" + part + ": " + std::strerror(errno));
    }
}


void Foam::fileConnection::read(message& m, std::uint64_t most)
{
    std::string source(messageName("fibers", received_++));
    const auto end = deadline();
    useconds_t pause = 50;

    // Sleeps that grow with the wait: short beside what was waited for
    // already, so late by 10 % at most and never busy
    std::ifstream is;
    while (true)
    {
        // asked before the file is: a daemon's last word precedes its end
        const std::string now = session();
        is.open(path(source), std::ios::binary);
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
            source = messageName("fibers", 0);
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
        fail("short message in " + peer_ + "/" + source);
    }
    const string problem(m.problem(most));
    if (!problem.empty())
    {
        fail(problem);
    }

    is.seekg(0, std::ios::end);
    if (std::uint64_t(is.tellg()) != sizeof(m.head) + m.head.size)
    {
        fail("message of the wrong length in " + peer_ + "/" + source);
    }
    is.seekg(sizeof(m.head));
    m.payload.resize(m.head.size);
    is.read(m.payload.data(), m.payload.size());
    is.close();
    std::remove(path(source).c_str());
}


// * * * * * * * * * * * * * * * Member Functions  * * * * * * * * * * * * * //

void Foam::fileConnection::finish()
{
    struct stat found;
    const std::string next(messageName("fibers", received_));

    if (::lstat(path(next).c_str(), &found) == 0)
    {
        fail("GOODBYE is followed by " + peer_ + "/" + next);
    }
}
