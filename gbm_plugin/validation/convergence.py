"""`gbm validate --study convergence`: one case in both engines at several resolutions.

How fast OpenFOAM and its fibers converge to the spectral solver, which resolves the same initial modes exactly.
"""

from __future__ import annotations

import tempfile
import time
from collections.abc import Sequence
from pathlib import Path

from matplotlib.figure import Figure

from ..case.copies import HEADER
from ..output.field import read_velocity
from ..output.recording import open_recording
from ..output.study_figures import convergence_figure
from ..run import run as run_openfoam
from ..run import run_spectral
from .runs import checked_cells, checked_step, ends_apart, observed_orders, order_lines, rms, scene_copy

FLOW = """field random; spectrum table; table ((1 0.08) (2 0.12) (3 0.05)); seed {seed};
"""
FORCING = """linearForcing { type linearForcing; mode constantPower; power 0.05; }
"""
FIBERS = """recordInterval {steps};
integrator auto;
tolerance 1e-6;
interpolation {interpolation};
families
{{
    stiff {{ count 50; beads 20; length 1.5; bendingStiffness 1e-2; seed 1; }}
    medium {{ count 50; beads 20; length 1.5; bendingStiffness 1e-3; seed 2; }}
    soft {{ count 50; beads 20; length 1.5; bendingStiffness 1e-4; seed 3; }}
}}
"""
END_TIME = 1.2  # half a turnover: k/eps of this flow, at its start, is 2.5 s
VISCOSITY = 0.03  # Kolmogorov length 0.15: 24 cells are 1.8 of it wide


def run(
    case: Path | str, cells: Sequence[int] = (24, 32, 48, 64), time_step: float = 0.04, seed: int = 1
) -> dict:
    """Errors of OpenFOAM against the spectral solver at the same time.

    case: whose schemes and solver settings are judged. time_step: that of the coarsest mesh [s]; finer ones
    take it in proportion to their cells. Velocity: rms difference at the cell centres over the rms velocity.
    Fibers: rms difference of the end beads over the fiber length, for each family. Raises as `gbm_plugin.run.run`.
    """
    checked_cells(cells)
    checked_step(time_step, END_TIME / 4)
    rows = []
    with tempfile.TemporaryDirectory(prefix="gbm-validate-") as folder:
        for n in cells:
            steps = round(END_TIME / (time_step * cells[0] / n))
            rows.append(_compare(Path(case), Path(folder) / str(n), n, steps, seed))
    return {"end_time": END_TIME, "viscosity": VISCOSITY, "rows": rows, "orders": observed_orders(rows)}


def _compare(case: Path, copy: Path, n: int, steps: int, seed: int) -> dict:
    scene_copy(
        case,
        copy,
        cells=n,
        steps=steps,
        end_time=END_TIME,
        viscosity=VISCOSITY,
        write_every=steps,
        texts={"system/initialFieldDict": FLOW.format(seed=seed), "constant/fvOptions": FORCING},
    )
    seconds = {}
    for engine, function in (("openfoam", run_openfoam), ("spectral", run_spectral)):
        words = FIBERS.format(steps=steps, interpolation="trilinear" if engine == "openfoam" else "exact")
        (copy / "constant/fiberProperties").write_text(HEADER + words)
        start = time.perf_counter()
        function(copy)
        seconds[engine] = time.perf_counter() - start
    name = f"{END_TIME:g}"
    ours = read_velocity(copy, name, (n, n, n))
    reference = read_velocity(copy / "spectral", name, (n, n, n))
    result = {
        "cells": n,
        "time_step": END_TIME / steps,
        "velocity_error": rms(ours - reference) / rms(reference),
        "openfoam_seconds": seconds["openfoam"],
        "spectral_seconds": seconds["spectral"],
    }
    with (
        open_recording(copy / "postProcessing/fibers") as a,
        open_recording(copy / "spectral/postProcessing/fibers") as b,
    ):
        for name, family in a.families.items():
            theirs = b.families[name].positions[-1]
            result[f"{name}_error"] = ends_apart(family.positions[-1], theirs, family.radius)
    return result


def table(result: dict) -> str:
    """The result of `run` as text."""
    return "\n".join(order_lines(result["rows"], result["orders"]))


def draw(result: dict) -> Figure:
    """The errors against cells and against time spent."""
    return convergence_figure(result["rows"])
