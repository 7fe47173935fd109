"""The same fibers through OpenFOAM, with the cellular flow of section 3 held there, and in the analytic flow.

The flow of eq. (12) fills the box 2π with W = π; its convection is the gradient of a pressure, and linearForcing
balances viscosity with what the solver's own second difference makes of ν|k|² = 2ν.
The force lets the larger modes of the box grow at the rate ν, from rounding, so that νt must stay small; how far the
velocity has moved at the end is reported. Fibers of the study `buckling`, same starts: their paths converge to those
of `simulate` in the cells and in the step, and their buckling probability is that of the analytic flow within the
error of its difference.
"""

from __future__ import annotations

import argparse
import itertools
import math
import tempfile
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure
from numpy.typing import NDArray

from ...case.layout import results
from ...case.solver import second_difference
from ...fiber import Fibers, simulate
from ...flow import TaylorGreen
from ...output.field import read_velocity
from ...output.recording import open_recording
from ...run.openfoam import run as run_openfoam
from ...statistics.buckling import Tracks, difference, probability, strain
from ..figures import orders_figure
from ..scenes import checked_cells, checked_step, ends_apart, observed_orders, order_lines, rms, scene_copy
from ..study import option
from ..taylor_green import DEFAULT, RATE, Run, Scene
from .comparison import sampling_word

WIDTH = VELOCITY = np.pi  # W [m] and U₀ [m/s]: W/U₀ is 1 s
VISCOSITY = 0.1 * np.pi
# sin x cos y = ½ [sin(x + y) + sin(x − y)], −cos x sin y = −½ [sin(x + y) − sin(x − y)]
FLOW = """field modes;
modes ( ((1 1 0) (0 0 0) (-{0} {0} 0)) ((1 -1 0) (0 0 0) (-{0} -{0} 0)) );
""".format(VELOCITY / 2)
FORCING = """linearForcing {{ type linearForcing; mode constantCoefficient; A {rate!r}; }}
"""
FIBERS = """recordInterval {every};
mobility rpy;
integrator ab3;
interpolation {interpolation};
families {{ fibers {{ shape file; positions starts.npy; bendingStiffness {stiffness!r}; }} }}
"""
PATHS_END = 2.0  # W/U₀, for paths
REFERENCE = {"time_step": 0.005, "tolerance": 1e-8, "mobility": "rpy"}  # of `simulate`


def add_arguments(parser: argparse.ArgumentParser) -> None:
    option(parser, run, "case", "OpenFOAM case whose schemes are judged (default: this folder)")
    option(parser, run, "sp", "Sperm number")
    option(
        parser, run, "cells", "in each direction, one mesh after the other; the last but one counts tracks"
    )
    option(
        parser,
        run,
        "steps",
        "time steps of the paths' run, and 2^halvings times fewer on the last mesh but one",
    )
    option(parser, run, "halvings", "of the longest step")
    option(parser, run, "count", "fibers")
    option(parser, run, "end", "time of the probability [W/U0]")
    option(parser, run, "seed", "of positions and directions")


def run(
    case: Path | str,
    sp: float = 450.0,
    cells: Sequence[int] = (16, 24, 32),
    steps: int = 256,
    halvings: int = 2,
    count: int = 400,
    end: float = 16.0,
    seed: int = 1,
) -> dict:
    """Errors of paths in the cells and in the step, and the probability both ways. Raises as
    `gbm_plugin.run.openfoam.run`, and ValueError for numbers that are not allowed."""
    checked_cells(cells)
    checked_step(PATHS_END / steps, PATHS_END / 4 / 2**halvings)
    if len(cells) < 2 or steps % 2**halvings:
        raise ValueError(
            f"{len(cells)} meshes, {steps} steps; allowed: two meshes at least, steps that can be halved"
        )
    scene = Scene(sp, count=count, seed=seed)
    starts = WIDTH * scene.positions(count, np.random.default_rng(seed))
    starts[..., 2] += WIDTH
    middle = cells[-2]
    with tempfile.TemporaryDirectory(prefix="gbm-buckling-") as folder:
        inputs = (case, Path(folder), scene, starts)
        by_cells = {n: _solve(*inputs, n, steps, PATHS_END, steps) for n in cells}
        by_step = {
            steps // 2**i: _solve(*inputs, middle, steps // 2**i, PATHS_END, 1)
            for i in range(halvings, 0, -1)
        }
        many = round(end / PATHS_END * steps / 2)
        counted = _solve(*inputs, middle, many, end, 1)
    reference = _reference(scene, starts, PATHS_END)
    radius = WIDTH * scene.length / scene.beads / 2
    rows = [
        {"cells": n, "time_step": PATHS_END / steps}
        | {"velocity_error": found["velocity_error"]}
        | {"paths_error": ends_apart(found["positions"][-1], reference, radius)}
        for n, found in by_cells.items()
    ]
    finest = by_cells[middle]["positions"][-1]
    chain = [*by_step.items(), (steps, {"positions": [finest]})]
    temporal = [
        {"cells": middle, "time_step": PATHS_END / coarse_steps}
        | {"paths_error": ends_apart(coarse["positions"][-1], fine["positions"][-1], radius)}
        for (coarse_steps, coarse), (_, fine) in itertools.pairwise(chain)
    ]
    return {
        **{
            "sperm_number": sp,
            "count": count,
            "end": end,
            "seed": seed,
            "cells": middle,
            "viscosity": VISCOSITY,
        },
        **{"rows": rows, "orders": observed_orders(rows)},
        **{"temporal_rows": temporal, "temporal_orders": observed_orders(temporal, by="time_step")},
        **{"probability_rows": _probabilities(scene, counted, end)},
        **{"held_to": counted["velocity_error"]},
    }


def _solve(
    case: Path | str,
    folder: Path,
    scene: Scene,
    starts: NDArray,
    cells: int,
    steps: int,
    end: float,
    every: int,
) -> dict:
    """Velocity's distance from the cellular flow at the end, and the recorded positions (S, F, N, 3) [m]."""
    # [N m²]; μ = ν in SI: Sp = μSL⁴/K with S = πU₀/W
    stiffness = VISCOSITY * RATE * (WIDTH * scene.length) ** 4 / scene.sperm_number
    words = {"every": every, "interpolation": sampling_word(case), "stiffness": stiffness}
    copy = scene_copy(
        case,
        folder / f"{cells}_{steps}_{end:g}_{every}",
        cells=cells,
        steps=steps,
        end_time=end,
        viscosity=VISCOSITY,
        write_every=steps,
        texts={
            "system/initialFieldDict": FLOW,
            "constant/fvOptions": FORCING.format(rate=_damping(case, cells)),
            "constant/fiberProperties": FIBERS.format(**words),
        },
    )
    np.save(copy / "starts.npy", starts)
    run_openfoam(copy)
    exact = _exact(cells)
    found = rms(read_velocity(copy, f"{end:g}", (cells, cells, cells)) - exact) / rms(exact)
    with open_recording(results(copy)) as recording:
        return {"velocity_error": found, "positions": np.asarray(recording.families["fibers"].positions)}


def _damping(case: Path | str, cells: int) -> float:
    """[1/s] at which the case's solver, on so many cells, damps the flow by viscosity."""
    h = 2 * WIDTH / cells
    coefficients = enumerate(second_difference(Path(case)), start=1)
    return 2 * VISCOSITY * sum(2 * c * (1 - math.cos(m * h)) for m, c in coefficients) / h**2


def _exact(cells: int) -> NDArray:
    """The cellular flow at the cell centres, (3, n, n, n)."""
    centres = 2 * WIDTH * (np.arange(cells) + 0.5) / cells
    positions = np.stack(np.meshgrid(centres, centres, centres, indexing="ij"), axis=-1)
    return np.moveaxis(TaylorGreen(WIDTH, VELOCITY).sample(positions, 0.0, "velocity")[0], -1, 0)


def _reference(scene: Scene, starts: NDArray, end: float) -> NDArray:
    stiffness = RATE * (WIDTH * scene.length) ** 4 / scene.sperm_number
    fibers = Fibers(starts, stiffness, 1.0)
    return simulate(fibers, TaylorGreen(WIDTH, VELOCITY), end_time=end, **REFERENCE).positions[-1]


def _probabilities(scene: Scene, counted: dict, end: float) -> list[dict]:
    """P of the recorded paths, of the analytic flow, and their difference, whose error counts the same starts."""
    tracks = Tracks(scene.count)
    for positions in counted["positions"]:
        ends = (positions[:, -1] - positions[:, 0])[:, :2].T
        x, y = np.pi / WIDTH * np.moveaxis(positions.mean(axis=1)[:, :2], -1, 0)
        ratio = np.hypot(*ends) / (WIDTH * scene.contour(DEFAULT[1]))
        tracks.observe(strain(x, y, *ends), ratio)
    analytic = Run(scene)
    analytic.advance(end)
    others = analytic.tracks[DEFAULT]
    found = []
    for name, own in (("OpenFOAM", tracks), ("analytic flow", others)):
        p = probability(own.events, own.tracks)
        found.append({"flow": name, "tracks": p.tracks, "events": p.events, "probability": p.value})
        found[-1]["standard_error"] = p.error
    apart, error = difference((tracks.events, tracks.tracks), (others.events, others.tracks))
    return [*found, {"flow": "difference", "probability": apart, "standard_error": error}]


def rows(result: dict) -> list[dict]:
    """The lines of a CSV file."""
    return result["rows"] + result["temporal_rows"] + result["probability_rows"]


def table(result: dict) -> str:
    """The result of `run` as text."""
    parts = [
        f"paths at {PATHS_END:g} W/U0 against `simulate` in the analytic flow, Sp = {result['sperm_number']:g}"
    ]
    parts += order_lines(result["rows"], result["orders"])
    parts += ["", "against the run with half the step"]
    parts += order_lines(result["temporal_rows"], result["temporal_orders"])
    parts += [
        "",
        f"{result['count']} fibers, {result['end']:g} W/U0, {result['cells']}^3 cells, velocity held to ",
    ]
    parts[-1] += f"{result['held_to']:.1e}"
    for r in result["probability_rows"]:
        counts = f"{r['events']:6d} of {r['tracks']:6d} tracks" if "tracks" in r else 22 * " "
        parts.append(f"{r['flow']:14} {counts}   P = {r['probability']:8.4f} ± {r['standard_error']:.4f}")
    return "\n".join(parts)


def draw(result: dict) -> Figure:
    """Errors against cells, differences against the step."""
    return orders_figure(result["rows"], result["temporal_rows"])
