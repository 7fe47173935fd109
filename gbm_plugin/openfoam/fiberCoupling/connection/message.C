#include "message.H"
#include "scalar.H"

static_assert
(
    sizeof(Foam::scalar) == 8,
    "the protocol is in double precision"
);

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
        "ERROR", "WAIT", "CHALLENGE", "PROOF", "FORCES"
    };

    return
        head.type >= HELLO && head.type <= FORCES
      ? string(names[head.type - 1])
      : string("message of unknown type " + std::to_string(head.type));
}


std::string Foam::message::line() const
{
    std::string result(text().substr(0, 1000));

    for (char& c : result)
    {
        // bytes of UTF-8 beyond ASCII are negative
        if ((c >= 0 && c < ' ') || c == 127)
        {
            c = '?';
        }
    }
    return result;
}


std::string Foam::message::bytes() const
{
    return
        std::string(reinterpret_cast<const char*>(&head), sizeof(head)) + text();
}


Foam::string Foam::message::problem(std::uint64_t most) const
{
    if (std::memcmp(head.magic, "GBMC", 4) != 0)
    {
        return "what answers is not a gbm daemon";
    }
    if (head.version != version)
    {
        return
            "the daemon speaks version " + std::to_string(head.version)
          + " of the coupling protocol, this plugin " + std::to_string(version)
          + ": rebuild the plugin with ./Allwmake";
    }
    if (head.flags & ~(head.type == POSITIONS ? provisional | stop : 0))
    {
        return name() + " has unknown flags: " + std::to_string(head.flags);
    }
    if (head.reserved)
    {
        return
            name() + " has " + std::to_string(head.reserved)
          + " where 0 is reserved";
    }
    if (!std::isfinite(head.time))
    {
        return name() + " has the time " + std::to_string(head.time);
    }
    if (head.size > max(most, maxText))
    {
        return
            name() + " announces " + std::to_string(head.size)
          + " bytes where at most " + std::to_string(most) + " are expected";
    }
    return string();
}
