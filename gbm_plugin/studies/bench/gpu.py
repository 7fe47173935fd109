"""The spectral solver on a GPU: against the CPU's operators, and the time of a step beside the memory's bound.

Prepared for a device that is at hand for minutes; it has not been run on one. The bound is that of eight transforms
that each read and write a field three times, at the speed at which the device copies an array.
"""

from __future__ import annotations

import argparse
import time

import numpy as np

from ...case.fields import taylor_green_vortex
from ...spectral import LinearForcing, SpectralSolver
from ..study import option


def add_arguments(parser: argparse.ArgumentParser) -> None:
    option(parser, run, "device", "the one that is judged", choices=["gpu", "cpu"])
    option(parser, run, "sizes", "cells per edge of the steps that are timed")


def run(device: str = "gpu", sizes: tuple[int, ...] = (256, 512)) -> dict:
    """Differences and times. ValueError where there is no such device."""
    precisions = ("double", "single")
    found = [{"part": "operators", "precision": p, "difference": _difference(device, p)} for p in precisions]
    return {"rows": found + [_timed(device, cells, p) for cells in sizes for p in precisions]}


def _built(device: str, cells: int, precision: str) -> SpectralSolver:
    force = LinearForcing(power=0.1)
    solver = SpectralSolver(
        cells, 0.01, forcing=force, time_step=0.2 / cells, device=device, precision=precision
    )
    solver.set_velocity(taylor_green_vortex(1.0).on_lattice((cells,) * 3))
    return solver


def _difference(device: str, precision: str) -> float:
    """Largest difference of velocities after five steps, over their rms; the CPU's in double."""
    ours, reference = _built(device, 48, precision), _built("cpu", 48, "double")
    for solver in (ours, reference):
        solver.advance(5)
    u = reference.velocity
    return float(np.abs(ours.velocity - u).max() / u.std())


def _timed(device: str, cells: int, precision: str) -> dict:
    solver = _built(device, cells, precision)
    solver.advance(3)
    spent = []
    for _ in range(5):
        start = time.perf_counter()
        solver.advance()  # its energy comes to the host: the step is over
        spent.append(time.perf_counter() - start)
    xp, real = solver.operators.xp, solver.operators.real
    a, b = (xp.zeros(cells**3, real) for _ in range(2))
    start = time.perf_counter()
    for _ in range(5):
        a[:] = b
    float(a[-1])
    bandwidth = 5 * 2 * a.nbytes / (time.perf_counter() - start)
    bound = 8 * 3 * 2 * a.nbytes / bandwidth
    best = min(spent)
    return {
        "part": "step",
        "precision": precision,
        "cells": cells,
        "seconds": best,
        "bound": bound,
        "ratio": best / bound,
    }


def rows(result: dict) -> list[dict]:
    """The lines of a CSV file."""
    return result["rows"]


def table(result: dict) -> str:
    """Every row in one line."""
    cell = lambda v: f"{v:.4g}" if isinstance(v, float) else str(v)  # noqa: E731
    return "\n".join("  ".join(f"{n} {cell(v)}" for n, v in row.items()) for row in result["rows"])
