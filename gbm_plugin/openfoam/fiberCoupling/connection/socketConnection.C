#include "socketConnection.H"
#include "IFstream.H"
#include "OSspecific.H"

#include <cerrno>
#include <cstring>
#include <fcntl.h>
#include <netdb.h>
#include <netinet/in.h>
#include <netinet/tcp.h>
#include <poll.h>
#include <sys/socket.h>
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
    const int s = ::socket(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC, 0);

    sockaddr_un address{};
    address.sun_family = AF_UNIX;
    std::snprintf
    (
        address.sun_path, sizeof(address.sun_path),
        "/proc/self/fd/%d/%s", folder, address_.c_str()
    );

    const int rc =
        ::connect(s, reinterpret_cast<sockaddr*>(&address), sizeof(address));
    const int error = errno;
    ::close(folder);

    if (rc == 0)
    {
        return s;
    }

    why = std::strerror(error);
    ::close(s);
    return -1;
}


int Foam::socketConnection::openTcp(string& why)
{
    const fileName file(case_/address_);
    if (!isFile(file, false))
    {
        why = "there is no file " + file;
        return -1;
    }

    // host port token
    std::ifstream is(file);
    std::string host, port, token;
    is >> host >> port >> token;

    addrinfo hints{};
    hints.ai_socktype = SOCK_STREAM;
    addrinfo* found = nullptr;
    const int rc = ::getaddrinfo(host.c_str(), port.c_str(), &hints, &found);
    if (rc != 0)
    {
        why = "address " + host + " port " + port + ": " + ::gai_strerror(rc);
        return -1;
    }

    int s = -1;
    for (addrinfo* a = found; a && s < 0; a = a->ai_next)
    {
        s = ::socket(a->ai_family, a->ai_socktype | SOCK_CLOEXEC, 0);
        if (s >= 0 && ::connect(s, a->ai_addr, a->ai_addrlen) != 0)
        {
            why = host + " port " + port + ": " + std::strerror(errno);
            ::close(s);
            s = -1;
        }
    }
    ::freeaddrinfo(found);

    if (s >= 0)
    {
        const int on = 1;
        ::setsockopt(s, IPPROTO_TCP, TCP_NODELAY, &on, sizeof(on));
        token_ = token;
        peer_ = host + " port " + port;
    }
    return s;
}


void Foam::socketConnection::wait(short events, clock::time_point end)
{
    while (true)
    {
        const auto left = std::chrono::duration_cast<std::chrono::milliseconds>
        (
            end - clock::now()
        ).count();

        pollfd p{socket_, events, 0};
        const int n = left > 0 ? ::poll(&p, 1, int(min(left, 1000000L))) : 0;

        if (n > 0)
        {
            return;
        }
        if (n == 0 && clock::now() >= end)
        {
            fail
            (
                "the daemon was silent for " + Foam::name(timeout_)
              + " s (entry timeout of constant/fiberProperties)"
            );
        }
        if (n < 0 && errno != EINTR)
        {
            fail(string("poll: ") + std::strerror(errno));
        }
    }
}


void Foam::socketConnection::writeAll(const char* data, std::size_t size)
{
    const auto end = deadline();

    while (size > 0)
    {
        wait(POLLOUT, end);
        const ssize_t n =
            ::send(socket_, data, size, MSG_NOSIGNAL | MSG_DONTWAIT);

        if (n < 0 && errno != EAGAIN && errno != EINTR)
        {
            // what the daemon said before it closed names the cause
            message last;
            read(last, message::maxText);
            if (last.head.type == message::ERROR)
            {
                fail("the daemon stopped: " + last.text());
            }
            fail(string("the daemon is gone: ") + std::strerror(errno));
        }
        if (n > 0)
        {
            data += n;
            size -= n;
        }
    }
}


void Foam::socketConnection::readAll
(
    char* data,
    std::size_t size,
    clock::time_point end
)
{
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


void Foam::socketConnection::write(const message& m)
{
    writeAll(reinterpret_cast<const char*>(&m.head), sizeof(m.head));
    writeAll(m.payload.data(), m.payload.size());
}


void Foam::socketConnection::read(message& m, std::uint64_t most)
{
    const auto end = deadline();

    readAll(reinterpret_cast<char*>(&m.head), sizeof(m.head), end);
    const string problem(m.problem(most));
    if (!problem.empty())
    {
        fail(problem);
    }
    m.payload.resize(m.head.size);
    readAll(m.payload.data(), m.payload.size(), end);
}
