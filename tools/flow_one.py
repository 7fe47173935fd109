"""Long runs of stationary turbulence with the spectral solver, kept as CSV files.

    python tools/flow_one.py flow_I --cells 64 --end 2000 --out docs/results/spectral_flow_I_64
    python tools/flow_one.py linear --cells 48 --end 400 --out docs/results/spectral_linear_48

writes OUT.csv (time series), OUT_spectrum.csv (time-averaged E(k), from --settle on) and OUT.npz (checkpoint,
from which the same command continues). SIGINT and SIGTERM stop cleanly after the running step.
"""

import argparse
import signal
import sys
import time
from pathlib import Path

import numpy as np

from gbm_plugin.spectral import LinearForcing, SpectralSolver
from gbm_plugin.spectral.presets import PRESETS
from gbm_plugin.statistics.series import TimeSeries

SAVE_EVERY = 30.0  # seconds between checkpoints


def build(args: argparse.Namespace) -> SpectralSolver:
    if args.flow == "linear":
        force = LinearForcing(power=args.power)
        solver = SpectralSolver(args.cells, args.viscosity, forcing=force, time_step=args.time_step)
        solver.set_velocity(random_velocity(args.cells, rms=0.5))
        return solver
    preset = PRESETS[args.flow]
    changes = {"cells": args.cells or preset.cells, "time_step": args.time_step or preset.time_step}
    return preset.solver(**changes)


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


class Run:
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


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("flow", choices=[*PRESETS, "linear"])
    parser.add_argument("--cells", type=int, help="nodes per edge (default: the preset's)")
    parser.add_argument("--end", type=float, required=True, help="end time")
    parser.add_argument("--every", type=int, default=25, help="steps between samples (default 25)")
    parser.add_argument(
        "--settle", type=float, default=150.0, help="start of the mean spectrum (default 150)"
    )
    parser.add_argument("--time-step", type=float)
    parser.add_argument("--viscosity", type=float, default=0.02, help="linear only (default 0.02)")
    parser.add_argument("--power", type=float, default=0.1, help="linear only (default 0.1)")
    parser.add_argument("--start", type=Path, help="checkpoint of a coarser run to start from")
    parser.add_argument("--out", type=Path, required=True, help="files without their suffix")
    args = parser.parse_args()
    stopped = []
    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, lambda *_: stopped.append(True))
    run = Run(build(args), args.out, args.settle, args.start)
    start, first, saved = time.monotonic(), run.solver.time, time.monotonic()
    while run.solver.time < args.end - 1e-9 and not stopped:
        run.solver.advance(args.every)
        run.record()
        if time.monotonic() - saved > SAVE_EVERY:
            run.save()
            saved = time.monotonic()
            rate = (run.solver.time - first) / (saved - start)
            left = (args.end - run.solver.time) / rate / 60
            sys.stdout.write(f"t = {run.solver.time:.2f}, {left:.1f} min left\n")
            sys.stdout.flush()
    run.save()


if __name__ == "__main__":
    main()
