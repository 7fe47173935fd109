"""A restarted run writes into one folder per start time; together they are one series."""

from __future__ import annotations

import os
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ..case.layout import numbered

# A restart writes its start time again, in as many digits as OpenFOAM's time names have: records closer than
# this fraction of the interval between records are the same one.
_SAME_TIME = 1e-3


def keep_earlier(path: Path) -> Path:
    """Give a file that is already there a number (``name.1``, ...), so that its name is free; returns path."""
    number = 1
    while os.path.lexists(kept := path.with_name(f"{path.name}.{number}")):
        number += 1
    if os.path.lexists(path):
        path.rename(kept)
    return path


def files_by_start(folder: Path | str, name: str) -> list[Path]:
    """The files ``<folder>/<start time>/<name>``, by increasing start time."""
    files = (start / name for start in numbered(Path(folder)).values())
    return [file for file in files if file.is_file()]


def kept(parts: Sequence[NDArray]) -> list[int]:
    """How many of the first records of each part count, where later parts override what they repeat.

    parts: the times of each part, in the order of their starts.
    """
    counts, limit = [], np.inf
    for times in reversed(parts):
        tolerance = _SAME_TIME * np.diff(times).min() if len(times) > 1 else 0.0
        counts.append(int(np.searchsorted(times, limit - tolerance)))
        limit = min(limit, times[0]) if len(times) else limit
    return counts[::-1]
