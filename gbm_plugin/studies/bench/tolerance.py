"""What the tolerance of simulate promises: global error against it, in five flows and for five time steps.

The tolerance holds what one step adds, in bead displacement over fiber length (a tenth of it); the error at the end is
what all steps added, carried along by the flow, which in a chaotic one parts neighbours like e^(λt).
"""

from __future__ import annotations

import argparse

import numpy as np

from ...fiber import Fibers, simulate
from ...flow import ABC, LinearFlow, TaylorGreen, from_function
from ...spectral import SpectralSolver
from ..study import option, steps

STEPS = (0.01, 0.05, 0.2, 0.5, 2.0)
TOLERANCES = (1e-3, 1e-4, 1e-5)
REFERENCE = 1e-7
END = 2.0


def _waves(x, t):
    """Unsteady, three-dimensional, without divergence."""
    u = np.sin(x[..., 1] + t) + 0.3 * np.cos(2 * x[..., 2] - t)
    return np.stack([u, np.cos(x[..., 2] + 2 * t), np.sin(x[..., 0] - t)], axis=-1)


def _decaying(time_step: float = 0.01) -> SpectralSolver:
    """A decaying field that the solver knows at its own steps only."""
    solver = SpectralSolver(16, 0.05, time_step=time_step, interpolation="exact")
    x = np.moveaxis(np.indices((16, 16, 16)), 0, -1) * 2 * np.pi / 16
    solver.set_velocity(np.moveaxis(_waves(x, 0.0) + ABC(0.5, 0.4, 0.3).sample(x, 0, "velocity")[0], -1, 0))
    return solver


FLOWS = {
    "shear": lambda: LinearFlow([[0, 1, 0], [0, 0, 0], [0, 0, 0]]),
    "Taylor-Green": lambda: TaylorGreen(np.pi, 1.0),
    "fast ABC": lambda: ABC(5, 4, 3),
    "unsteady waves": lambda: from_function(_waves),
    "decaying, in the solver": _decaying,
}


def add_arguments(parser: argparse.ArgumentParser) -> None:
    option(parser, run, "fibers", "how many")
    option(parser, run, "beads", "of each")


def run(fibers: int = 20, beads: int = 16) -> dict:
    """Errors at the end of the runs of all flows, steps and tolerances."""
    family = Fibers.straight(fibers, beads, 1.5, 1e-2, 0.02, box=6.28, seed=3)
    found = []
    for name in steps(FLOWS, len(FLOWS), "flows"):
        # shorter steps of the solver would change the flow itself: its reference has the same, sampled at all
        exact = simulate(family, FLOWS[name](), 0.01, END, tolerance=REFERENCE if name[:3] != "dec" else 1e-5)
        for step in STEPS:
            for tolerance in TOLERANCES:
                found.append({"flow": name, "time_step": step, "tolerance": tolerance} | _error(
                    family, FLOWS[name](), step, tolerance, exact.positions[-1]
                ))  # fmt: skip
    return {"rows": found}


def _error(family: Fibers, flow, step: float, tolerance: float, exact) -> dict:
    try:
        path = simulate(family, flow, step, END, tolerance=tolerance)
    except ValueError as error:
        return {"refused": str(error)}
    apart = np.sqrt(((path.positions[-1] - exact) ** 2).sum(axis=2).mean(axis=1)) / family.contour_length
    kept = ("samples", "redone", "flow_error")
    return {"error": float(apart.max()), "median": float(np.median(apart))} | {
        k: path.report[k] for k in kept
    }


def rows(result: dict) -> list[dict]:
    """The lines of a CSV file."""
    return result["rows"]


def table(result: dict) -> str:
    """Largest error over the fibers, rms over their beads, over length; a row a flow and step."""
    lines = [
        f"{'flow':24s} {'step':>5s} " + " ".join(f"{f'tol {t:g}':>9s} {'samples':>7s}" for t in TOLERANCES)
    ]
    for name in FLOWS:
        for step in STEPS:
            own = [r for r in result["rows"] if r["flow"] == name and r["time_step"] == step]
            cells = [
                f"{'refused':>9s} {'':7s}" if "refused" in r else f"{r['error']:9.1e} {r['samples']:7d}"
                for r in own
            ]
            lines.append(f"{name:24s} {step:5g} " + " ".join(cells))
    return "\n".join(lines)
