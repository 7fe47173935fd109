"""Time folders of a case: where a run continues, and what an earlier one left is set aside, never deleted."""

from __future__ import annotations

import logging
import shutil
from dataclasses import dataclass
from pathlib import Path

from ..errors import CaseError
from . import made
from .initial import is_made_here
from .layout import (
    FIBERS,
    PREVIOUS,
    RESULTS,
    flow_table,
    is_complete,
    numbered,
    processors,
    results,
    time_folders,
    velocity_file,
)

log = logging.getLogger(__name__)

ZERO = "0"
WHY = " (fields or fiber state are missing: killed while writing, or a full disk)"


@dataclass(frozen=True)
class Start:
    """Where a run starts: at `time`, continuing an earlier run or not; or that it is complete at `time`."""

    time: float
    continues: bool
    complete: bool = False


def choose_start(
    case: Path,
    start_time: float,
    end_time: float,
    time_step: float,
    fresh: bool,
    start_from: str = "latestTime",
    makes_beginning: bool = False,
) -> Start:
    """Continue an unfinished run from its latest complete time; otherwise start from the beginning.

    What a new start would overwrite is moved to `previous/<n>` in the case. A flow without fibers yet is continued
    with new fibers; it is then the beginning of their run, which nothing moves away. start_from: controlDict's word,
    where OpenFOAM begins whatever is there; makes_beginning: of an engine that needs no fields to begin with.
    CaseError where OpenFOAM does not begin where an unfinished run continues.
    """
    times = time_folders(case)
    _refuse_foreign(case, times, start_time)
    begin = start_time if makes_beginning else _beginning(case, times, start_time, time_step, start_from)
    later = [t for t in times if t > begin and not is_same_time(t, begin, time_step)]
    if fresh or not later:
        return _anew(case, times, begin, time_step, makes_beginning)
    complete = [t for t in later if is_complete(case, times[t])]
    if complete and max(complete) > end_time - 0.5 * time_step:
        return Start(max(complete), True, complete=True)
    if start_from != "latestTime":
        raise CaseError(
            f"{case}/system/controlDict: with startFrom {start_from} OpenFOAM would begin again at time {begin:g} and "
            f"overwrite the results up to {max(later):g}: say startFrom latestTime to continue, or --fresh to begin "
            f"again, with these in {PREVIOUS}/<n>"
        )
    if not complete:
        if _has_fibers(case):
            log.info("no time folder is complete%s: starting again from time %g", WHY, begin)
            return _anew(case, times, begin, time_step, makes_beginning)
        return Start(max(later), True)  # a developed flow, to which fibers are added
    latest = max(complete)
    incomplete = sorted(t for t in later if t > latest)
    if incomplete:
        names = ", ".join(f"{t:g}" for t in incomplete)
        log.info("time %s is not complete%s: falling back to time %g", names, WHY, latest)
    else:
        log.info("continuing from time %g", latest)
    set_aside(case, latest, everything=False)
    return Start(latest, True)


def is_same_time(a: float, b: float, time_step: float) -> bool:
    return abs(a - b) < 1e-3 * time_step


def _beginning(
    case: Path, times: dict[float, str], start_time: float, time_step: float, start_from: str
) -> float:
    """Where the run of the fibers began, or will."""
    if start_from == "startTime":
        return start_time
    makes_zero = start_time == 0 and velocity_file(case / "0.orig") is not None
    there = sorted(t for t in times if _has_velocity(case, times[t]))
    if start_from == "firstTime":
        return 0.0 if makes_zero or not times else min(times)
    # fibers that were put into a flow that was there: what is before them is not theirs
    recorded = [t for t in numbered(results(case, FIBERS)) if t > start_time]
    began = [t for t in there if recorded and is_same_time(t, min(recorded), time_step)]
    if began and not any(is_same_time(t, start_time, time_step) for t in numbered(results(case, FIBERS))):
        return began[0]
    earlier = [t for t in there if t < start_time]
    if earlier and not makes_zero and not any(t >= start_time - 1e-3 * time_step for t in there):
        return max(earlier)  # where latestTime has OpenFOAM begin
    return start_time


def _anew(
    case: Path, times: dict[float, str], begin: float, time_step: float, makes_beginning: bool
) -> Start:
    """From the beginning, which must be there or be made of 0.orig."""
    own = [t for t in times if is_same_time(t, begin, time_step)]
    if not own and not makes_beginning and not (begin == 0 and velocity_file(case / "0.orig")):
        what = (
            "neither a folder 0 nor 0.orig with a U"
            if begin == 0
            else f"no time folder {begin:g} to begin with"
        )
        raise CaseError(f"{case} has {what}: initial fields are missing")
    set_aside(case, begin, everything=True)
    return Start(own[0] if own else begin, False)


def _has_velocity(case: Path, name: str) -> bool:
    return any(velocity_file(folder / name) for folder in (case, *processors(case)[:1]))


def _has_fibers(case: Path) -> bool:
    return any(results(case, FIBERS).glob("*/fibers*.h5"))


def _refuse_foreign(case: Path, times: dict[float, str], start_time: float) -> None:
    """CaseError for a folder of the user's that OpenFOAM would take for a time, and fail at."""
    for time, name in times.items():
        folder = case / name
        if time <= start_time or not folder.is_dir():
            continue
        things = list(folder.iterdir())
        known = [p for p in things if p.name in ("uniform", "lagrangian", "polyMesh") or _is_openfoams(p)]
        if things and not known:
            raise CaseError(
                f"{folder} has the name of a time, where OpenFOAM would look for fields: rename it"
            )


def _is_openfoams(path: Path) -> bool:
    if not path.is_file():
        return False
    if path.suffix == ".gz" or path.stat().st_size == 0:
        return True
    with path.open("rb") as file:
        return b"FoamFile" in file.read(2048)


def replaceable_zero(case: Path) -> bool:
    """Whether gbm can make the folder 0 again: it made this one, or it is a plain copy of 0.orig."""
    zero, template = case / ZERO, case / "0.orig"
    if not velocity_file(template) or zero.is_symlink():
        return False
    if made.is_own(case, ZERO) or (not made.is_recorded(case, ZERO) and is_made_here(zero / "U")):
        return True
    files = [p for p in zero.rglob("*") if p.is_file()]
    copies = ((p, template / p.relative_to(zero)) for p in files)
    return all(original.is_file() and p.read_bytes() == original.read_bytes() for p, original in copies)


def set_aside(case: Path, after: float, everything: bool) -> None:
    """Move what a start at time `after` would overwrite to `previous/<n>`: later time folders, function
    objects' output that starts there or later, logs; with `everything` also the start time's own folder, where it can
    be made again, and the report. Nothing is moved where nothing is there.

    What a function object of the user wrote at the time of a restart is not written again, and stays.
    """
    slack = 1e-9 * abs(after)
    things = list(case.glob("log.*"))
    parts = processors(case)
    if everything:
        things.append(case / "report")
        if after == 0 and replaceable_zero(case):
            things.append(case / ZERO)
        if parts and any(t <= after + slack and velocity_file(p) for t, p in numbered(case).items()):
            things += parts  # the start is in the case itself
            parts = []
    for folder in (case, *parts):
        things += [p for time, p in numbered(folder).items() if time > after + slack]
    for part in (case / RESULTS).glob("*"):
        for time, folder in numbered(part).items():
            begun = (
                part.name == FIBERS or (folder / flow_table(part.name)).exists()
            )  # then, and not written then
            if time > after + slack or (time >= after - slack and (everything or begun)):
                things.append(folder)
    things = [p for p in things if p.exists()]
    results = [p for p in things if p != case / ZERO and not p.name.startswith("log.")]
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
