"""Where things are in a case: names of files and folders, written down once."""

from __future__ import annotations

import math
import re
from pathlib import Path

from .share import WHOLE, Share, shared_files

STATE_FILE = "uniform/fibers.npz"  # of a single daemon; of several: fibers.<number>of<daemons>.npz
FLOW_FILE = "uniform/flow.npz"  # the spectral solver's own, in a time folder of SPECTRAL
SPECTRAL = "spectral"  # the solver in place of `application`, and the folder of its results in a case
PREVIOUS = "previous"
RESULTS = "postProcessing"
FIBERS = "fibers"  # a folder there
COUPLING_TABLE = "coupling.dat"
VELOCITY = ("U", "U.gz")


def results(case: Path | str, kind: str = FIBERS) -> Path:
    """The folder of what one function object or source writes, a folder in it for each start time."""
    return Path(case) / RESULTS / kind


def flow_table(forcing: str) -> str:
    """The file of a forcing's row a step, in the results of that name."""
    return f"{forcing}.dat"


def recording_name(share: Share = WHOLE) -> str:
    """The file of a daemon's recording."""
    return share.name("fibers", ".h5")


def daemon_table(share: Share = WHOLE) -> str:
    """The file of a daemon's row a step."""
    return share.name("daemon", ".dat")


def warnings_file(share: Share = WHOLE) -> str:
    """The file of what a daemon warns of."""
    return share.name("warnings", ".txt")


def cause_file(case: Path, share: Share = WHOLE) -> Path:
    """Where a daemon that failed leaves why, in one line."""
    return case / share.name(".gbm.daemon", ".cause")


def log_file(case: Path, program: str) -> Path:
    """What a program says when it works on the case."""
    return case / f"log.{program}"


def processors(case: Path) -> list[Path]:
    """The folders of a decomposed case, in the order of the ranks; empty for a serial one."""
    return sorted(case.glob("processor[0-9]*"), key=lambda p: (len(p.name), p.name))


def as_time(name: str) -> float | None:
    """The time that a folder's name says; None for other names."""
    if not re.fullmatch(r"[-+]?(\d+\.?\d*|\.\d+)([eE][-+]?\d+)?", name, flags=re.ASCII):
        return None
    time = float(name)
    return time if math.isfinite(time) else None


def numbered(folder: Path) -> dict[float, Path]:
    """The folders in this one whose name is a time, by increasing time."""
    children = folder.iterdir() if folder.is_dir() else ()
    found = {t: p for p in children if (t := as_time(p.name)) is not None and p.is_dir()}
    return dict(sorted(found.items()))


def time_folders(case: Path) -> dict[float, str]:
    """Times with a folder in the case, or in its processor folders, and the folders' names."""
    folders = numbered(case) | numbered(case / "processor0")
    return {time: folder.name for time, folder in folders.items()}


def velocity_file(folder: Path) -> Path | None:
    """U of a time folder, compressed or not; None where it is not there."""
    return next((folder / name for name in VELOCITY if (folder / name).is_file()), None)


def is_whole(file: Path) -> bool:
    """False for an OpenFOAM file whose last line is missing: OpenFOAM does not notice that a disk is full."""
    if not file.is_file():
        return True
    with file.open("rb") as content:
        if b"FoamFile" not in content.read(2048):
            return True
        content.seek(-min(128, file.stat().st_size), 2)
        return b"// ****" in content.read()


def fiber_state(folder: Path) -> list[Path]:
    """The files of a time folder that hold the state of all fibers, one of each daemon; empty where one is missing."""
    path = folder / STATE_FILE
    return shared_files(path.parent, path.stem, path.suffix)


def is_complete(case: Path, name: str) -> bool:
    """Whether a time folder holds whole fields and a fiber state, together or decomposed."""
    for folders in ([case / name], [p / name for p in processors(case)]):
        velocity = folders and all(velocity_file(f) for f in folders)
        state = any(fiber_state(f) for f in folders)
        if velocity and state and all(is_whole(file) for f in folders for file in f.iterdir()):
            return True
    return False


def states(case: Path) -> dict[float, Path]:
    """Time folders of the case, serial or decomposed, that hold a complete fiber state."""
    folders = {**numbered(case / "processor0"), **numbered(case)}
    return {time: folder for time, folder in folders.items() if fiber_state(folder)}


def find_state(case: Path, folder: str) -> Path | None:
    """Where the state of this time folder is: there, or in the other of the serial and decomposed ones."""
    name = Path(folder).name
    for candidate in (case / folder, case / name, case / "processor0" / name):
        if fiber_state(candidate):
            return candidate
    return None
