#include "fileConnection.H"

#include <cerrno>
#include <cstdio>
#include <cstring>
#include <fcntl.h>
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
    received_(0),
    outgoing_(-1)
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
    if (outgoing_ >= 0)
    {
        ::close(outgoing_);
    }
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


void Foam::fileConnection::put
(
    const char* data,
    std::size_t size,
    const bool last
)
{
    const std::string target(messageName("flow", sent_));
    const std::string part(target + ".part");

    if (sent_ == 0)
    {
        first_.append(data, size);
    }
    if (outgoing_ < 0)
    {
        outgoing_ = ::open
        (
            path(part).c_str(),
            O_WRONLY | O_CREAT | O_EXCL | O_NOFOLLOW | O_CLOEXEC,
            0600
        );
    }

    bool written = (outgoing_ >= 0);
    while (written && size)
    {
        const ssize_t n = ::write(outgoing_, data, size);
        written = (n > 0 || errno == EINTR);
        data += max(n, ssize_t(0));
        size -= max(n, ssize_t(0));
    }
    if (written && last)
    {
        written = (::close(outgoing_) == 0);
        outgoing_ = -1;
    }
    if (!written)
    {
        fail("cannot write " + peer_ + "/" + part + ": " + std::strerror(errno));
    }
    if (last && std::rename(path(part).c_str(), path(target).c_str()) != 0)
    {
        fail
        (
            "cannot rename " + peer_ + "/" + part + ": " + std::strerror(errno)
        );
    }
    sent_ += last;
}


void Foam::fileConnection::get(message::header& head)
{
    const auto end = deadline();
    useconds_t pause = 50;

    // Sleeps that grow with the wait: short beside what was waited for
    // already, so late by 10 % at most and never busy
    while (true)
    {
        // asked before the file is: a daemon's last word precedes its end
        const std::string now = session();
        incoming_.open
        (
            path(messageName("fibers", received_)),
            std::ios::binary
        );
        if (incoming_.is_open())
        {
            break;
        }
        if (now != session_)
        {
            if (received_ > 0 || now.empty())
            {
                fail("the daemon ended, or another one has taken its place");
            }
            // the file was one that a killed daemon had left
            session_ = now;
            sent_ = 0;
            const std::string again(std::move(first_));
            first_.clear();
            put(again.data(), again.size(), true);
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

    if (!incoming_.read(reinterpret_cast<char*>(&head), sizeof(head)))
    {
        fail
        (
            "short message in " + peer_ + "/" + messageName("fibers", received_)
        );
    }
}


void Foam::fileConnection::get(char* payload, const std::size_t size)
{
    const std::string source(messageName("fibers", received_++));

    // all of the file, and nothing behind it
    if
    (
        !incoming_.read(payload, size)
     || incoming_.peek() != std::ifstream::traits_type::eof()
    )
    {
        fail("message of the wrong length in " + peer_ + "/" + source);
    }
    incoming_.close();
    incoming_.clear();
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
