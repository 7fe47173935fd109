"""Both engines driven to the same stationary state for many turnovers.

Chaos parts the two flows within a few turnovers, so they are compared by averages with standard errors.
"""

from __future__ import annotations

import argparse
import json
import multiprocessing
import os
import tempfile
from collections.abc import Sequence
from concurrent.futures import ProcessPoolExecutor
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure

from ...run.openfoam import run as run_openfoam
from ...run.openfoam import run_spectral
from ..figures import stationary_figure
from ..scenes import checked_cells, checked_step, scene_copy, three_families
from ..study import option
from .averages import BLOCKS, Averages, averages, curve, density
from .comparison import application, sampling_word

FLOW = """field random; spectrum peaked; kineticEnergy 0.22; peakWavenumber 2; maxWavenumber 5; seed 1;
"""
FORCING = """linearForcing { type linearForcing; mode constantPower; power 0.05; }
"""
VISCOSITY = 0.02  # Kolmogorov length 0.112: 36 cells are 1.55 of it wide, 24 are 2.3
TURNOVER = 4.2  # about k/eps of this flow [s]; one field is written in each
SETTLING = 7  # turnovers that are left out
RECORDS = 7  # of the fibers in a turnover


BOX = 2 * np.pi
SAMPLING = {"spectral": "cubic", "spectral trilinear": "trilinear"}  # of the flow at the beads
BINS = 14  # of the mean curvature


def add_arguments(parser: argparse.ArgumentParser) -> None:
    option(parser, run, "case", "OpenFOAM case whose schemes are judged (default: this folder)")
    option(parser, run, "cells", "in each direction, of OpenFOAM")
    option(parser, run, "time_step", "of the first mesh, others in proportion [s]")
    option(parser, run, "reference_cells", "of the spectral solver")
    option(parser, run, "turnovers", "k/eps long each, after which averages end")
    text = "result of an earlier run (--json): its spectral run is the reference, the others stand beside"
    option(parser, run, "earlier", text, type=Path, metavar="FILE")


def run(
    case: Path | str,
    cells: Sequence[int] = (24, 36),
    time_step: float = 0.06,
    reference_cells: int = 48,
    turnovers: int = 100,
    earlier: Path | None = None,
) -> dict:
    """Averages of OpenFOAM with each number of cells, of the spectral solver with reference_cells, and, where the case
    samples the flow at the beads trilinearly, of a spectral flow on the most cells that is sampled so too, which tells
    an error of sampling from one of the flow.

    time_step: that of the first mesh [s]; others take it in proportion to their cells, the spectral solver two
    thirds of that, as its Adams-Bashforth scheme needs. earlier: the JSON of another such study, whose runs are taken
    and not made again, so that other solvers or meshes are set beside them. Two runs at a time where there are cores
    for it. Raises as `gbm_plugin.run.openfoam.run`, and ValueError where the runs are too short for a standard error.
    """
    checked_cells([*cells, reference_cells] if reference_cells not in cells else cells)
    checked_step(time_step, TURNOVER / RECORDS)
    if turnovers < 2 * BLOCKS:
        raise ValueError(f"turnovers are {turnovers}; {2 * BLOCKS} at least are needed for {BLOCKS} blocks")
    jobs = [("openfoam", n, time_step * cells[0] / n) for n in sorted(cells, reverse=True)]
    others = [("spectral", reference_cells)] if earlier is None else []
    if not earlier and sampling_word(case) == "trilinear":
        others.append(("spectral trilinear", max(cells)))
    jobs[1:1] = [(engine, n, 2 / 3 * time_step * cells[0] / n) for engine, n in others]
    workers = min(2, len(os.sched_getaffinity(0)))
    with (
        tempfile.TemporaryDirectory(prefix="gbm-validate-") as folder,
        ProcessPoolExecutor(workers, multiprocessing.get_context("spawn")) as pool,
    ):
        started = [pool.submit(solve, Path(case), Path(folder), *job, turnovers) for job in jobs]
        results = {job: future.result() for job, future in zip(jobs, started, strict=True)}
        return compare(results, turnovers, json.loads(earlier.read_text())["runs"] if earlier else [])


def compare(
    results: dict[tuple[str, int, float], Path], turnovers: int, earlier: Sequence[dict] = ()
) -> dict:
    """The result of `run`, from the folders of its runs by (engine, cells, time step) and `runs` of an earlier result;
    one run of both is spectral."""
    settled = (SETTLING + 1e-6) * TURNOVER
    found = {
        job: averages(folder, job[1], BOX, VISCOSITY, settled, _highest(*job[:2]))
        for job, folder in sorted(results.items())
    }
    reference = next((a for (engine, _, _), a in found.items() if engine == "spectral"), None)
    if reference:
        edges = {
            name: np.linspace(0, np.quantile(values, 0.998), BINS + 1)
            for name, values in reference.curvature.items()
        }
    else:
        known = next(run for run in earlier if run["engine"] == "spectral")["curvature"]
        edges = {name: np.array(curve["edges"]) for name, curve in known.items()}
    runs = [*earlier]
    for job, a in found.items():
        summary = _summary(*job, a, reference, edges)
        if job[0] == "openfoam":
            summary["engine"] = application(results[job])
        runs.append(summary)
    return {
        "turnover": TURNOVER,
        "turnovers": turnovers,
        "viscosity": VISCOSITY,
        "runs": runs,
        "rows": _rows(runs),
    }


def _highest(engine: str, cells: int) -> int:
    """The highest wave per box whose shell is whole: the spectral solver keeps |k_i| <= (n - 1)/3."""
    return cells // 2 - 1 if engine == "openfoam" else (cells - 1) // 3


def _summary(
    engine: str, cells: int, time_step: float, a: Averages, reference: Averages | None, edges: dict
) -> dict:
    spectrum = dict(zip(("mean", "error"), (c.tolist() for c in curve(a.spectra)), strict=True))
    summary = {
        "engine": engine,
        "cells": cells,
        "time_step": time_step,
        "numbers": a.numbers,
        "spectrum": {"k": a.k.tolist(), **spectrum},
        "curvature": {},
    }
    for name, values in a.curvature.items():
        mean, error = density(values, edges[name])
        summary["curvature"][name] = {
            "edges": edges[name].tolist(),
            "mean": mean.tolist(),
            "error": error.tolist(),
        }
    if engine == "openfoam" and reference:
        summary["mesh reads of spectral flow"] = reference.read_with(BOX / cells, BOX, VISCOSITY)
    return summary


def _rows(runs: list[dict]) -> list[dict]:
    """One row for each number and each shell of E(k): mean and standard error of every run, of pimpleFoam's two
    finest meshes extrapolated to cells of size zero at second order, and the deviation of each from the spectral
    run in standard errors of the difference."""
    values = {f"{run['engine']} {run['cells']}": _values(run) for run in runs}
    meshes = sorted(
        (run["cells"], values[f"pimpleFoam {run['cells']}"]) for run in runs if run["engine"] == "pimpleFoam"
    )
    if len(meshes) > 1:
        values["pimpleFoam, h to 0"] = _extrapolated(*meshes[-2:])
    reference = next(title for title in values if title.startswith("spectral "))
    names = [name for name in values[reference] if all(name in v for v in values.values())]
    rows = []
    for name in names:
        row = {"quantity": name}
        for title, v in values.items():
            (mean, error), (exact, chance) = v[name], values[reference][name]
            row[title], row[f"{title} error"] = mean, error
            if title != reference:
                row[f"{title} deviation"] = (mean - exact) / np.hypot(error, chance)
        rows.append(row)
    return rows


def _values(run: dict) -> dict[str, tuple[float, float]]:
    curve = run["spectrum"]
    shells = zip(curve["k"], curve["mean"], curve["error"], strict=True)
    return run["numbers"] | {f"E(k = {k:g})": (mean, error) for k, mean, error in shells}


def _extrapolated(coarse: tuple[int, dict], fine: tuple[int, dict]) -> dict[str, tuple[float, float]]:
    """From the values at (cells, {name: (mean, error)}) by Richardson: independent runs, errors of second order."""
    weight = 1 / ((fine[0] / coarse[0]) ** 2 - 1)
    found = {}
    for name in coarse[1].keys() & fine[1].keys():
        (far, far_error), (near, near_error) = coarse[1][name], fine[1][name]
        found[name] = (
            near + weight * (near - far),
            float(np.hypot((1 + weight) * near_error, weight * far_error)),
        )
    return found


def solve(
    case: Path, folder: Path, engine: str, cells: int, time_step: float, turnovers: int, fibers: int = 80
) -> Path:
    """One engine's run of the scene, with so many fibers in each family, in folder/<engine>_<cells>; returns the
    folder of its results."""
    record = round(TURNOVER / time_step / RECORDS)
    write = record * RECORDS
    count = SETTLING + turnovers
    word = SAMPLING.get(engine) or sampling_word(case)
    copy = scene_copy(
        case,
        folder / f"{engine}_{cells}".replace(" ", "_"),
        cells=cells,
        steps=count * write,
        end_time=count * TURNOVER,
        viscosity=VISCOSITY,
        write_every=write,
        texts={
            "system/initialFieldDict": FLOW,
            "constant/fvOptions": FORCING,
            "constant/fiberProperties": three_families(fibers, record, 1e-4, word),
        },
    )
    (run_openfoam if engine == "openfoam" else run_spectral)(copy)
    return copy if engine == "openfoam" else copy / "spectral"


def rows(result: dict) -> list[dict]:
    """The lines of a CSV file."""
    return result["rows"]


def table(result: dict) -> str:
    """The result of `run` as text. n: difference from the spectral run in standard errors of the difference."""
    runs, rows = result["runs"], result["rows"]
    reference = next(run for run in runs if run["engine"] == "spectral")
    titles = [name for name in rows[0] if f"{name} error" in rows[0]]
    deviating = [f"{title} deviation" in rows[0] for title in titles]
    heads = (f"{title:>24}" + "     n" * more for title, more in zip(titles, deviating, strict=True))
    lines = [" " * 28 + "".join(heads)]
    for row in rows:
        line = f"{row['quantity']:28}"
        for title in titles:
            line += f"{row[title]:12.5g} ± {row[f'{title} error']:9.2g}"
            deviation = row.get(f"{title} deviation")
            line += "" if deviation is None else f"{deviation:6.1f}"
        lines.append(line)
    for run in runs:
        if "mesh reads of spectral flow" in run:
            lines.append(f"what {run['cells']}³ cells read of the dissipation of the spectral flow:")
            reads = run["mesh reads of spectral flow"].items()
            lines += [f"    {name:24}{mean:12.5g} ± {error:9.2g}" for name, (mean, error) in reads]
    for run in runs:
        if run is not reference:
            scatter = {name: _scatter(run, reference, name) for name in run["curvature"]}
            lines.append(
                f"mean curvature of {run['engine']} {run['cells']}, rms deviation of a bin in standard errors: "
                + ", ".join(f"{name} {value:.2f}" for name, value in scatter.items())
            )
    return "\n".join(lines)


def _scatter(run: dict, reference: dict, name: str) -> float:
    """Rms over the bins of the difference over its standard error: 1 where only chance parts the two."""
    one, two = run["curvature"][name], reference["curvature"][name]
    difference = np.subtract(one["mean"], two["mean"])
    error = np.hypot(one["error"], two["error"])
    return float(np.sqrt(np.mean((difference[error > 0] / error[error > 0]) ** 2)))


def draw(result: dict) -> Figure:
    """E(k) and the densities of the mean curvature."""
    return stationary_figure(result["runs"])
