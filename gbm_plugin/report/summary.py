"""What a run found, in a few lines: the end of `gbm run` and of `gbm report`."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ..case.layout import FIBERS, results
from ..output.tables import read_dat, read_forcing
from ..statistics.series import mean

FLOW_ROWS = {  # column: name, unit
    "ReLambda": ("Re_λ", ""),
    "epsilonBudget": ("ε", "m2/s3"),
    "uPrime": ("u'", "m/s"),
}
RATIO = "R2_"  # columns of daemon.dat: <R^2>/L^2 by family


def summary(case: Path | str, cell: float | None = None) -> list[str]:
    """Averages over the second half of a run, with standard errors that know correlation in time; empty where
    nothing is there. cell: the cells' width [m], for Δx/η."""
    lines: list[str] = []
    flow = _table(read_forcing, case)
    if flow:
        lines += [_row(f"{n} [{u}]" if u else n, flow, c) for c, (n, u) in FLOW_ROWS.items() if c in flow]
        if cell and "eta" in flow:
            scaled = {"Time": flow["Time"], "cell": cell / flow["eta"]}
            lines.append(_row("Δx/η", scaled, "cell"))
    fibers = _ratios(Path(case))
    lines += [_row(f"⟨R²⟩/L² {name.removeprefix(RATIO)}", fibers, name) for name in fibers if name != "Time"]
    table = flow or fibers
    if not lines:
        return []
    start, end = _half(table["Time"]), table["Time"][-1]
    note = "; ≈ where that time is too short for one" if any("≈" in line for line in lines) else ""
    return [f"averages from t = {start:g} to {end:g} s, ± standard error{note}", *lines]


def _table(read: Callable, *where) -> dict[str, NDArray]:
    try:
        table = read(*where)
    except (FileNotFoundError, ValueError):
        return {}
    return table if len(table.get("Time", ())) > 1 else {}


def _ratios(case: Path) -> dict[str, NDArray]:
    """Time and <R^2>/L^2 of each family, averaged over the daemons that shared it."""
    folder = results(case, FIBERS)
    names = sorted({p.name for p in folder.glob("*/daemon*.dat")})
    tables = [t for t in (_table(read_dat, folder, name) for name in names) if t]
    if not tables:
        return {}
    newest = max(tables, key=lambda t: t["Time"][-1])
    same = [t for t in tables if len(t["Time"]) == len(newest["Time"])]
    found = {n: np.mean([t[n] for t in same], axis=0) for n in newest if n.startswith(RATIO)}
    return {"Time": newest["Time"], **found}


def _half(times: Sequence[float]) -> float:
    return 0.5 * (times[0] + times[-1])


def _row(name: str, table: dict[str, NDArray], column: str) -> str:
    values = table[column][table["Time"] >= _half(table["Time"])]
    values = values[np.isfinite(values)]
    if not len(values):
        return f"    {name:<24} –"
    try:
        text = str(mean(values))
    except ValueError:  # too short for an error
        text = f"≈ {values.mean():.4g}"
    return f"    {name:<24} {text}"
