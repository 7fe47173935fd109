"""What an error of the flow costs: boxFoam, pimpleFoam, OpenFOAM's own best settings, and the spectral solver.

Two flows, without fibers: the smooth one of `convergence`, and developed turbulence, which every solver takes from one
field of the spectral solver. The error is the rms difference from a resolved spectral run, at the solver's own points
over the rms velocity there; the cost is the processor time of all steps on one core. The last column compares a cost
with that of boxFoam at the same error, on the line through its points; ">" where boxFoam's coarsest has less error.

A run of OpenFOAM that would take more than --longest by the mesh before it (n^4) is cut to a few steps: its step is
measured, and its error, "~", is that of the line through the two meshes before.
"""

from __future__ import annotations

import argparse
import re
import subprocess
import tempfile
import time
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure
from numpy.typing import NDArray

from ...case.edit import set_entries
from ...case.fields import FourierModes, peaked_spectrum, random_modes
from ...case.initial import write_velocity
from ...case.new import new_case
from ...case.openfoam import command, environment
from ...case.prepare import make_mesh
from ...errors import RunError
from ...output.field import read_velocity
from ...report.style import COLOURS, new_figure
from ...spectral import LinearForcing, SpectralSolver
from ..scenes import checked_cells, rms, scene_copy
from ..study import option, steps
from .step import LOOSE, PCG_GAMG, STOCK, Setting

POWER = 0.05
FEW = 4  # steps of a run that would take too long
DEVELOPED = 96  # cells on which a flow develops: its scales, at most
WORK = 5_000_000  # cells times steps of boxFoam, about half a second
FORCING = f"linearForcing {{ type linearForcing; mode constantPower; power {POWER}; }}\n"


@dataclass(frozen=True)
class Flow:
    """viscosity [m2/s]; time before the start, by the spectral solver, and from there on [s]; its modes at first."""

    viscosity: float
    development: float
    end_time: float
    modes: FourierModes


FLOWS = {
    "smooth": Flow(0.03, 0.0, 1.2, random_modes({1: 0.08, 2: 0.12, 3: 0.05}, seed=1)),
    "turbulent": Flow(0.01, 6.0, 0.8, random_modes(peaked_spectrum(0.25, 2, 8), seed=1)),
}


@dataclass(frozen=True)
class Solver:
    """step: that on 32^3 [s], on other meshes in proportion to the cells; stock: settings instead of the case's;
    differences: of boxFoam instead of the case's."""

    application: str
    step: float
    stock: Setting | None = None
    cells: tuple[int, ...] = field(default=())  # beside those that are asked for
    differences: str = "central6"


BEST = Setting(
    PCG_GAMG.format("GaussSeidel", 1), LOOSE, laminar=STOCK["laminar"], cubic="cubic", outer=2, inner=1
)
SOLVERS = {
    "boxFoam": Solver("boxFoam", 0.03, cells=(16, 24)),
    "boxFoam, order 4": Solver("boxFoam", 0.03, cells=(24,), differences="central4"),
    "boxFoam, order 2": Solver("boxFoam", 0.03, cells=(24,), differences="central2"),
    "pimpleFoam": Solver("pimpleFoam", 0.05),
    "pimpleFoam, stock": Solver("pimpleFoam", 0.05, BEST),
    "spectral": Solver("", 0.02, cells=(16, 24)),
}


def add_arguments(parser: argparse.ArgumentParser) -> None:
    option(parser, run, "cells", "in each direction, one mesh after the other")
    option(parser, run, "reference", "cells of the spectral run that judges")
    option(parser, run, "flows", "which", choices=list(FLOWS))
    option(parser, run, "solvers", "which (default: all)", choices=list(SOLVERS), metavar="NAME")
    option(parser, run, "longest", "run of OpenFOAM in full, seconds of processor time")


def run(
    cells: Sequence[int] = (32, 48, 64),
    reference: int = 96,
    flows: Sequence[str] = tuple(FLOWS),
    solvers: Sequence[str] = tuple(SOLVERS),
    longest: float = 60.0,
) -> dict:
    """Errors and costs of each flow by each solver on each mesh. RunError where a solver fails."""
    checked_cells([*cells, reference] if reference not in cells else cells, 16)
    jobs = [
        (flow, name, n)
        for flow in flows
        for name in solvers
        for n in sorted({*cells, *(m for m in SOLVERS[name].cells if m < min(cells))})
    ]
    fields = {name: _reference(FLOWS[name], reference) for name in flows}
    rows = []
    with tempfile.TemporaryDirectory(prefix="gbm-bench-") as folder:
        for number, (flow, name, n) in enumerate(steps(jobs, len(jobs), "runs")):
            start, end = fields[flow]
            solver = SOLVERS[name]
            count = max(4, round(FLOWS[flow].end_time / (solver.step * 32 / n)))
            offset = 0.5 if solver.application else 0.0
            begin, exact = at_points(resolved(start, n), n, offset), at_points(end, n, offset)
            coarser = [r for r in rows if (r["flow"], r["solver"]) == (flow, name)]
            cut = bool(solver.application) and too_long(coarser, n, longest)
            if solver.application:
                path = Path(folder) / str(number)
                found, seconds = _openfoam(path, FLOWS[flow], solver, n, count, begin, FEW if cut else count)
            else:
                found, seconds = _spectral(FLOWS[flow], n, count, begin)
            error = on_their_line(coarser, n) if cut else rms(found - exact) / rms(exact)
            row = {"flow": flow, "solver": name, "cells": n, "time_step": FLOWS[flow].end_time / count}
            row |= {"velocity_error": error, "extrapolated": cut, "processor_seconds": seconds}
            rows.append(row | {"step_seconds": seconds / count})
    for row in rows:
        row["over_box"], row["at_least"] = over_box(row, [r for r in rows if r["flow"] == row["flow"]])
    return {"reference": reference, "rows": rows}


def too_long(coarser: list[dict], cells: int, longest: float) -> bool:
    """Whether a run would take more processor time [s], after two on coarser meshes."""
    if len(coarser) < 2:
        return False
    last = coarser[-1]
    return last["processor_seconds"] * (cells / last["cells"]) ** 4 > longest


def on_their_line(coarser: list[dict], cells: int) -> float:
    """The error on a finer mesh, by the power of the cells that the last two show."""
    n, error = (np.log([r[name] for r in coarser[-2:]]) for name in ("cells", "velocity_error"))
    return float(np.exp(error[1] + (error[1] - error[0]) / (n[1] - n[0]) * (np.log(cells) - n[1])))


def _reference(flow: Flow, cells: int) -> tuple[NDArray, NDArray]:
    """The velocity at the nodes at the start and at the end."""
    developed = min(cells, DEVELOPED) if flow.development else cells
    solver = SpectralSolver(
        developed, flow.viscosity, forcing=LinearForcing(power=POWER), time_step=0.64 / developed, threads=2
    )
    solver.set_velocity(flow.modes.on_lattice((developed,) * 3))
    solver.advance(round(flow.development / solver.time_step))
    start = at_points(solver.velocity, cells, 0.0)
    count = round(flow.end_time / (0.64 / cells))
    solver = SpectralSolver(
        cells, flow.viscosity, forcing=LinearForcing(power=POWER), time_step=flow.end_time / count, threads=2
    )
    solver.set_velocity(start)
    solver.advance(count)
    return start, solver.velocity


def resolved(u: NDArray, cells: int) -> NDArray:
    """A field (3, N, N, N) at nodes without the modes that `cells` in each direction cannot hold."""
    modes = np.fft.fftn(u, axes=(1, 2, 3))
    k = np.abs(np.fft.fftfreq(u.shape[1], 1 / u.shape[1]))
    keep = k < cells / 2
    return np.fft.ifftn(modes * (keep[:, None, None] & keep[:, None] & keep), axes=(1, 2, 3)).real


def at_points(u: NDArray, cells: int, offset: float) -> NDArray:
    """The Fourier series through the values (3, N, N, N) at nodes, at (i + offset)/cells of the box: exact."""
    n = u.shape[1]
    modes = np.fft.fftn(u, axes=(1, 2, 3)) * (cells / n) ** 3
    k = np.fft.fftfreq(n, 1 / n).astype(int)
    phase = np.exp(2j * np.pi * offset * k / cells)
    for axis in (1, 2, 3):  # modes that look the same at these points are added
        moved = np.moveaxis(modes, axis, -1) * phase
        folded = np.zeros((*moved.shape[:-1], cells), dtype=complex)
        for place in range(n):
            folded[..., k[place] % cells] += moved[..., place]
        modes = np.moveaxis(folded, -1, axis)
    return np.fft.ifftn(modes, axes=(1, 2, 3)).real


def _openfoam(
    path: Path, flow: Flow, solver: Solver, cells: int, count: int, begin: NDArray, taken: int
) -> tuple[NDArray | None, float]:
    """The velocity at the cell centres at the end, and the processor time of the steps [s]; without a velocity where
    fewer steps are taken than count."""
    preset = "default" if solver.application == "boxFoam" else solver.application
    original = new_case(path.with_name(f"{path.name}-case"), preset)
    entries: dict[str, dict] = {"system/controlDict": {"functions": {}}}
    if solver.application == "boxFoam":
        entries["system/fvSchemes"] = {"boxSchemes": {"differences": solver.differences}}
    scene_copy(
        original,
        path,
        cells=cells,
        steps=count,
        end_time=flow.end_time,
        viscosity=flow.viscosity,
        write_every=count,
        texts={"constant/fvOptions": FORCING},
        entries=entries,
    )
    if solver.stock:
        solver.stock.write(path)
    make_mesh(path)
    (path / "0").mkdir()
    (path / "0/p").write_bytes((path / "0.orig/p").read_bytes())
    write_velocity(path / "0.orig/U", path / "0/U", begin)
    if taken < count:
        set_entries(path / "system/controlDict", {"endTime": flow.end_time * (taken + 0.5) / count})
        return None, _seconds_a_step(solver.application, path) * count
    seconds = _seconds_a_step(solver.application, path)
    end = read_velocity(path, f"{flow.end_time:g}", (cells,) * 3)
    more = WORK // cells**3  # too few steps for a clock of hundredths of a second: it goes on
    if solver.application == "boxFoam" and more > count:
        more_time = flow.end_time * (1 + (more + 0.5) / count)
        control = {"endTime": more_time, "writeInterval": 2 * (more + count)}
        set_entries(path / "system/controlDict", control)
        seconds = _seconds_a_step(solver.application, path)
    return end, seconds * count


def _seconds_a_step(application: str, path: Path) -> float:
    """Processor time of a run's steps but the first [s]."""
    argv = command(application, path)
    done = subprocess.run(argv, env=environment(), capture_output=True, text=True)
    if done.returncode:
        raise RunError(f"{application} failed:\n{done.stdout[-2000:]}{done.stderr[-2000:]}")
    times = [float(t) for t in re.findall(r"^ExecutionTime = (\S+) s", done.stdout, re.MULTILINE)]
    return (times[-1] - times[0]) / (len(times) - 1)


def _spectral(flow: Flow, cells: int, count: int, begin: NDArray) -> tuple[NDArray, float]:
    solver = SpectralSolver(
        cells, flow.viscosity, forcing=LinearForcing(power=POWER), time_step=flow.end_time / count
    )
    solver.set_velocity(begin)
    solver.advance()  # plans and compiles
    solver.set_velocity(begin)
    solver.advance(count)
    end, more = solver.velocity, max(count, WORK // cells**3)
    started = time.process_time()
    solver.advance(more)
    return end, (time.process_time() - started) * count / more


def over_box(row: dict, rows: list[dict]) -> tuple[float, bool]:
    """Cost over that of boxFoam at the same error, and whether it is a lower bound; nan beyond its finest mesh."""
    box = sorted(
        ((r["velocity_error"], r["processor_seconds"]) for r in rows if r["solver"] == "boxFoam"),
        reverse=True,
    )
    if not box or row["velocity_error"] < box[-1][0]:
        return float("nan"), False
    errors, costs = np.log(np.array(box)).T
    cost = np.interp(np.log(row["velocity_error"]), errors[::-1], costs[::-1])
    return float(row["processor_seconds"] / np.exp(cost)), bool(row["velocity_error"] > box[0][0])


def rows(result: dict) -> list[dict]:
    """The lines of a CSV file."""
    return result["rows"]


def table(result: dict) -> str:
    """The result of `run` as text."""
    lines = [
        f"{'flow':10} {'solver':18} {'cells':>5} {'step [s]':>9} {'error':>10} {'CPU [s]':>9} {'ms a step':>10}"
        f" {'over boxFoam, equal error':>26}"
    ]
    for row in result["rows"]:
        ratio = "" if np.isnan(row["over_box"]) else f"{'> ' if row['at_least'] else ''}{row['over_box']:.1f}"
        about = "~" if row["extrapolated"] else " "
        lines.append(
            f"{row['flow']:10} {row['solver']:18} {row['cells']:5d} {row['time_step']:9.4f}"
            f" {about}{row['velocity_error']:9.2e} {row['processor_seconds']:9.3f}"
            f" {1e3 * row['step_seconds']:10.1f} {ratio:>26}"
        )
    return "\n".join(lines)


def draw(result: dict) -> Figure:
    """Error against processor time, a panel for each flow."""
    flows = list(dict.fromkeys(row["flow"] for row in result["rows"]))
    names = list(dict.fromkeys(row["solver"] for row in result["rows"]))
    figure = new_figure(8.8, 3.9)
    for axes, flow in zip(np.atleast_1d(figure.subplots(1, len(flows))), flows, strict=True):
        for name in names:
            ours = [r for r in result["rows"] if (r["flow"], r["solver"]) == (flow, name)]
            x, y = ([r[key] for r in ours] for key in ("processor_seconds", "velocity_error"))
            axes.loglog(x, y, "o-", color=COLOURS[names.index(name)], markersize=4, label=name)
        axes.set(xlabel="processor time [s]", title=flow)
    figure.axes[0].set_ylabel("error of the velocity")
    figure.axes[0].legend(fontsize=8)
    return figure
