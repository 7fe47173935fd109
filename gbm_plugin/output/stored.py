"""The time folders of an OpenFOAM run as a flow that can be sampled at any time between them."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np

from ..case.layout import is_whole, processors, time_folders, velocity_file
from ..errors import CaseError
from ..flow.stored import LOCATIONS, StoredFlow
from .field import read_velocity


def case_flow(
    case: Path | str,
    cells: tuple[int, int, int],
    box,
    origin,
    interpolation: str = "trilinear",
    in_time: str = "cubic",
    every: int = 1,
) -> StoredFlow:
    """U of the time folders of a case, serial or decomposed, on a box of equal cells with x fastest.

    box, origin (3,) [m]. every: take only every so many of them. Other words as in StoredFlow. CaseError where
    a time folder has no whole U; reading raises ValueError for a field of another number of cells.
    """
    case = Path(case)
    folders = time_folders(case)
    names = [folders[time] for time in sorted(folders)]
    for name in names:
        _refuse_incomplete(case, name)
    names = names[::every]
    if len(names) < 2:
        stored = " ".join(names) or "none"
        raise CaseError(f"{case} has fields at fewer than 2 times ({stored}): run it with a writeInterval")
    return StoredFlow(
        [_time(case, name) for name in names],
        lambda number: read_velocity(case, names[number], cells),
        box,
        origin,
        LOCATIONS["centres"],
        interpolation,
        in_time,
    )


def _refuse_incomplete(case: Path, name: str) -> None:
    """CaseError where the U of a time is missing, or the end of it."""
    folders = [case / name] if velocity_file(case / name) else [p / name for p in processors(case)]
    files = [velocity_file(folder) for folder in folders or [case / name]]
    if None in files:
        raise CaseError(f"time {name} has no U in {(folders or [case / name])[files.index(None)]}: {_REMEDY}")
    for file in files:
        if file.suffix != ".gz" and not is_whole(file):
            raise CaseError(f"{file} is cut off (killed while writing, or a full disk): {_REMEDY}")


_REMEDY = "remove this time folder, or write it again"


def _time(case: Path, name: str) -> float:
    """The time of a folder, of whose digits the name may have too few."""
    for folder in (case, *processors(case)[:1]):
        file = folder / name / "uniform/time"
        if file.is_file():
            value = re.search(r"^value\s+(\S+);", file.read_text(errors="replace"), flags=re.MULTILINE)
            if value and np.isclose(float(value[1]), float(name), rtol=1e-4, atol=0):
                return float(value[1])
    return float(name)
