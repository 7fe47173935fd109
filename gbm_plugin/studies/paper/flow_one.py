"""Stationary turbulence of the spectral solver in long runs that continue: Flow I of the paper, linear forcing.

Keeps OUT.csv (time series), OUT_spectrum.csv (time-averaged E(k), from `settle` on) and OUT.npz (checkpoint, from
which the same command continues). SIGINT and SIGTERM stop cleanly after the running step.
"""

from __future__ import annotations

import argparse
import signal
import time
from pathlib import Path

import numpy as np

from ...spectral import LinearForcing, SpectralSolver
from ...spectral.presets import PRESETS
from ...statistics.series import TimeSeries
from ..study import option, steps

SAVE_EVERY = 30.0  # seconds between checkpoints


def build(
    flow: str, cells: int | None, time_step: float | None, viscosity: float, power: float
) -> SpectralSolver:
    if flow == "linear":
        if cells is None or time_step is None:
            raise ValueError("the flow 'linear' needs --cells and --time-step")
        solver = SpectralSolver(cells, viscosity, forcing=LinearForcing(power=power), time_step=time_step)
        solver.set_velocity(random_velocity(cells, rms=0.5))
        return solver
    preset = PRESETS[flow]
    return preset.solver(cells=cells or preset.cells, time_step=time_step or preset.time_step)


def random_velocity(cells: int, rms: float) -> np.ndarray:
    """A start from a few random large waves, (3, n, n, n)."""
    x = 2 * np.pi * np.arange(cells) / cells
    grid = np.stack(np.meshgrid(x, x, x, indexing="ij"))
    rng = np.random.default_rng(0)
    u = np.zeros_like(grid)
    for _ in range(20):
        k = rng.integers(-3, 4, 3)
        u += rng.normal(size=3)[:, None, None, None] * np.cos(
            np.tensordot(k, grid, 1) + rng.uniform(0, 2 * np.pi)
        )
    return rms * u / u.std()


def refine(solver: SpectralSolver, checkpoint: Path) -> None:
    """Start from the checkpoint of a coarser run: its modes, with the force in its present state."""
    with np.load(checkpoint) as stored:
        coarse = dict(stored)
    count = coarse["coefficients"].shape[-1] - 1
    signed = np.concatenate([np.arange(count + 1), np.arange(-count, 0)])
    u = solver.operators.zeros()
    u[np.ix_(range(3), signed, signed, range(count + 1))] = coarse["coefficients"]
    solver.set_velocity(solver.operators.to_physical(u))
    names = [name for name in coarse if name.startswith("forcing_")]
    solver.forcing.restore({name.removeprefix("forcing_"): coarse[name] for name in names})


class Record:
    """A solver with its recorded series and mean spectrum, in three files."""

    def __init__(self, solver: SpectralSolver, out: Path, settle: float, start: Path | None):
        self.solver, self.out, self.settle = solver, out, settle
        self.series, self.spectrum, self.samples = TimeSeries(), 0.0, 0
        if self.checkpoint.exists():
            with np.load(self.checkpoint) as stored:
                state = dict(stored)
            self.spectrum, self.samples = state.pop("mean_spectrum"), int(state.pop("samples"))
            solver.restore(state)
            self.series = TimeSeries.read(self.out.with_suffix(".csv")).until(solver.time + 1e-9)
        elif start:
            refine(solver, start)

    @property
    def checkpoint(self) -> Path:
        return self.out.with_suffix(".npz")

    def record(self) -> None:
        self.series.record(self.solver.time, self.solver.statistics())
        if self.solver.time >= self.settle:
            self.samples += 1
            self.spectrum = self.spectrum + (self.solver.spectrum()[1] - self.spectrum) / self.samples

    def save(self) -> None:
        self.series.write(self.out.with_suffix(".csv"))
        if self.samples:
            table = np.column_stack([self.solver.spectrum()[0], self.spectrum])
            name = self.out.with_name(self.out.name + "_spectrum.csv")
            np.savetxt(name, table, delimiter=",", header="k,E", comments="", fmt="%.8g")
        partial = self.out.with_name(self.out.name + ".partial.npz")
        extra = {"mean_spectrum": self.spectrum, "samples": float(self.samples)}
        np.savez(partial, **self.solver.state(), **extra)
        partial.replace(self.checkpoint)


def add_arguments(parser: argparse.ArgumentParser) -> None:
    option(parser, run, "flow", "preset, or linear forcing", choices=[*PRESETS, "linear"])
    option(parser, run, "out", "files, without their suffix", type=Path)
    option(parser, run, "end", "time of the flow [s]")
    option(parser, run, "cells", "nodes per edge (default: the preset's)", type=int)
    option(parser, run, "every", "steps between samples")
    option(parser, run, "settle", "start of the averages [s]")
    option(parser, run, "time_step", "[s] (default: the preset's)", type=float)
    option(parser, run, "viscosity", "of linear forcing [m2/s]")
    option(parser, run, "power", "of linear forcing [m2/s3]")
    option(parser, run, "start", "checkpoint of a coarser run to start from", type=Path)


def run(
    flow: str = "flow_I",
    out: Path = Path("flow_I"),
    end: float = 2000.0,
    cells: int | None = None,
    every: int = 25,
    settle: float = 150.0,
    time_step: float | None = None,
    viscosity: float = 0.02,
    power: float = 0.1,
    start: Path | None = None,
) -> dict:
    """Run to `end`, or on from the checkpoint, and average from `settle` on."""
    stopped: list[int] = []
    handlers = {n: signal.signal(n, lambda *_: stopped.append(1)) for n in (signal.SIGINT, signal.SIGTERM)}
    record = Record(build(flow, cells, time_step, viscosity, power), out, settle, start)
    solver, saved = record.solver, time.monotonic()
    todo = max(0, round((end - solver.time) / (every * solver.time_step)))
    try:
        for _ in steps(range(todo), todo, flow):
            solver.advance(every)
            record.record()
            if stopped:
                break
            if time.monotonic() - saved > SAVE_EVERY:
                record.save()
                saved = time.monotonic()
    finally:
        record.save()
        for number, handler in handlers.items():
            signal.signal(number, handler)
    return {"flow": flow, "cells": solver.cells, "rows": means(record.series, settle)}


def means(series: TimeSeries, settle: float) -> list[dict]:
    """Mean and standard error of every column from `settle` on; no error where the series is too short for one."""
    if not len(series):
        return []
    late, result = series["time"] >= settle, []
    for name in (n for n in series.columns if n != "time"):
        try:
            error = series.mean(name, settle).error
        except ValueError:
            error = None
        mean = float(series[name][late].mean()) if late.any() else None
        result.append({"quantity": name, "mean": mean, "standard_error": error})
    return result


def rows(result: dict) -> list[dict]:
    """The lines of a CSV file."""
    return result["rows"]


def table(result: dict) -> str:
    """The averages as text."""
    lines = [f"{result['flow']} at {result['cells']}^3"]
    for r in result["rows"]:
        mean = "nothing yet" if r["mean"] is None else f"{r['mean']:12.5g}"
        error = "too short for an error" if r["standard_error"] is None else f"± {r['standard_error']:.2g}"
        lines.append(f"    {r['quantity']:24} {mean} {error}")
    return "\n".join(lines)
