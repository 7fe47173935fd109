"""The spectral solver on a GPU: against the CPU, and the time of a step beside the memory's bound.

The bound is that of eight transforms that each read and write a field three times, at the speed at which the device
copies an array. A sample is what fibers ask for in a step of theirs: six fields at the nodes, interpolated.
"""

from __future__ import annotations

import argparse
import time

import numpy as np

from ...case.fields import peaked_spectrum, random_modes
from ...spectral import LinearForcing, SpectralSolver
from ..study import option


def add_arguments(parser: argparse.ArgumentParser) -> None:
    option(parser, run, "device", "the one that is judged", choices=["gpu", "cpu"])
    option(parser, run, "sizes", "cells per edge of the steps that are timed")


POINTS = 40_000


def run(device: str = "gpu", sizes: tuple[int, ...] = (256, 512)) -> dict:
    """Differences and times. ValueError where there is no such device."""
    precisions = ("double", "single")
    found = [row for p in precisions for row in _differences(device, p)]
    return {"rows": found + [_timed(device, cells, p) for cells in sizes for p in precisions]}


def _built(device: str, cells: int, precision: str) -> SpectralSolver:
    solver = SpectralSolver(
        cells,
        0.01,
        forcing=LinearForcing(power=0.1),
        time_step=0.1 / cells,
        device=device,
        precision=precision,
        interpolation="cubic",
    )
    flow = random_modes(peaked_spectrum(1.0, 3, 8), seed=1)
    solver.set_modes(flow.wavevectors, flow.amplitudes)
    return solver


def _places(count: int) -> np.ndarray:
    return np.random.default_rng(1).uniform(-1, 8, (count, 3))


def _differences(device: str, precision: str) -> list[dict]:
    """Largest differences of the velocity after five steps and of samples then, over their rms; the CPU's in double."""
    ours, reference = _built(device, 48, precision), _built("cpu", 48, "double")
    places, rows = _places(2000), []
    for solver in (ours, reference):
        solver.advance(5)
    sampled = zip(*(s.sample(places, s.time, "rotation") for s in (ours, reference)), strict=True)
    pairs = [("velocity", (ours.velocity, reference.velocity))]
    for part, (a, b) in pairs + list(zip(("sampled velocity", "sampled rotation"), sampled, strict=True)):
        difference = float(np.abs(a - b).max() / b.std())
        rows.append({"part": part, "precision": precision, "cells": 48, "difference": difference})
    return rows


def _timed(device: str, cells: int, precision: str) -> dict:
    solver, places = _built(device, cells, precision), _places(POINTS)
    solver.advance(4)  # the first compile, and start the scheme
    solver.sample(places, solver.time, "rotation")
    spent: dict[str, list[float]] = {"step": [], "sample": []}
    for _ in range(5):
        start = time.perf_counter()
        solver.advance()  # its energy comes to the host: the step is over
        between = time.perf_counter()
        solver.sample(places, solver.time, "rotation")
        spent["step"].append(between - start)
        spent["sample"].append(time.perf_counter() - between)
    xp, real = solver.operators.xp, solver.operators.real
    a, b = (xp.zeros(cells**3, real) for _ in range(2))
    start = time.perf_counter()
    for _ in range(5):
        a[:] = b
    float(a[-1])
    bandwidth = 5 * 2 * a.nbytes / (time.perf_counter() - start)
    bound = 8 * 3 * 2 * a.nbytes / bandwidth
    step = min(spent["step"])
    return {
        "part": "step",
        "precision": precision,
        "cells": cells,
        "seconds": step,
        "sample": min(spent["sample"]),
        "bandwidth": bandwidth,
        "bound": bound,
        "ratio": step / bound,
    }


def rows(result: dict) -> list[dict]:
    """The lines of a CSV file."""
    return result["rows"]


def table(result: dict) -> str:
    """Every row in one line."""
    cell = lambda v: f"{v:.4g}" if isinstance(v, float) else str(v)  # noqa: E731
    return "\n".join("  ".join(f"{n} {cell(v)}" for n, v in row.items()) for row in result["rows"])
