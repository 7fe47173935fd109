#include "socketConnection.H"
#include "sha256.H"

#include <cerrno>
#include <cstring>
#include <fcntl.h>
#include <netdb.h>
#include <netinet/in.h>
#include <netinet/tcp.h>
#include <poll.h>
#include <sstream>
#include <sys/socket.h>
#include <sys/stat.h>
#include <sys/un.h>
#include <unistd.h>

// * * * * * * * * * * * * * * * * Constructors  * * * * * * * * * * * * * * //

Foam::socketConnection::socketConnection
(
    const dictionary& coupling,
    const fileName& caseFolder,
    const daemonShare& share,
    const bool tcp
)
:
    connection(coupling, caseFolder, share),
    socket_(-1),
    address_(share.name("gbm", tcp ? ".tcp" : ".sock"))
{
    peer_ = case_/address_;

    const auto end = deadline();
    string why;

    while (socket_ < 0)
    {
        socket_ = tcp ? openTcp(why) : openUnix(why);

        if (socket_ < 0)
        {
            if (clock::now() > end)
            {
                fail
                (
                    "no daemon answers: " + why
                  + "; start it with '" + startCommand() + "'"
                );
            }
            ::usleep(20000);
        }
    }
}


Foam::socketConnection::~socketConnection()
{
    if (socket_ >= 0)
    {
        ::close(socket_);
    }
}


// * * * * * * * * * * * * * Private Member Functions  * * * * * * * * * * * //

int Foam::socketConnection::openUnix(string& why)
{
    // through the folder's descriptor: a socket's path holds 107 characters,
    // and a case may lie deeper
    const int folder = ::open(case_.c_str(), O_PATH | O_DIRECTORY | O_CLOEXEC);

    sockaddr_un address{};
    address.sun_family = AF_UNIX;
    std::snprintf
    (
        address.sun_path, sizeof(address.sun_path),
        "/proc/self/fd/%d/%s", folder, address_.c_str()
    );

    const int s =
        open(reinterpret_cast<sockaddr*>(&address), sizeof(address), why);
    ::close(folder);

    return s;
}


int Foam::socketConnection::openTcp(string& why)
{
    std::string host, port;
    if (!readAddress(host, port, why))
    {
        return -1;
    }
    const std::string place(host + " port " + port);

    // the daemon writes numbers, and no name has to be looked up
    addrinfo hints{};
    hints.ai_socktype = SOCK_STREAM;
    hints.ai_flags = AI_NUMERICHOST | AI_NUMERICSERV;
    addrinfo* found = nullptr;
    const int rc = ::getaddrinfo(host.c_str(), port.c_str(), &hints, &found);
    if (rc != 0)
    {
        why = "address " + place + ": " + ::gai_strerror(rc);
        return -1;
    }

    const int s = open(found->ai_addr, found->ai_addrlen, why);
    ::freeaddrinfo(found);

    if (s < 0)
    {
        why = place + ": " + why;
        return -1;
    }
    const int on = 1;
    ::setsockopt(s, IPPROTO_TCP, TCP_NODELAY, &on, sizeof(on));
    peer_ = place;
    return s;
}


int Foam::socketConnection::open
(
    const sockaddr* address,
    const unsigned size,
    string& why
) const
{
    // Not blocking: where the daemon's queue is full, the kernel would wait
    // far beyond the timeout. A later attempt may find another daemon.
    const int s = ::socket
    (
        address->sa_family, SOCK_STREAM | SOCK_CLOEXEC | SOCK_NONBLOCK, 0
    );
    int error = (s < 0 || ::connect(s, address, size) != 0) ? errno : 0;

    if (error == EINPROGRESS)
    {
        const auto end = clock::now() + std::chrono::seconds(2);
        socklen_t length = sizeof(error);
        if (!ready(s, POLLOUT, min(end, deadline())))
        {
            error = ETIMEDOUT;
        }
        else if (::getsockopt(s, SOL_SOCKET, SO_ERROR, &error, &length) != 0)
        {
            error = errno;
        }
    }
    if (error)
    {
        why = std::strerror(error);
        if (s >= 0)
        {
            ::close(s);
        }
        return -1;
    }
    return s;
}


bool Foam::socketConnection::readAddress
(
    std::string& host,
    std::string& port,
    string& why
)
{
    const fileName file(case_/address_);
    const int fd = ::open(file.c_str(), O_RDONLY | O_NOFOLLOW | O_CLOEXEC);
    struct stat found;
    if (fd < 0 || ::fstat(fd, &found) != 0)
    {
        why = file + ": " + std::strerror(errno);
        return false;
    }

    char text[512];
    const ssize_t n = ::read(fd, text, sizeof(text));
    ::close(fd);
    if (found.st_uid != ::geteuid() || (found.st_mode & 077))
    {
        why = file + " is not of this user, or others may read or write it";
        return false;
    }

    std::istringstream is(std::string(text, n > 0 ? n : 0));
    is >> host >> port >> token_;
    if (token_.empty())
    {
        why = file + " holds no address and token";
        return false;
    }
    return true;
}


bool Foam::socketConnection::ready
(
    const int socket,
    const short events,
    const clock::time_point end
)
{
    while (true)
    {
        const auto left = std::chrono::duration_cast<std::chrono::milliseconds>
        (
            end - clock::now()
        ).count();

        pollfd p{socket, events, 0};
        const int n = left > 0 ? ::poll(&p, 1, int(min(left, 1000000L))) : 0;

        // where poll itself fails, so will what follows, and say why
        if (n > 0 || (n < 0 && errno != EINTR))
        {
            return true;
        }
        if (n == 0 && clock::now() >= end)
        {
            return false;
        }
    }
}


void Foam::socketConnection::wait(short events, clock::time_point end)
{
    if (!ready(socket_, events, end))
    {
        fail
        (
            "the daemon was silent for " + Foam::name(timeout_)
          + " s (entry timeout of constant/fiberProperties)"
        );
    }
}


void Foam::socketConnection::put
(
    const char* data,
    std::size_t size,
    const bool last
)
{
    // what belongs together in as few packets as possible
    const int flags = MSG_NOSIGNAL | MSG_DONTWAIT | (last ? 0 : MSG_MORE);
    const auto end = deadline();

    while (size > 0)
    {
        wait(POLLOUT, end);
        const ssize_t n = ::send(socket_, data, size, flags);

        if (n < 0 && errno != EAGAIN && errno != EINTR)
        {
            // what the daemon said before it closed names the cause
            const string gone
            (
                string("the daemon is gone: ") + std::strerror(errno)
            );
            const string cause(lastWord());
            fail(cause.empty() ? gone : string("the daemon stopped: " + cause));
        }
        if (n > 0)
        {
            data += n;
            size -= n;
        }
    }
}


void Foam::socketConnection::get(message::header& head)
{
    get(reinterpret_cast<char*>(&head), sizeof(head));
}


void Foam::socketConnection::get(char* data, std::size_t size)
{
    const auto end = deadline();

    while (size > 0)
    {
        wait(POLLIN, end);
        const ssize_t n = ::recv(socket_, data, size, MSG_DONTWAIT);

        if (n == 0)
        {
            fail("the daemon closed the connection");
        }
        if (n < 0 && errno != EAGAIN && errno != EINTR)
        {
            fail(string("the daemon is gone: ") + std::strerror(errno));
        }
        if (n > 0)
        {
            data += n;
            size -= n;
        }
    }
}


// * * * * * * * * * * * * * * * Member Functions  * * * * * * * * * * * * * //

void Foam::socketConnection::authenticate(const message& hello)
{
    if (token_.empty())
    {
        return;     // a Unix socket, which only this user can reach
    }

    // the daemon's number, and its code of all that was said
    const std::size_t bytes = 32;
    const message challenge
    (
        receive(message::CHALLENGE, hello.head.step, 2*bytes)
    );
    const std::string said
    (
        hello.bytes() + challenge.text().substr(0, bytes)
    );
    if (challenge.text().substr(bytes) != hmacSha256(token_, "fibers" + said))
    {
        fail
        (
            "what answers there does not know the token in " + case_/address_
          + ": it is not the daemon of this case"
        );
    }

    message proof(message::PROOF, hello.head.step, hello.head.time);
    proof.appendText(hmacSha256(token_, "flow" + said));
    send(proof);
}


void Foam::socketConnection::finish()
{
    // a daemon closes at once; one that does not has said enough
    char byte;
    if
    (
        ready(socket_, POLLIN, clock::now() + std::chrono::seconds(1))
     && ::recv(socket_, &byte, 1, MSG_DONTWAIT) > 0
    )
    {
        fail("GOODBYE is followed by further bytes");
    }
}
