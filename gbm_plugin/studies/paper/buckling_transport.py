"""Fibers captured by vortices or meandering between them, and how they disperse, against the Sperm number.

A fiber is trapped that has not gone from one vortex to the next for the last 100 W/U₀; the others meander along the
separatrices. Dispersion is the mean square displacement of the centres, with its exponent between lags of 10 and 100
W/U₀, of all fibers and of those that meander to the end. The stiffest fiber is as good as a rigid rod; tracers,
moved by a Runge–Kutta scheme of fourth order, stay on their streamlines, which are closed.
"""

from __future__ import annotations

import argparse
import tempfile
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure
from numpy.typing import NDArray

from ...flow import TaylorGreen
from ...report.style import COLOURS, new_figure
from ...statistics.transport import exponent, mean_square_displacement
from ..study import option
from ..taylor_green import RECORD, Scene, run_scenes
from .buckling import CURVE, SETTLED

LAGS = np.unique(np.geomspace(1, 200, 24).round().astype(int))  # of records, RECORD apart
FITTED = (10, 100)  # W/U₀
TRACER_STEP = 0.05  # W/U₀


def add_arguments(parser: argparse.ArgumentParser) -> None:
    option(parser, run, "sp", "Sperm numbers")
    option(parser, run, "count", "fibers of each")
    option(parser, run, "end", "time of the flow [W/U0]")
    option(parser, run, "seed", "of positions and directions")
    option(parser, run, "workers", "processes; 0: as many as processors")
    option(parser, run, "state", "folder that keeps the state (default: none)", type=Path)


def run(
    sp: Sequence[float] = CURVE,
    count: int = 400,
    end: float = 1000.0,
    seed: int = 1,
    workers: int = 0,
    state: Path | None = None,
) -> dict:
    """Trapped and meandering fractions, their times, mean square displacements and exponents."""
    if end < 2 * max(SETTLED, LAGS[-1] * RECORD):
        raise ValueError(f"end is {end:g}; at least {2 * max(SETTLED, LAGS[-1] * RECORD):g} W/U0 are needed")
    scenes = [Scene(float(number), count=count, seed=seed) for number in sp]
    with tempfile.TemporaryDirectory(prefix="gbm-buckling-") as own:
        runs = run_scenes(scenes, end, state or Path(own), workers, "transport")
    tracers = _tracers(scenes[0], end)
    found = [_row("tracer", None, tracers, _last_crossing(tracers), end)]
    for scene, moved in zip(scenes, runs, strict=True):
        found.append(_row("fiber", scene.sperm_number, np.array(moved.records.centres), moved.crossed, end))
    return {"count": count, "end": end, "seed": seed, "lags": (LAGS * RECORD).tolist(), "rows": found}


def _tracers(scene: Scene, end: float) -> NDArray:
    """(T, F, 2) paths of tracers that start where the centres of the fibers do, RECORD apart."""
    flow, h = TaylorGreen(1.0, 1.0), TRACER_STEP
    x = scene.positions(scene.count, np.random.default_rng(scene.seed)).mean(axis=1)
    paths, every = [], round(RECORD / h)
    for n in range(1, round(end / h) + 1):
        k1 = flow.sample(x, 0.0, "velocity")[0]
        k2 = flow.sample(x + h / 2 * k1, 0.0, "velocity")[0]
        k3 = flow.sample(x + h / 2 * k2, 0.0, "velocity")[0]
        x = x + h / 6 * (k1 + 2 * k2 + 2 * k3 + flow.sample(x + h * k3, 0.0, "velocity")[0])
        if n % every == 0:
            paths.append(x[:, :2])
    return np.array(paths)


def _last_crossing(paths: NDArray) -> NDArray:
    """(F,) when each path was last seen to enter a vortex cell [W/U₀]; 0 for never."""
    cells = np.floor(paths)
    changed = (np.diff(cells, axis=0) != 0).any(axis=-1)
    times = RECORD * np.arange(2, len(paths) + 1)
    return np.where(changed, times[:, None], 0.0).max(axis=0)


def _row(kind: str, number: float | None, paths: NDArray, crossed: NDArray, end: float) -> dict:
    trapped = end - crossed > SETTLED
    row = {"kind": kind, "sperm_number": number, "trapped_fraction": float(trapped.mean())}
    row |= {"never_left": float((crossed == 0).mean()), "meandering_fraction": float((~trapped).mean())}
    row["median_capture_time"] = float(np.median(crossed[trapped])) if trapped.any() else None
    first, last = np.searchsorted(LAGS * RECORD, FITTED)
    fitted = slice(first, last + 1)
    for name, chosen in (("all", np.ones(len(crossed), bool)), ("meandering", ~trapped)):
        if chosen.any():
            displacement = mean_square_displacement(paths[:, chosen], LAGS)
            row[f"displacement_{name}"] = displacement.tolist()
            row[f"exponent_{name}"] = exponent(LAGS[fitted], displacement[fitted])
    return row


def rows(result: dict) -> list[dict]:
    """The lines of a CSV file."""
    return [{k: v for k, v in row.items() if not isinstance(v, list)} for row in result["rows"]]


def table(result: dict) -> str:
    """Fractions and exponents as text."""
    lines = ["kind            Sp  trapped  never left  captured at  exponent  of meandering"]
    for r in result["rows"]:
        number = "" if r["sperm_number"] is None else f"{r['sperm_number']:.4g}"
        when = "" if r["median_capture_time"] is None else f"{r['median_capture_time']:.0f}"
        own = f"{r['exponent_meandering']:14.2f}" if "exponent_meandering" in r else ""
        lines.append(
            f"{r['kind']:8} {number:>9} {r['trapped_fraction']:8.3f} {r['never_left']:11.3f} {when:>12} "
            f"{r['exponent_all']:9.2f} {own}"
        )
    return "\n".join(lines)


def draw(result: dict) -> Figure:
    """Fractions against Sp, and mean square displacements of a few."""
    figure = new_figure(9.5, 4.0)
    left, right = figure.subplots(1, 2)
    fibers = [r for r in result["rows"] if r["kind"] == "fiber"]
    numbers = [r["sperm_number"] for r in fibers]
    for colour, name in zip(COLOURS, ("trapped_fraction", "never_left"), strict=False):
        left.semilogx(numbers, [r[name] for r in fibers], "o-", color=colour, label=name.replace("_", " "))
    left.set(xlabel="Sp", ylabel="fraction of fibers", ylim=(0, 1))
    left.legend()
    chosen = [
        result["rows"][0],
        *(fibers[i] for i in np.linspace(0, len(fibers) - 1, min(5, len(fibers))).astype(int)),
    ]
    for colour, r in zip(COLOURS, chosen, strict=False):
        label = "tracer" if r["sperm_number"] is None else f"Sp = {r['sperm_number']:g}"
        right.loglog(result["lags"], r["displacement_all"], color=colour, label=label)
    right.set(xlabel="lag [W/U₀]", ylabel="mean square displacement [W²]")
    right.legend(fontsize=8)
    return figure
