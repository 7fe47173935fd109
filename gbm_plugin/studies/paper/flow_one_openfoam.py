"""Flow I of the paper in OpenFOAM: boxFoam under the same force, from a developed field of the spectral solver.

A long run that continues. Keeps the case in FOLDER, and OUT.csv (time series) and OUT_spectrum.csv (time-averaged E(k),
from `settle` on), which `gbm study flows` reads as it reads those of `gbm study flow-one`. SIGINT and SIGTERM leave
what the case has written, from which the same command continues.
"""

from __future__ import annotations

import argparse
import os
import shutil
import signal
import subprocess
import time
from pathlib import Path

import numpy as np

from ...case.copies import copy_case
from ...case.edit import set_entries
from ...case.initial import write_velocity
from ...case.layout import log_file, numbered, processors
from ...case.openfoam import command, environment, fatal_message, utility
from ...errors import RunError
from ...output.field import read_velocity
from ...output.tables import read_forcing
from ...spectral import SpectralSolver
from ...spectral.presets import PRESETS, Preset
from ...statistics.series import TimeSeries
from ...statistics.turbulence import energy_spectrum, field_statistics
from ..study import option
from . import flow_one

BOX = 2 * np.pi
FORCE = "eswaranPope"
TABLE = {"energy_budget": "epsilonBudget", "laplacian_dissipation": "epsilonLaplacian", "power": "power"}


def add_arguments(parser: argparse.ArgumentParser) -> None:
    option(parser, run, "case", "case whose dictionaries are taken")
    option(parser, run, "flow", "preset", choices=list(PRESETS))
    option(parser, run, "folder", "of the case that is made", type=Path)
    option(parser, run, "out", "files, without their suffix", type=Path)
    option(parser, run, "start", "checkpoint of a run of gbm study flow-one to start from", type=Path)
    option(parser, run, "end", "time of the flow after the start [s]")
    option(parser, run, "cells", "per edge (default: the preset's)", type=int)
    option(parser, run, "time_step", "[s] (default: the preset's)", type=float)
    option(parser, run, "every", "time between samples of the field [s]")
    option(parser, run, "settle", "start of the averages [s]")
    option(parser, run, "ranks", "MPI ranks")


def run(
    case: Path,
    flow: str = "flow_I",
    folder: Path = Path("flow_I_openfoam"),
    out: Path = Path("openfoam_flow_I"),
    start: Path | None = None,
    end: float = 200.0,
    cells: int | None = None,
    time_step: float | None = None,
    every: float = 2.0,
    settle: float = 10.0,
    ranks: int = 1,
) -> dict:
    """Run to `end`, or on from what is written, and average from `settle` on. ValueError where a new run has no
    checkpoint to start from, RunError where boxFoam fails."""
    preset = PRESETS[flow]
    cells, time_step = cells or preset.cells, time_step or preset.time_step
    times = {"deltaT": time_step, "endTime": end, "writeInterval": round(every / time_step)}
    if not folder.exists():
        if start is None:
            raise ValueError(f"{folder} is not there yet: a new run needs --start")
        _make(case, folder, preset, cells, times, start, ranks)
    set_entries(folder / "system/controlDict", {"endTime": end})
    samples = _Samples(folder, out, cells, preset.viscosity)
    _solve(folder, ranks, samples)
    samples.write_spectrum(settle)
    return {"flow": flow, "cells": cells, "rows": flow_one.means(samples.series, settle)}


def _make(case: Path, folder: Path, preset: Preset, cells: int, times: dict, start: Path, ranks: int) -> None:
    control = {"application": "boxFoam", "writeControl": "timeStep", "purgeWrite": 0, "functions": {}}
    force = f"variance {preset.variance!r}; timeScale {preset.time_scale!r}; cutoff {preset.cutoff!r}"
    copy_case(
        case,
        folder,
        {
            "system/controlDict": times | control,
            "system/blockMeshDict": {"n": cells},
            "system/decomposeParDict": {"numberOfSubdomains": ranks, "simpleCoeffs": {"n": f"(1 1 {ranks})"}},
            "constant/transportProperties": {"nu": preset.viscosity},
        },
        {"constant/fvOptions": f"{FORCE} {{ type {FORCE}; {force}; seed {preset.seed}; }}\n"},
    )
    solver = preset.solver(cells=cells, time_step=times["deltaT"])
    flow_one.refine(solver, start)
    utility(folder, "blockMesh")
    for name in ("U", "p"):
        (folder / "0").mkdir(exist_ok=True)
        (folder / "0" / name).write_bytes((folder / "0.orig" / name).read_bytes())
    write_velocity(folder / "0.orig/U", folder / "0/U", solver.shifted_velocity(0.5))
    if ranks > 1:
        utility(folder, "decomposePar", "-force")
    _write_force((processors(folder) or [folder])[0] / "0/uniform" / FORCE, solver)


def _write_force(path: Path, solver: SpectralSolver) -> None:
    """The present force as eswaranPope keeps it, for one realisation that goes on."""
    state, energetics = solver.forcing.state(), solver.energetics()
    entries = {
        "k": energetics["kinetic_energy"],
        "power": energetics["power"],
        "deltaT": solver.time_step,
        "draws": int(state["draws"]),
    }
    lines = [f"{name} {value!r};" for name, value in entries.items()]
    for name, part in (("re", state["amplitudes"].real), ("im", state["amplitudes"].imag)):
        vectors = "\n".join(f"({' '.join(map(repr, v))})" for v in part.tolist())
        lines.append(f"{name}\n{len(part)}\n(\n{vectors}\n);")
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text("\n".join(lines) + "\n")


class _Samples:
    """The series of a run's written fields; of those only the latest are kept, for a restart."""

    def __init__(self, folder: Path, out: Path, cells: int, viscosity: float):
        self.folder, self.out, self.cells, self.viscosity = folder, out, cells, viscosity
        self.series, self.spectra = TimeSeries(), {}
        if self.out.with_suffix(".csv").exists():
            self.series = TimeSeries.read(self.out.with_suffix(".csv"))
            with np.load(self.out.with_suffix(".npz")) as stored:
                self.spectra = {float(t): e for t, e in zip(stored["time"], stored["spectra"], strict=True)}

    def take(self, ended: bool) -> None:
        """Sample the fields that are whole: all but the newest, until the solver has ended."""
        times = numbered(self._parts()[0])
        known = self.series["time"][-1] if len(self.series) else 0.0
        whole = [(t, path.name) for t, path in times.items()]
        whole = whole if ended else whole[:-1]
        new = [(t, name) for t, name in whole if t > known + 1e-9]
        if not new:
            return
        table = read_forcing(self.folder)
        for t, name in new:
            row = int(np.argmin(np.abs(table["Time"] - t)))
            u = read_velocity(self.folder, name, (self.cells,) * 3)
            values = field_statistics(u, (BOX,) * 3, self.viscosity)
            self.series.record(t, values | {key: table[column][row] for key, column in TABLE.items()})
            self.spectra[t] = energy_spectrum(u, (BOX,) * 3)[1]
        self.series.write(self.out.with_suffix(".csv"))
        np.savez(
            self.out.with_suffix(".npz"),
            time=list(self.spectra),
            spectra=np.array(list(self.spectra.values())),
        )

        for _, name in whole[:-1]:
            for part in self._parts():
                shutil.rmtree(part / name, ignore_errors=True)

    def _parts(self) -> list[Path]:
        """The folders that have the times."""
        return processors(self.folder) or [self.folder]

    def write_spectrum(self, settle: float) -> None:
        """The average of E(k)."""
        late = [e for t, e in self.spectra.items() if t >= settle]
        if late:
            k = np.arange(len(late[0])) * 2 * np.pi / BOX
            name = self.out.with_name(self.out.name + "_spectrum.csv")
            table = np.column_stack([k, np.mean(late, axis=0)])
            np.savetxt(name, table, delimiter=",", header="k,E", comments="", fmt="%.8g")


def _solve(folder: Path, ranks: int, samples: _Samples) -> None:
    """boxFoam to the end of its case, its fields sampled as they are written."""
    stopped: list[int] = []
    handlers = {n: signal.signal(n, lambda *_: stopped.append(1)) for n in (signal.SIGINT, signal.SIGTERM)}
    log = log_file(folder, "boxFoam")
    with log.open("a") as output:
        solver = subprocess.Popen(
            command("boxFoam", folder, ranks),
            env=environment(),
            stdout=output,
            stderr=subprocess.STDOUT,
            start_new_session=True,
        )
    try:
        while solver.poll() is None and not stopped:
            time.sleep(2)
            samples.take(ended=False)
    finally:
        if solver.poll() is None:
            os.killpg(solver.pid, signal.SIGTERM)
            solver.wait()
        for number, handler in handlers.items():
            signal.signal(number, handler)
    if stopped:
        raise RunError("stopped on request: the same command continues from what is written")
    samples.take(ended=True)
    if solver.returncode:
        raise RunError(f"boxFoam: {fatal_message(log) or f'exit code {solver.returncode}'} ({log})")


def rows(result: dict) -> list[dict]:
    """The lines of a CSV file."""
    return flow_one.rows(result)


def table(result: dict) -> str:
    """The averages as text."""
    return flow_one.table(result)
