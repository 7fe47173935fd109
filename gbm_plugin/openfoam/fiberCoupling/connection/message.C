#include "message.H"
#include <cstring>

static_assert
(
    __BYTE_ORDER__ == __ORDER_LITTLE_ENDIAN__,
    "the protocol is little-endian"
);


Foam::message::message()
:
    head()
{}


Foam::message::message(type t, std::int64_t step, double time)
:
    head{{'G', 'B', 'M', 'C'}, version, t, 0, 0, step, time, 0}
{}


Foam::string Foam::message::name() const
{
    static const char* names[] =
    {
        "HELLO", "WELCOME", "POSITIONS", "SAMPLE", "SAVE", "END", "GOODBYE",
        "ERROR"
    };

    return
        head.type >= HELLO && head.type <= ERROR
      ? string(names[head.type - 1])
      : string("message of unknown type " + std::to_string(head.type));
}


void Foam::message::check(const string& peer) const
{
    if (std::memcmp(head.magic, "GBMC", 4) != 0)
    {
        FatalErrorInFunction
            << "what answers on " << peer.c_str()
            << " is not a gbm daemon" << exit(FatalError);
    }
    if (head.version != version)
    {
        FatalErrorInFunction
            << "the daemon on " << peer.c_str() << " speaks version "
            << label(head.version) << " of the coupling protocol, this plugin "
            << label(version) << ": rebuild the plugin with ./Allwmake"
            << exit(FatalError);
    }
    if (head.size > maxSize)
    {
        FatalErrorInFunction
            << "the daemon on " << peer.c_str() << " announces a message of "
            << double(head.size) << " bytes: not a message" << exit(FatalError);
    }
}
