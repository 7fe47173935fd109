"""`gbm validate --study convergence`: one case in both engines at several resolutions.

How fast OpenFOAM and its fibers converge to the spectral solver, which resolves the same initial modes exactly.
"""

from __future__ import annotations

import itertools
import tempfile
import time
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure

from ..output.figures import convergence_figure
from . import comparison
from .comparison import END_TIME, VISCOSITY


def run(
    case: Path | str, cells: Sequence[int] = (24, 32, 48, 64), time_step: float = 0.08, seed: int = 1
) -> dict:
    """Errors of OpenFOAM against the spectral solver at the same time.

    case: whose schemes and solver settings are judged. time_step: that of the coarsest mesh [s]; finer ones
    take it in proportion to their cells. Velocity: rms difference at the cell centres over the rms velocity.
    Fibers: rms difference of the end beads over the fiber length, for each family. Raises as `gbm_plugin.run.run`.
    """
    for n in cells:
        comparison.check_cells(n)
    if len(set(cells)) < len(cells):
        raise ValueError(f"cells are {cells}; allowed: each number once")
    if not 0 < time_step <= END_TIME / 4:
        raise ValueError(f"time step is {time_step:g}; allowed: positive, up to {END_TIME / 4:g}")
    rows = []
    with tempfile.TemporaryDirectory(prefix="gbm-validate-") as folder:
        for n in cells:
            steps = round(END_TIME / (time_step * cells[0] / n))
            rows.append(_compare(Path(case), Path(folder) / str(n), n, steps, seed))
    return {"end_time": END_TIME, "viscosity": VISCOSITY, "rows": rows, "orders": _orders(rows)}


def _compare(case: Path, copy: Path, n: int, steps: int, seed: int) -> dict:
    comparison.make(case, copy, n, steps, seed)
    seconds, states = {}, {}
    for engine in ("openfoam", "spectral"):
        start = time.perf_counter()
        states[engine] = comparison.run(copy, n, steps, engine)
        seconds[engine] = time.perf_counter() - start
    ours, reference = states["openfoam"], states["spectral"]
    result = {
        "cells": n,
        "time_step": END_TIME / steps,
        "velocity_error": comparison.velocity_distance(ours, reference),
        "openfoam_seconds": seconds["openfoam"],
        "spectral_seconds": seconds["spectral"],
    }
    fibers = comparison.fiber_distance(ours, reference)
    return result | {f"{family}_error": error for family, error in fibers.items()}


def _orders(rows: list[dict]) -> list[dict]:
    """Observed orders in the cell size between one row and the next."""
    names = [name for name in rows[0] if name.endswith("_error")]
    orders = []
    for coarse, fine in itertools.pairwise(rows):
        ratio = np.log(fine["cells"] / coarse["cells"])
        orders.append({name: float(np.log(coarse[name] / fine[name]) / ratio) for name in names})
    return orders


def table(result: dict) -> str:
    """The result of `run` as text."""
    errors = [name for name in result["rows"][0] if name.endswith("_error")]
    head = "cells   step [s]" + "".join(f"{e.removesuffix('_error'):>12}" for e in errors)
    lines = [head + "   OpenFOAM [s]   spectral [s]"]
    for row in result["rows"]:
        line = f"{row['cells']:5d} {row['time_step']:10.4g}" + "".join(f"{row[e]:12.3e}" for e in errors)
        lines.append(line + f"{row['openfoam_seconds']:15.1f}{row['spectral_seconds']:15.1f}")
    for order in result["orders"]:
        lines.append("  order" + 9 * " " + "".join(f"{order[e]:12.2f}" for e in errors))
    return "\n".join(lines)


def draw(result: dict) -> Figure:
    """The errors against cells and against time spent."""
    return convergence_figure(result["rows"])
