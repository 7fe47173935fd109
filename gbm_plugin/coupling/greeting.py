"""The beginning of a connection: the solver says what it runs, and both sides show that they are of this case.

Where others can reach the daemon's place (TCP), both know a token from a file that only their user reads. It never
travels. The daemon sends a random number with a code (HMAC-SHA-256, RFC 2104) of all that was said so far, the
solver's own random number in it; the solver answers with a code of the same. So neither can be played by somebody who
has taken the port, or who repeats what was heard in another run.
"""

from __future__ import annotations

import hmac
import secrets
from collections.abc import Generator

from .message import NONCE_SIZE, Hello, Kind, Message, ProtocolError

Dialogue = Generator[Message | None, Message, tuple[Message, Hello]]


def greeting(token: str) -> Dialogue:
    """The daemon's part: is sent what arrives, yields what is to be answered, and returns HELLO, with its values.

    token: empty where nobody else can reach this place. ProtocolError where it is not the solver who speaks.
    """
    first = yield None
    _expect(Kind.HELLO, first)
    hello = Hello.decode(first.payload)
    if token:
        nonce = secrets.token_bytes(NONCE_SIZE)
        said = first.encode() + nonce
        challenge = nonce + code(token, "fibers", said)
        answer = yield Message(Kind.CHALLENGE, first.step, first.time, challenge)
        _expect(Kind.PROOF, answer)
        if not hmac.compare_digest(code(token, "flow", said), bytes(answer.payload)):
            raise ProtocolError("the solver that connected does not know the token of this daemon")
    return first, hello


def code(token: str, side: str, said: bytes) -> bytes:
    """What shows that a side, `fibers` or `flow`, knows the token."""
    return hmac.digest(token.encode(), side.encode() + said, "sha256")


def _expect(kind: Kind, message: Message) -> None:
    if message.kind is Kind.ERROR:
        raise ProtocolError(f"OpenFOAM stopped: {message.text()}")
    if message.kind is not kind:
        raise ProtocolError(f"received {message.kind.name} where {kind.name} must come")
