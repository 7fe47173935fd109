"""The messages of the coupling protocol; docs/protocol.md has the layout, openfoam/.../message.H the C++ side."""

from __future__ import annotations

import enum
import math
import re
import struct
from dataclasses import dataclass

import numpy as np

from ..case.share import Share
from ..sampling import NEEDS, NUMBERS

MAGIC = b"GBMC"
VERSION = 4
NONCE_SIZE = 32  # a random number that shows that a connection is no repetition [bytes]
MAX_TEXT = 65536  # longest payload of all but POSITIONS, SAMPLE and FORCES [bytes]

_HEADER = struct.Struct("<4sHHIIqdQ")
HEADER_SIZE = _HEADER.size

PROVISIONAL = 1  # flag of POSITIONS: these will be corrected after their sample
STOP = 2  # flag of POSITIONS: write and stop after the next step
KEEP = 4  # flag of SAMPLE: SAVE follows, once the fields of this step are written


class Kind(enum.IntEnum):
    HELLO = 1  # flow -> fibers: the physical values of the run
    WELCOME = 2  # fibers -> flow: the families, the field wanted
    POSITIONS = 3  # fibers -> flow: bead centres
    SAMPLE = 4  # flow -> fibers: ambient flow at those positions
    SAVE = 5  # flow -> fibers: folder for the state of this step
    END = 6  # flow -> fibers: no more steps
    GOODBYE = 7  # fibers -> flow: everything is on disk
    ERROR = 8  # either way: one line, then the connection ends
    WAIT = 9  # fibers -> flow: one line, why WELCOME takes longer
    CHALLENGE = 10  # fibers -> flow: a random number, and who asks
    PROOF = 11  # flow -> fibers: who answers
    FORCES = 12  # fibers -> flow: forces and torques on the flow at that sample


FLAGS = {Kind.POSITIONS: PROVISIONAL | STOP, Kind.SAMPLE: KEEP}


class ProtocolError(Exception):
    """What arrived is not a message of this protocol, or not the one that must come now."""


@dataclass(frozen=True)
class Message:
    kind: Kind
    step: int
    time: float
    payload: bytes | memoryview = b""
    flags: int = 0

    def encode(self) -> bytes:
        return encode_header(self) + bytes(self.payload)

    def text(self) -> str:
        """The payload as one line to be printed, whatever was sent."""
        text = bytes(self.payload[:1000]).decode(errors="replace")
        return "".join(c if c.isprintable() else "?" for c in text)


def encode_header(m: Message) -> bytes:
    return _HEADER.pack(MAGIC, VERSION, m.kind, m.flags, 0, m.step, m.time, len(m.payload))


def decode_header(data: bytes, most: int = MAX_TEXT) -> tuple[Message, int]:
    """The message without its payload, and the payload's size, at most `most` [bytes].

    ProtocolError where it is none.
    """
    if len(data) != HEADER_SIZE:
        raise ProtocolError(f"short message: {len(data)} bytes where a header has {HEADER_SIZE}")
    magic, version, kind, flags, reserved, step, time, size = _HEADER.unpack(data)
    if magic != MAGIC:
        raise ProtocolError("what arrived is not a message of a gbm plugin")
    if version != VERSION:
        raise ProtocolError(
            f"the plugin speaks version {version} of the coupling protocol, this daemon {VERSION}: "
            "rebuild the plugin with ./Allwmake"
        )
    if kind not in Kind.__members__.values():
        raise ProtocolError(f"message of unknown kind {kind}")
    if flags & ~FLAGS.get(Kind(kind), 0):
        raise ProtocolError(f"{Kind(kind).name} has unknown flags: {flags}")
    if reserved:
        raise ProtocolError(f"{Kind(kind).name} has {reserved} where 0 is reserved")
    if size > max(most, MAX_TEXT):
        raise ProtocolError(f"{Kind(kind).name} announces {size} bytes where at most {most} are expected")
    if not math.isfinite(time):
        raise ProtocolError(f"{Kind(kind).name} of step {step} has the time {time}")
    return Message(Kind(kind), step, time, flags=flags), size


@dataclass(frozen=True)
class Hello:
    """The values that OpenFOAM runs with, and which of the daemons it takes this one for. SI units; folder: of the
    start time, relative to the case; nonce: a random number of the solver's."""

    viscosity: float
    time_step: float
    box_min: tuple[float, float, float]
    box_max: tuple[float, float, float]
    cells: int
    share: Share
    folder: str
    nonce: bytes

    _FIXED = struct.Struct("<9d3q")

    def encode(self) -> bytes:
        folder = self.folder.encode()
        values = (self.viscosity, self.time_step, *self.box_min, *self.box_max, float(self.cells))
        return self._FIXED.pack(*values, self.share.number, self.share.of, len(folder)) + folder + self.nonce

    @classmethod
    def decode(cls, payload: bytes) -> Hello:
        size = cls._FIXED.size
        if len(payload) < size:
            raise ProtocolError(f"HELLO has {len(payload)} bytes: at least {size} are needed")
        *values, number, of, length = cls._FIXED.unpack(payload[:size])
        if not all(map(math.isfinite, values)) or length != len(payload) - size - NONCE_SIZE:
            raise ProtocolError("HELLO holds values that are not finite, or is of the wrong length")
        folder = decode_folder(bytes(payload[size:-NONCE_SIZE]))
        if not 1 <= number <= of:
            raise ProtocolError(f"HELLO is for daemon {number} of {of}")
        low, high = tuple(values[2:5]), tuple(values[5:8])
        return cls(
            values[0],
            values[1],
            low,
            high,
            int(values[8]),
            Share(number, of),
            folder,
            bytes(payload[-NONCE_SIZE:]),
        )


def decode_folder(data: bytes | memoryview) -> str:
    """The name of a time folder, that of a processor before it or not; ProtocolError for any other place."""
    folder = bytes(data).decode(errors="replace")
    if not re.fullmatch(r"(processor\d+/)?-?\d+(\.\d+)?(e[-+]?\d+)?", folder, flags=re.ASCII):
        raise ProtocolError(f"{folder[:80]!r} is not a time folder")
    return folder


def encode_welcome(need: str, feedback: bool, families: list[tuple[int, int, int]]) -> bytes:
    """need: what to sample; feedback: whether FORCES answer a sample; families: fibers, beads of each, and number of
    the first fiber, of each family."""
    flat = [n for family in families for n in family]
    return struct.pack(f"<{3 + len(flat)}q", NEEDS.index(need), feedback, len(families), *flat)


def encode_array(values: np.ndarray) -> memoryview:
    """The bytes of an array, which is not copied where it is contiguous."""
    return memoryview(np.ascontiguousarray(values, dtype="<f8")).cast("B")


def sample_size(beads: int, need: str) -> int:
    """Bytes of a SAMPLE."""
    return 8 * beads * NUMBERS[need]


def decode_sample(m: Message, beads: int, need: str) -> tuple[np.ndarray, np.ndarray | None]:
    """Velocity (B, 3) and rotation (B, 3) or gradient (B, 3, 3), [b, i, j] = du_i/dx_j.

    ProtocolError where the length is wrong or a value is not finite.
    """
    extra = {"velocity": (), "rotation": (3,), "gradient": (3, 3)}[need]
    size = sample_size(beads, need)
    if len(m.payload) != size:
        raise ProtocolError(
            f"SAMPLE of step {m.step} has {len(m.payload)} bytes: {beads} beads with {need} need {size}"
        )
    values = np.frombuffer(m.payload, dtype="<f8")
    if not np.all(np.isfinite(values)):
        raise ProtocolError(f"SAMPLE of step {m.step} holds values that are not finite")
    velocity = values[: 3 * beads].reshape(beads, 3)
    return velocity, (values[3 * beads :].reshape(beads, *extra) if extra else None)
