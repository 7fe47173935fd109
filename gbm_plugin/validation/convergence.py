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

from ..case.copies import HEADER, copy_case
from ..output.field import read_velocity
from ..output.figures import convergence_figure
from ..output.recording import open_recording
from ..run import run as run_openfoam
from ..run import run_spectral

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
    if len(set(cells)) < len(cells) or any(n < 8 or n % 2 for n in cells):
        raise ValueError(f"cells are {cells}; allowed: even numbers of at least 8, each once")
    if not 0 < time_step <= END_TIME / 4:
        raise ValueError(f"time step is {time_step:g}; allowed: positive, up to {END_TIME / 4:g}")
    rows = []
    with tempfile.TemporaryDirectory(prefix="gbm-validate-") as folder:
        for n in cells:
            steps = round(END_TIME / (time_step * cells[0] / n))
            rows.append(_compare(Path(case), Path(folder) / str(n), n, steps, seed))
    return {"end_time": END_TIME, "viscosity": VISCOSITY, "rows": rows, "orders": _orders(rows)}


def _compare(case: Path, copy: Path, n: int, steps: int, seed: int) -> dict:
    _make(case, copy, n, steps, seed)
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
        "velocity_error": _rms(ours - reference) / _rms(reference),
        "openfoam_seconds": seconds["openfoam"],
        "spectral_seconds": seconds["spectral"],
    }
    with (
        open_recording(copy / "postProcessing/fibers") as a,
        open_recording(copy / "spectral/postProcessing/fibers") as b,
    ):
        for family in a.families:
            x, y = a.families[family].positions[-1], b.families[family].positions[-1]
            length = 2 * a.families[family].radius * a.families[family].beads
            ends = (x - y)[:, [0, -1]]
            result[f"{family}_error"] = float(np.sqrt(np.mean(np.sum(ends**2, axis=-1)))) / length
    return result


def _make(case: Path, copy: Path, n: int, steps: int, seed: int) -> None:
    time = {
        "deltaT": END_TIME / steps,
        "endTime": END_TIME,
        "writeControl": "timeStep",
        "writeInterval": steps,
    }
    entries = {
        "system/controlDict": time,
        "system/blockMeshDict": {"n": n},
        "constant/transportProperties": {"nu": VISCOSITY},
    }
    texts = {
        "system/initialFieldDict": FLOW.format(seed=seed),
        "constant/fvOptions": FORCING,
        "constant/fiberProperties": FIBERS.format(steps=steps, interpolation="trilinear"),
    }
    copy_case(case, copy, entries, texts)


def _rms(u: np.ndarray) -> float:
    return float(np.sqrt(np.mean(np.sum(u**2, axis=0))))


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
