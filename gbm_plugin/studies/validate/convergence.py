"""One case in both engines at several resolutions.

How fast OpenFOAM and its fibers converge to the spectral solver, which resolves the same initial modes exactly.
"""

from __future__ import annotations

import argparse
import tempfile
import time
from collections.abc import Sequence
from pathlib import Path

from matplotlib.figure import Figure

from ..figures import convergence_figure
from ..scenes import checked_cells, checked_step, observed_orders, order_lines
from ..study import option
from . import comparison
from .comparison import END_TIME, VISCOSITY


def add_arguments(parser: argparse.ArgumentParser) -> None:
    option(parser, run, "case", "OpenFOAM case whose schemes are judged (default: this folder)")
    option(parser, run, "cells", "in each direction, one mesh after the other")
    option(parser, run, "time_step", "of the coarsest mesh, others in proportion [s]")
    option(parser, run, "seed", "of the initial field")
    option(parser, run, "fibers", "in each family")


def run(
    case: Path | str,
    cells: Sequence[int] = (24, 32, 48, 64),
    time_step: float = 0.08,
    seed: int = 1,
    fibers: int = 50,
) -> dict:
    """Errors of OpenFOAM against the spectral solver at the same time.

    case: whose schemes, solver settings and interpolation at the beads are judged. time_step: that of the coarsest
    mesh [s]; finer ones take it in proportion to their cells. Velocity: rms difference at the cell centres over the
    rms velocity. Fibers: rms difference of the end beads over the fiber length, for each family. Raises as
    `gbm_plugin.run.openfoam.run`.
    """
    checked_cells(cells)
    checked_step(time_step, END_TIME / 4)
    rows = []
    with tempfile.TemporaryDirectory(prefix="gbm-validate-") as folder:
        for n in cells:
            steps = round(END_TIME / (time_step * cells[0] / n))
            rows.append(_compare(Path(case), Path(folder) / str(n), n, steps, seed, fibers))
    return {"end_time": END_TIME, "viscosity": VISCOSITY, "rows": rows, "orders": observed_orders(rows)}


def _compare(case: Path, copy: Path, n: int, steps: int, seed: int, fibers: int) -> dict:
    comparison.make(case, copy, n, steps, seed)
    seconds, states = {}, {}
    for engine, word in (("openfoam", comparison.sampling_word(case)), ("spectral", "exact")):
        start = time.perf_counter()
        states[engine] = comparison.run(copy, n, steps, engine, word, fibers)
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


def rows(result: dict) -> list[dict]:
    """The lines of a CSV file."""
    return result["rows"]


def table(result: dict) -> str:
    """The result of `run` as text."""
    return "\n".join(order_lines(result["rows"], result["orders"]))


def draw(result: dict) -> Figure:
    """The errors against cells and against time spent."""
    return convergence_figure(result["rows"])
