"""Time folders of a case: where a run continues, and what an earlier one left is set aside, never deleted."""

from __future__ import annotations

import logging
import shutil
from dataclasses import dataclass
from pathlib import Path

from ..errors import CaseError
from .dictionary import Dictionary
from .layout import FIBERS, PREVIOUS, RESULTS, is_complete, numbered, processors, results, time_folders

log = logging.getLogger(__name__)

WHY = " (fields or fiber state are missing: killed while writing, or a full disk)"


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
    return any(results(case, FIBERS).glob("*/fibers*.h5"))


def set_aside(case: Path, after: float, everything: bool) -> None:
    """Move what a start at time `after` would overwrite to `previous/<n>`: later time folders, function
    objects' output that starts there or later, logs; with `everything` also the start time's own folder and
    the report. Nothing is moved where nothing is there."""
    things = list(case.glob("log.*"))
    if everything:
        things += [case / "report", *processors(case)]
        if (case / "0.orig").is_dir():
            things.append(case / "0")
    folders = [case, *processors(case)] if not everything else [case]
    for folder in folders:
        things += [p for time, p in numbered(folder).items() if time > after and p not in things]
    for part in (case / RESULTS).glob("*"):
        things += [p for time, p in numbered(part).items() if time >= after - 1e-9 * abs(after)]
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
