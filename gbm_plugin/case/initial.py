"""The initial velocity of a case: `system/initialFieldDict` read, evaluated, and written as <time>/U."""

from __future__ import annotations

import logging
import re
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from ..errors import CaseError
from ..files import replaced
from .dictionary import Dictionary
from .earlier import read_earlier
from .fields import FourierModes, abc, peaked_spectrum, random_modes, taylor_green_vortex

log = logging.getLogger(__name__)

END = f"// {73 * '*'} //"  # the last line of what OpenFOAM writes: the file is whole
NOTE = "made from system/initialFieldDict"
KINDS = ("random", "modes", "taylorGreenVortex", "ABC", "run")


@dataclass(frozen=True)
class InitialField:
    """The velocity that a case begins with, and the state of its force where that is an earlier run's."""

    modes: FourierModes
    force: dict[str, np.ndarray] = field(default_factory=dict)


def read_initial_field(case: Path) -> InitialField:
    """What `system/initialFieldDict` describes. CaseError where an entry is wrong."""
    d = Dictionary.read(case, "system/initialFieldDict")
    kind = d.word("field", KINDS)
    try:
        if kind == "run":
            earlier = read_earlier(case, d)
            initial = InitialField(earlier.modes, earlier.force)
            log.info("the flow begins as that of %s", earlier.path.parents[1].resolve())
        elif kind == "random":
            initial = InitialField(_random(d))
        elif kind == "taylorGreenVortex":
            initial = InitialField(taylor_green_vortex(d.number("velocity", 1.0)))
        elif kind == "ABC":
            initial = InitialField(abc(d.number("A", 1.0), d.number("B", 1.0), d.number("C", 1.0)))
        else:
            initial = InitialField(_modes(d))
    except CaseError:
        raise
    except ValueError as error:
        raise CaseError(f"{d.where}: {error}") from None
    d.done()
    return initial


def _random(d: Dictionary) -> FourierModes:
    shape = d.word("spectrum", ("peaked", "table"), "peaked")
    seed = d.integer("seed", 1, least=0)
    if shape == "table":
        table = d.raw("table")
        try:
            spectrum = {int(k): float(e) for k, e in table}
        except (TypeError, ValueError):
            raise d.fail("table", "must be a list of (shell energy), as ((1 0.1) (2 0.2))") from None
        return random_modes(spectrum, seed)
    energy = d.number("kineticEnergy", above=0)
    peak = d.number("peakWavenumber", 3.0, above=0)
    highest = d.integer("maxWavenumber", 8, least=1)
    return random_modes(peaked_spectrum(energy, peak, highest), seed)


def _modes(d: Dictionary) -> FourierModes:
    """A list of ((mx my mz) (real part of a) (imaginary part of a))."""
    try:
        rows = np.array([[list(v) for v in row] for row in d.raw("modes")], dtype=float)
        m, real, imaginary = rows[:, 0], rows[:, 1], rows[:, 2]
    except (TypeError, ValueError, IndexError):
        raise d.fail(
            "modes", "must be a list of ((mx my mz) (ax ay az) (bx by bz)), amplitude a + i b"
        ) from None
    if np.any(m != np.rint(m)):
        raise d.fail("modes", "has a wavevector that is not whole numbers of waves per box")
    a = real + 1j * imaginary
    if np.any(np.abs((a * m).sum(axis=1)) > 1e-12 * np.abs(a).max()):
        raise d.fail("modes", "has an amplitude that is not perpendicular to its wavevector")
    return FourierModes(m.astype(int), a)


def write_velocity(template: Path, target: Path, velocity: np.ndarray) -> None:
    """Write a cell-centred velocity (3, nx, ny, nz) [m/s] as an OpenFOAM field, cells with x fastest
    (blockMesh's order), in binary; boundary conditions and dimensions are those of `template`."""
    if not np.all(np.isfinite(velocity)):
        raise CaseError("the initial velocity is not finite")
    head, tail = _around_internal_field(template.read_bytes(), template)
    cells = velocity.transpose(3, 2, 1, 0).reshape(-1, 3)
    head = _binary_header(head)
    target.parent.mkdir(parents=True, exist_ok=True)
    with replaced(target, "wb") as file:
        file.write(f"{head}internalField   nonuniform List<vector> \n{len(cells)}\n(".encode())
        file.write(np.ascontiguousarray(cells, dtype="<f8").tobytes())
        file.write(f")\n;{tail.rstrip()}\n\n{END}\n".encode())


def is_made_here(path: Path) -> bool:
    """Whether a velocity file was written by write_velocity, and by nothing else since."""
    if not path.is_file():
        return False
    with path.open("rb") as file:
        return NOTE.encode() in file.read(1000)


def _around_internal_field(content: bytes, path: Path) -> tuple[str, str]:
    """What stands before and behind the values of a field, in ascii or binary."""
    binary = re.search(
        rb"^internalField\s+nonuniform\s+List<vector>\s+(\d+)\s*\(", content, flags=re.MULTILINE
    )
    if binary is not None and re.search(rb"\bformat\s+binary;", content[: binary.start()]):
        rest = content[binary.end() + 24 * int(binary[1]) :]  # three doubles a cell
        behind = re.match(rb"\)\s*;", rest)
        if behind is None:
            raise CaseError(f"{path}: the values of 'internalField' are not {binary[1].decode()} vectors")
        return content[: binary.start()].decode(), rest[behind.end() :].decode()
    match = re.search(rb"^internalField[^;]*;", content, flags=re.MULTILINE)
    if match is None:
        raise CaseError(f"{path}: the entry 'internalField' is missing")
    return content[: match.start()].decode(), content[match.end() :].decode()


def _binary_header(head: str) -> str:
    head = re.sub(r'\n\s*(arch|note)\s+"[^"]*";', "", head)
    entries = f'\n    arch        "LSB;label=32;scalar=64";\n    note        "{NOTE}";'
    return re.sub(r"(\bformat\s+)\w+;", rf"\1binary;{entries}", head, count=1)
