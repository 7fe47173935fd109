"""Reading the tables that OpenFOAM's function objects and options write."""

from __future__ import annotations

import itertools
import re
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ..case.layout import flow_table, results
from .restarts import files_by_start, kept

_ENTRY = re.compile(r"\(([^()]*)\)|([^\s()]+)")


def read_dat(folder: Path | str, name: str) -> dict[str, NDArray[np.float64]]:
    """Read ``<folder>/<start>/<name>`` of all starts as one table; later starts override repeated times.

    folder: for example ``postProcessing/linearForcing``. Returns the columns by the names of the header line
    (``# Time a b``): (S,) for numbers, (S, n) for entries in parentheses; "Time" is the first. An unfinished
    last line is left out. A part without some columns of the others, of a run whose feedback was switched on or off
    at a restart, has NaN there. Raises FileNotFoundError if there is no such file, ValueError for a file without
    a header, a line that does not fit it, or two parts with columns that the other has not.
    """
    files = files_by_start(folder, name)
    if not files:
        raise FileNotFoundError(f"no {name} in {folder}/<start time>/")
    tables = [_read_one(file) for file in files]
    fullest = max(tables, key=len)
    for file, table in zip(files, tables, strict=True):
        if not table.keys() <= fullest.keys():
            raise ValueError(f"{file} has columns {', '.join(table)}; another part has {', '.join(fullest)}")
    tables = [table for table in tables if len(table["Time"])] or tables[-1:]
    counts = kept([table["Time"] for table in tables])
    parts = list(zip(tables, counts, strict=True))
    return {
        column: np.concatenate([_column(table, column, values)[:count] for table, count in parts])
        for column, values in fullest.items()
    }


def _column(table: dict[str, NDArray], name: str, like: NDArray) -> NDArray:
    """A column of a table, NaN where it has none."""
    if name in table:
        return table[name]
    return np.full((len(table["Time"]), *like.shape[1:]), np.nan)


def read_forcing(case: Path | str) -> dict[str, NDArray[np.float64]]:
    """The table of energies that the forcing of a run writes, postProcessing/<name>/<start>/<name>.dat, whatever its
    name; of several forcings that of the newest. Raises as `read_dat`."""
    folder = results(case, "")
    found = [path for path in folder.glob("*/*/*.dat") if path.name == flow_table(path.parents[1].name)]
    found = [path for path in found if _has_column(path, "epsilonBudget")]
    if not found:
        raise FileNotFoundError(f"no table of a forcing, <forcing>/<start time>/<forcing>.dat, in {folder}")
    newest = max(found, key=lambda path: path.stat().st_mtime)
    return read_dat(newest.parents[1], newest.name)


def _has_column(file: Path, name: str) -> bool:
    with file.open(errors="replace") as lines:
        header = itertools.takewhile(lambda line: line.startswith("#"), lines)
        return any(name in line.split() for line in header)


def _read_one(file: Path) -> dict[str, NDArray[np.float64]]:
    header, rows = None, []
    lines = file.read_text().splitlines(keepends=True)
    for number, line in enumerate(lines, start=1):
        if line.startswith("#"):
            names = line[1:].split()
            header = names if names[:1] == ["Time"] else header
        elif line.strip() and header is not None:
            entries = [vector.split() if word == "" else word for vector, word in _ENTRY.findall(line)]
            unfinished = number == len(lines) and not line.endswith("\n")
            if len(entries) == len(header) and not unfinished:
                rows.append(entries)
            elif not unfinished:
                raise ValueError(f"{file}, line {number}: {len(entries)} entries for {len(header)} columns")
    if header is None:
        raise ValueError(f"{file} has no header line '# Time ...'")
    try:
        columns = [np.array([row[i] for row in rows], dtype=float) for i in range(len(header))]
    except ValueError as error:
        raise ValueError(f"{file} is not a table of numbers: {error}") from None
    return dict(zip(header, columns, strict=True))
