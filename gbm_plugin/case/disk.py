"""How much a run writes, before it does, and whether the disk has the room."""

from __future__ import annotations

import logging
import math
import shutil

from .dictionary import Dictionary
from .layout import SPECTRAL
from .log import MOST
from .scene import Scene

log = logging.getLogger(__name__)

# numbers for each cell that OpenFOAM writes: U; U, p, phi; U_0, phi_0 of schemes that remember; fiberForce
VELOCITY, NEWEST, OLDER, FORCE = 3, 7, 6, 3
REMEMBER = ("backward", "CrankNicolson", "localEuler")
MODES = 9  # numbers for each cell in uniform/boxFoam, in binary: of the velocity and of two earlier rates
# bytes for each cell of a spectral run: U in binary; the modes that are kept, of it and of three slopes
SPECTRAL_CELL = 24 + 4 * 48 * 4 / 27
BINARY, SIGNS = 8, 6  # bytes of a number in binary; sign, point, exponent and a space beside its digits
STATE, CLOUD, RECORD = 290, 110, 24  # bytes for each bead: fibers.npz, the cloud beside the fields, a record
TABLES = 600  # bytes of a step in all tables of postProcessing
LOG = 2000  # and in the log of the solver


def writes(scene: Scene, start: float | None = None) -> int:
    """Time folders that a run from `start` (default: startTime) writes; 1 where OpenFOAM decides by other clocks."""
    span = max(0.0, scene.end_time - (scene.start_time if start is None else start))
    return math.floor(span / scene.write_interval + 1e-6) if math.isfinite(scene.write_interval) else 1


def needed(scene: Scene, start: float | None = None) -> dict[str, int]:
    """Bytes that a run from `start` (default: startTime) writes, about: in time folders, in the recording, in all;
    and for one more time folder. Of cases whose cells are not known, without fields."""
    control = Dictionary.read(scene.case, "system/controlDict")
    span = max(0.0, scene.end_time - (scene.start_time if start is None else start))
    steps = span / scene.time_step
    beads = sum(f.count * f.beads for f in scene.families)
    count = writes(scene, start)
    keep = kept_folders(control)
    folder = _cell_bytes(scene, control) * math.prod(scene.cells or (0,)) + (STATE + CLOUD) * beads
    folders = folder * (min(count, keep) if keep else count)
    recording = (RECORD + 8 * len(scene.record)) * beads * math.ceil(steps / scene.record_interval)
    tables = TABLES * steps + min(MOST, LOG * steps)
    parts = {
        "time_folder": folder,
        "time_folders": folders,
        "recording": recording,
        "total": folders + recording + tables,
    }
    return {name: int(size) for name, size in parts.items()}


def kept_folders(control: Dictionary) -> int:
    """Time folders of a run that are left, the newest; 0: all. controlDict, purgeWrite."""
    return control.integer("purgeWrite", 0, least=0)


def _cell_bytes(scene: Scene, control: Dictionary) -> float:
    if scene.application == SPECTRAL:
        return SPECTRAL_CELL
    own = scene.application == "boxFoam"
    numbers = VELOCITY if own and not control.switch("writePressure", True) else NEWEST
    if not own and (scene.case / "system/fvSchemes").is_file():
        schemes = Dictionary.read(scene.case, "system/fvSchemes")
        ddt = str(schemes.sub("ddtSchemes", {}).raw("default", ""))
        numbers += OLDER if any(name in ddt for name in REMEMBER) else 0
    numbers += FORCE if scene.coupling.feedback else 0
    ascii = control.word("writeFormat", default="ascii") == "ascii"
    size = control.integer("writePrecision", 6) + SIGNS if ascii else BINARY
    packed = control.word("writeCompression", default="off") in ("on", "yes", "true", "compressed")
    return numbers * size * (0.5 if packed else 1.0) + (MODES * BINARY if own else 0)


class Room:
    """Looks after the room that is left: a word in the log when a run will not find enough, once, and once more when
    it is all but gone."""

    def __init__(self, scene: Scene):
        self._scene = scene
        self._said = 0

    def look(self, time: float) -> None:
        """Compare what is free to what the run from this time on needs."""
        free = shutil.disk_usage(self._scene.case).free
        need = needed(self._scene, time)
        level = 2 if free < 2 * need["time_folder"] else 1 if free < need["total"] else 0
        if level > self._said:
            self._said = level
            log.warning(
                "the disk of %s has %s left, and the rest of the run writes about %s, %s in each time folder: "
                "make room, or raise writeInterval or recordInterval",
                self._scene.case, readable(free), readable(need["total"]), readable(need["time_folder"]),
            )  # fmt: skip


def readable(size: float) -> str:
    """A number of bytes, as 1.5 GB."""
    for unit in ("B", "kB", "MB", "GB"):
        if size < 1000:
            return f"{size:.3g} {unit}"
        size /= 1000
    return f"{size:.3g} TB"
