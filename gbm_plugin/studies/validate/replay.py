"""Fibers in stored fields against those of the coupled run that stored them.

One run of OpenFOAM writes every step of developed turbulence; replays then take every field, every second one, ...
How often must a run write its flow for fibers that are added later?
"""

from __future__ import annotations

import argparse
import itertools
import math
import shutil
import tempfile
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure

from ...case.copies import copy_case
from ...case.layout import results
from ...case.scene import read_scene
from ...errors import RunError, Stopped
from ...flow.stored import POINTS_IN_TIME
from ...output.recording import open_recording
from ...output.tables import read_forcing
from ...run.openfoam import STOPPED
from ...run.openfoam import run as run_openfoam
from ...run.stored import run_stored
from ...scales import kolmogorov_time
from ..figures import replay_figure
from ..study import option

NOBODY = """families { one { count 1; beads 2; length 0.1; bendingStiffness 0; } }
"""
FIBERS = """recordInterval {steps};
integrator auto;
tolerance 1e-6;
families
{{
    stiff {{ count {count}; beads 20; length 1.5; bendingStiffness 1e-2; seed 1; }}
    medium {{ count {count}; beads 20; length 1.5; bendingStiffness 1e-3; seed 2; }}
    soft {{ count {count}; beads 20; length 1.5; bendingStiffness 1e-5; seed 3; }}
}}
"""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    option(parser, run, "case", "OpenFOAM case whose flow is taken (default: this folder)")
    option(parser, run, "cells", "in each direction; one number")
    option(parser, run, "time_step", "of the run that is stored [s]")
    option(parser, run, "steps", "of that run; a power of two")
    option(parser, run, "development", "least time before it, without fibers [s]")
    option(parser, run, "fibers", "in each family")


def run(
    case: Path | str,
    cells: Sequence[int] = (32,),
    time_step: float = 0.0125,
    steps: int = 256,
    development: float = 10.0,
    fibers: int = 50,
) -> dict:
    """Distances of replays to the coupled run, at its end.

    case: whose flow is taken: forcing, viscosity, initial field, schemes. cells: one number, in each direction.
    time_step [s], steps: of the run that is stored, a power of two. development: least time before it, without
    fibers [s]. Distance: rms over the end beads, over the fiber length, for each family. Raises as
    `gbm_plugin.run.openfoam.run`.
    """
    if len(cells) != 1 or cells[0] < 8 or cells[0] % 2:
        raise ValueError(f"cells are {' '.join(map(str, cells))}; one even number of at least 8 is needed")
    if steps < 16 or steps & (steps - 1):
        raise ValueError(f"steps are {steps}; allowed: powers of two from 16 on")
    with tempfile.TemporaryDirectory(prefix="gbm-validate-") as folder:
        live = _live(Path(case), Path(folder), cells[0], time_step, steps, development, fibers)
        tau = _kolmogorov_time(live)
        size = (live / f"{read_scene(live).end_time:.8g}/U").stat().st_size
        rows = []
        for in_time, power in itertools.product(POINTS_IN_TIME, range(int(math.log2(steps)) - 1)):
            every = 2**power
            rows.append(
                {
                    "in_time": in_time,
                    "every": every,
                    "interval": every * time_step,
                    "interval_over_tau": every * time_step / tau,
                    "bytes_per_time": size / (every * time_step),
                    **_distances(live, in_time, every),
                }
            )
    return {
        "cells": cells[0],
        "time_step": time_step,
        "end_time": steps * time_step,
        "kolmogorov_time": tau,
        "rows": rows,
        "orders": _orders(rows),
    }


def _live(case: Path, folder: Path, n: int, step: float, steps: int, development: float, count: int) -> Path:
    """A coupled run that wrote every step, continued from a developed flow with all that its solver remembers:
    a first step from a velocity alone is not smooth in time."""
    before, live = folder / "development", folder / "live"
    developed = steps * max(1, math.ceil(development / (step * steps)))  # records fall on the last step
    start = developed * step
    for copy, begin, end, every, fibers in (
        (before, 0, start, developed, NOBODY),
        (live, start, start + steps * step, 1, FIBERS.format(steps=steps, count=count)),
    ):
        control = {"deltaT": step, "startTime": begin, "endTime": end}
        control |= {"writeControl": "timeStep", "writeInterval": every}
        entries = {"system/controlDict": control, "system/blockMeshDict": {"n": n}}
        copy_case(case, copy, entries, {"constant/fiberProperties": fibers})
        if copy == live:
            name = f"{start:.8g}"
            forcing = f"uniform/{read_scene(live).forcing.name}"
            for part in ("U", "p", "phi", "U_0", "uniform/time", "uniform/boxFoam", forcing):
                target = live / name / part
                target.parent.mkdir(parents=True, exist_ok=True)
                if (before / name / part).is_file():
                    shutil.copy(before / name / part, target)
        run_openfoam(copy)
    return live


def _kolmogorov_time(live: Path) -> float:
    table = read_forcing(live)
    return kolmogorov_time(read_scene(live).kinematic_viscosity, float(np.mean(table["epsilonBudget"])))


def _distances(live: Path, in_time: str, every: int) -> dict[str, float]:
    scene = replace(read_scene(live), write_interval=math.inf)
    shutil.rmtree(live / "stored", ignore_errors=True)
    if not run_stored(scene, in_time=in_time, every=every):
        raise Stopped(STOPPED)
    result = {}
    with (
        open_recording(results(live)) as a,
        open_recording(results(live / "stored")) as b,
    ):
        if abs(a.times[-1] - b.times[-1]) > 1e-6 * scene.time_step:
            raise RunError(f"the replay ended at {b.times[-1]:g}, the run at {a.times[-1]:g}")
        for family in a.families:
            x, y = a.families[family].positions[-1], b.families[family].positions[-1]
            length = 2 * a.families[family].radius * a.families[family].beads
            ends = (x - y)[:, [0, -1]]
            result[f"{family}_distance"] = float(np.sqrt(np.mean(np.sum(ends**2, axis=-1)))) / length
    return result


def _orders(rows: list[dict]) -> list[dict]:
    """Observed orders in the interval between one row and the next of the same words; not from every field."""
    names = [name for name in rows[0] if name.endswith("_distance")]
    orders = []
    for fine, coarse in itertools.pairwise(rows):
        if fine["in_time"] != coarse["in_time"] or fine["every"] == 1:
            continue
        ratio = np.log(coarse["interval"] / fine["interval"])
        order = {name: float(np.log(coarse[name] / fine[name]) / ratio) for name in names}
        orders.append({"in_time": fine["in_time"], "every": [fine["every"], coarse["every"]], **order})
    return orders


def rows(result: dict) -> list[dict]:
    """The lines of a CSV file."""
    return result["rows"]


def table(result: dict) -> str:
    """The result of `run` as text."""
    names = [name for name in result["rows"][0] if name.endswith("_distance")]
    head = "in time  every  interval/tau  MB per time" + "".join(
        f"{n.removesuffix('_distance'):>12}" for n in names
    )
    lines = [head + "   (distance of end beads / L)"]
    for row in result["rows"]:
        line = f"{row['in_time']:7} {row['every']:6d} {row['interval_over_tau']:13.3f}"
        line += f" {row['bytes_per_time'] / 1e6:12.2f}"
        lines.append(line + "".join(f"{row[name]:12.3e}" for name in names))
    for order in result["orders"]:
        steps = "{} to {}".format(*order["every"])
        lines.append(f"{order['in_time']:7}  order, {steps:24}" + "".join(f"{order[n]:12.2f}" for n in names))
    return "\n".join(lines)


def draw(result: dict) -> Figure:
    """The distances against interval and bytes."""
    return replay_figure(result["rows"])
