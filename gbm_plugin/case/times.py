"""Time folders of a case: where a run continues, and what an earlier one left is set aside, never deleted."""

from __future__ import annotations

import logging
import math
import shutil
from dataclasses import dataclass
from pathlib import Path

from PyFoam.RunDictionary.SolutionDirectory import SolutionDirectory

from .dictionary import CaseError, Dictionary
from .share import shared_files

log = logging.getLogger(__name__)

WHY = " (fields or fiber state are missing: killed while writing, or a full disk)"
STATE_FILE = "uniform/fibers.npz"  # of a single daemon; of several: fibers.<number>of<daemons>.npz
PREVIOUS = "previous"


def time_folders(case: Path) -> dict[float, str]:
    """Times with a folder in the case, or in its processor folders, and the folders' names."""
    names = list(SolutionDirectory(str(case), archive=None, paraviewLink=False).getTimes())
    if (case / "processor0").is_dir():
        names += [p.name for p in (case / "processor0").iterdir() if p.is_dir()]
    return {time: name for name in names if (time := as_time(name)) is not None}


def fiber_state(folder: Path) -> list[Path]:
    """The files of a time folder that hold the state of all fibers, one of each daemon; empty where one is missing."""
    path = folder / STATE_FILE
    return shared_files(path.parent, path.stem, path.suffix)


def is_complete(case: Path, name: str) -> bool:
    """Whether a time folder holds whole fields and a fiber state, together or decomposed."""
    for folders in ([case / name], [p / name for p in case.glob("processor[0-9]*")]):
        velocity = folders and all(any((f / u).is_file() for u in ("U", "U.gz")) for f in folders)
        state = any(fiber_state(f) for f in folders)
        if velocity and state and all(is_whole(file) for f in folders for file in f.iterdir()):
            return True
    return False


def is_whole(file: Path) -> bool:
    """False for an OpenFOAM file whose last line is missing: OpenFOAM does not notice that a disk is full."""
    if not file.is_file():
        return True
    with file.open("rb") as content:
        if b"FoamFile" not in content.read(2048):
            return True
        content.seek(-min(128, file.stat().st_size), 2)
        return b"// ****" in content.read()


@dataclass(frozen=True)
class Start:
    """Where a run starts: at `time`, continuing an earlier run or not."""

    time: float
    continues: bool


def choose_start(case: Path, start_time: float, end_time: float, time_step: float, fresh: bool) -> Start:
    """Continue an unfinished run from its latest complete time; otherwise start from the beginning.

    What a new start would overwrite is moved to `previous/<n>` in the case. A flow without fibers yet is
    continued with new fibers. Only where controlDict says `startFrom latestTime`; else controlDict decides.
    """
    control = Dictionary.read(case, "system/controlDict")
    if control.word("startFrom", default="latestTime") != "latestTime":
        return Start(start_time, False)
    times = time_folders(case)
    later = [t for t in times if t > start_time]
    complete = [t for t in later if is_complete(case, times[t])]
    if not later or fresh:
        set_aside(case, start_time, everything=True)
        return Start(start_time, False)
    if not complete:
        if _has_fibers(case):
            set_aside(case, start_time, everything=True)
            log.info("no time folder is complete%s: starting again from time %g", WHY, start_time)
            return Start(start_time, False)
        return Start(max(later), True)  # a developed flow, to which fibers are added
    latest = max(complete)
    if latest > end_time - 0.5 * time_step:
        log.info("the run to time %g is complete: starting a new one", latest)
        set_aside(case, start_time, everything=True)
        return Start(start_time, False)
    incomplete = sorted(t for t in later if t > latest)
    if incomplete:
        names = ", ".join(f"{t:g}" for t in incomplete)
        log.info("time %s is not complete%s: falling back to time %g", names, WHY, latest)
    else:
        log.info("continuing from time %g", latest)
    set_aside(case, latest, everything=False)
    return Start(latest, True)


def _has_fibers(case: Path) -> bool:
    return any(case.glob("postProcessing/fibers/*/fibers*.h5"))


def set_aside(case: Path, after: float, everything: bool) -> None:
    """Move what a start at time `after` would overwrite to `previous/<n>`: later time folders, function
    objects' output that starts there or later, logs; with `everything` also the start time's own folder and
    the report. Nothing is moved where nothing is there."""
    things = list(case.glob("log.*"))
    if everything:
        things += [case / "report", *case.glob("processor[0-9]*")]
        if (case / "0.orig").is_dir():
            things.append(case / "0")
    folders = [case, *case.glob("processor[0-9]*")] if not everything else [case]
    for folder in folders:
        things += [p for p in _numbered(folder) if float(p.name) > after and p not in things]
    for part in case.glob("postProcessing/*"):
        things += [p for p in _numbered(part) if float(p.name) >= after - 1e-9 * abs(after)]
    things = [p for p in things if p.exists()]
    results = [p for p in things if p != case / "0" and not p.name.startswith("log.")]
    if results:
        move_aside(case, things)


def move_aside(case: Path, things: list[Path]) -> None:
    """Move files and folders of the case to a new `previous/<n>`, where they keep their places."""
    number = 1
    while (target := case / PREVIOUS / str(number)).exists():
        number += 1
    for thing in things:
        place = target / thing.relative_to(case)
        place.parent.mkdir(parents=True, exist_ok=True)
        try:
            shutil.move(thing, place)
        except OSError as error:
            raise CaseError(f"cannot move {thing} to {place}: {error.strerror}") from None
    log.info("earlier results are in %s", target)


def _numbered(folder: Path) -> list[Path]:
    """Folders whose name is a time."""
    children = folder.iterdir() if folder.is_dir() else ()
    return [p for p in children if p.is_dir() and as_time(p.name) is not None]


def as_time(name: str) -> float | None:
    """The time that a folder's name says; None for other names."""
    try:
        time = float(name)
    except ValueError:
        return None
    return time if math.isfinite(time) else None
