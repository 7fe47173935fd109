"""An ABC flow held in OpenFOAM, and fibers whose paths in it are known.

linearForcing with A = νk² balances the viscosity of this Beltrami flow exactly; of the two modes it is the one
that needs no adaptation to the mesh, where the Laplacian is weaker by (kh)²/12 (constantPower would let the
energy grow by that much). So the coupled run converges to fibers in the analytic flow: in the cells at second
order, in the step at that of the flow solver, which is lower than the third of the coupling's extrapolation.
ν keeps the Reynolds number 1/ν below 13, where the flow with A = B = C loses its stability (Galanti, Sulem &
Pouquet, Geophys. Astrophys. Fluid Dyn. 66, 183, 1992).
"""

from __future__ import annotations

import argparse
import itertools
import tempfile
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure
from numpy.typing import NDArray

from ...case.layout import results
from ...fiber import Fibers, Stepper, simulate
from ...flow import ABC
from ...output.field import read_velocity
from ...output.recording import open_recording
from ...run.openfoam import run as run_openfoam
from ..figures import orders_figure
from ..scenes import checked_cells, checked_step, ends_apart, observed_orders, order_lines, rms, scene_copy
from ..study import option
from .comparison import sampling_word

AMPLITUDES = (1.0, 0.8, 0.6)
FLOW = """field ABC; A {}; B {}; C {};
""".format(*AMPLITUDES)
FORCING = """linearForcing {{ type linearForcing; mode constantCoefficient; A {viscosity}; }}
"""
FIBERS = """recordInterval {steps};
integrator implicit;
tolerance 1e-7;
interpolation {interpolation};
families
{{
    stiff {{ count 40; beads 16; length 1.5; bendingStiffness 0.1; seed 1; }}
    medium {{ count 40; beads 16; length 1.5; bendingStiffness 1e-2; seed 2; }}
    soft {{ count 40; beads 16; length 1.5; bendingStiffness 1e-3; seed 3; }}
}}
"""
VISCOSITY = 0.2
END_TIME = 2.4  # fibers turn and bend through more than a radian
REFERENCE = {"time_step": 0.02, "tolerance": 1e-8}  # of `simulate`: ab3 agrees with it to 4e-6 of the length


def add_arguments(parser: argparse.ArgumentParser) -> None:
    option(parser, run, "case", "OpenFOAM case whose schemes are judged (default: this folder)")
    option(parser, run, "cells", "in each direction, one mesh after the other")
    option(parser, run, "time_step", "of all meshes, and the shortest in time [s]")
    option(parser, run, "halvings", "of the longest step")


def run(
    case: Path | str, cells: Sequence[int] = (16, 24, 32, 48), time_step: float = 0.0125, halvings: int = 3
) -> dict:
    """Errors in the cells and in the step. time_step: of all meshes [s], and the shortest in time, where the
    last mesh but one is run with 2 ... 2^halvings times it as well.

    Rows of cells: velocity, the rms difference from the ABC flow at the cell centres at the end over its rms;
    for each family, the rms difference of the end beads from `simulate` in the ABC flow over the length.
    Rows of steps: the same differences between the run and that of half the step; "extrapolation", the error
    of the fibers where the coupling's sequence of samples is taken from the ABC flow itself.
    Raises as `gbm_plugin.run.openfoam.run`.
    """
    checked_cells(cells)
    checked_step(time_step, END_TIME / 4 / 2**halvings)
    if len(cells) < 2:
        raise ValueError("two meshes at least are needed for an order")
    steps = round(END_TIME / time_step)
    if steps % 2**halvings:
        raise ValueError(f"{END_TIME:g} s are {steps} steps, which cannot be doubled {halvings} times")
    with tempfile.TemporaryDirectory(prefix="gbm-validate-") as folder:
        by_cells = {n: _solve(case, Path(folder), n, steps) for n in cells}
        middle = cells[-2]
        by_step = [_solve(case, Path(folder), middle, steps // 2**i) for i in range(halvings, 0, -1)]
    by_step.append(by_cells[middle])
    start = by_step[-1].start
    reference = {
        name: simulate(fibers, ABC(*AMPLITUDES), end_time=END_TIME, **REFERENCE).positions[-1]
        for name, fibers in start.items()
    }
    rows = [
        {"against": "ABC flow", "cells": n, "time_step": END_TIME / steps}
        | _errors(found, _exact(n), reference)
        for n, found in by_cells.items()
    ]
    temporal = [
        {"against": "half the step", "cells": middle, "time_step": coarse.time_step}
        | _errors(coarse, fine.velocity, fine.end)
        | {"extrapolation_error": _extrapolation(start, reference, coarse.time_step)}
        for coarse, fine in itertools.pairwise(by_step)
    ]
    return {
        "end_time": END_TIME,
        "viscosity": VISCOSITY,
        "rows": rows,
        "orders": observed_orders(rows),
        "temporal_rows": temporal,
        "temporal_orders": observed_orders(temporal, by="time_step"),
    }


@dataclass(frozen=True)
class _Run:
    """What is kept of a run: velocity (3, n, n, n) at the end, fibers at the start, end positions (F, N, 3)
    by family."""

    time_step: float
    velocity: NDArray
    start: dict[str, Fibers]
    end: dict[str, NDArray]


def _solve(case: Path | str, folder: Path, cells: int, steps: int) -> _Run:
    copy = scene_copy(
        case,
        folder / f"{cells}_{steps}",
        cells=cells,
        steps=steps,
        end_time=END_TIME,
        viscosity=VISCOSITY,
        write_every=steps,
        texts={
            "system/initialFieldDict": FLOW,
            "constant/fvOptions": FORCING.format(viscosity=VISCOSITY),
            "constant/fiberProperties": FIBERS.format(steps=steps, interpolation=sampling_word(case)),
        },
    )
    run_openfoam(copy)
    velocity = read_velocity(copy, f"{END_TIME:g}", (cells, cells, cells))
    with open_recording(results(copy)) as recording:
        viscosity = recording.metadata["dynamic_viscosity"]
        families = recording.families.items()
        start = {name: Fibers(f.positions[0], f.bending_stiffness, viscosity) for name, f in families}
        end = {name: f.positions[-1] for name, f in families}
    return _Run(END_TIME / steps, velocity, start, end)


def _exact(cells: int) -> NDArray:
    """The ABC flow at the cell centres, (3, n, n, n)."""
    centres = 2 * np.pi * (np.arange(cells) + 0.5) / cells
    positions = np.stack(np.meshgrid(centres, centres, centres, indexing="ij"), axis=-1)
    return np.moveaxis(ABC(*AMPLITUDES).sample(positions, 0.0, "velocity")[0], -1, 0)


def _errors(found: _Run, velocity: NDArray, end: dict[str, NDArray]) -> dict[str, float]:
    errors = {"velocity_error": rms(found.velocity - velocity) / rms(velocity)}
    for name, positions in found.end.items():
        errors[f"{name}_error"] = ends_apart(positions, end[name], found.start[name].radius)
    return errors


def _extrapolation(start: dict[str, Fibers], reference: dict[str, NDArray], time_step: float) -> float:
    """Error of the first family when each step knows the flow as a coupled run does: from before the step."""
    name, fibers = next(iter(start.items()))
    stepper, flow = Stepper(fibers, integrator="implicit", tolerance=1e-7), ABC(*AMPLITUDES)

    def observe() -> None:
        stepper.observe(stepper.time, *flow.sample(stepper.positions, stepper.time, stepper.need))

    observe()
    for _ in range(round(END_TIME / time_step)):
        stepper.advance(time_step)
        while stepper.provisional:
            observe()
            stepper.correct()
        observe()
    return ends_apart(stepper.positions, reference[name], fibers.radius)


def rows(result: dict) -> list[dict]:
    """The lines of a CSV file."""
    return result["rows"] + result["temporal_rows"]


def table(result: dict) -> str:
    """The result of `run` as text."""
    parts = ["against the ABC flow and fibers in it"]
    parts += order_lines(result["rows"], result["orders"])
    parts += ["", "against the run with half the step"]
    parts += order_lines(result["temporal_rows"], result["temporal_orders"])
    return "\n".join(parts)


def draw(result: dict) -> Figure:
    """Errors against cells, differences against the step."""
    return orders_figure(result["rows"], result["temporal_rows"])
