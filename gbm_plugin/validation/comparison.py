"""What the studies share: the case that both engines run, and how far apart their results are.

The same random initial modes |m| <= 3, linear forcing of constant power, three families of fibers. The spectral
solver resolves these modes exactly and samples them exactly.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ..case.copies import HEADER, copy_case
from ..output.field import read_velocity
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


@dataclass(frozen=True)
class State:
    """Flow and fibers at the end of a run."""

    velocity: NDArray[np.float64]  # at the cell centres (3, n, n, n) [m/s]
    ends: Mapping[
        str, NDArray[np.float64]
    ]  # first and last bead by family (count, 2, 3), over the fiber length


def check_cells(cells: int) -> None:
    """ValueError for a number of cells that the two engines cannot both do."""
    if cells < 8 or cells % 2:
        raise ValueError(f"cells are {cells}; allowed: even numbers of at least 8")


def make(
    case: Path,
    copy: Path,
    cells: int,
    steps: int,
    seed: int = 1,
    changes: Mapping[str, Mapping[str, object] | str] | None = None,
) -> None:
    """A copy of `case` with its schemes and solvers but the studies' flow and fibers.

    cells: in each direction. steps: to END_TIME.
    changes, on top: {dictionary: {entry: value}} in place, {dictionary: text} as a whole.
    """
    every = {
        "system/controlDict": {
            "deltaT": END_TIME / steps,
            "endTime": END_TIME,
            "writeControl": "timeStep",
            "writeInterval": steps,
        },
        "system/blockMeshDict": {"n": cells},
        "constant/transportProperties": {"nu": VISCOSITY},
    }
    texts = {
        "system/initialFieldDict": FLOW.format(seed=seed),
        "constant/fvOptions": FORCING,
    }
    for name, change in (changes or {}).items():
        (texts if isinstance(change, str) else every)[name] = change
    copy_case(case, copy, every, texts)


def run(copy: Path, cells: int, steps: int, engine: str, interpolation: str | None = None) -> State:
    """Run a copy from `make` in "openfoam" or "spectral". interpolation: of the flow at the beads; default: trilinear,
    and exact in the spectral solver. Raises as `gbm_plugin.run.run`."""
    spectral = engine == "spectral"
    words = FIBERS.format(steps=steps, interpolation=interpolation or ("exact" if spectral else "trilinear"))
    (copy / "constant/fiberProperties").write_text(HEADER + words)
    (run_spectral if spectral else run_openfoam)(copy)
    folder = copy / "spectral" if spectral else copy
    velocity = read_velocity(folder, f"{END_TIME:g}", (cells,) * 3)
    with open_recording(folder / "postProcessing/fibers") as recording:
        ends = {
            name: family.positions[-1][:, [0, -1]] / (2 * family.radius * family.beads)
            for name, family in recording.families.items()
        }
    return State(velocity, ends)


def velocity_distance(a: State, b: State) -> float:
    """Rms difference of the velocities over the rms of `b`'s."""
    return _rms(a.velocity - b.velocity) / _rms(b.velocity)


def fiber_distance(a: State, b: State) -> dict[str, float]:
    """Rms distance of the end beads over the fiber length, by family."""
    return {name: _rms(np.moveaxis(x - b.ends[name], -1, 0)) for name, x in a.ends.items()}


def _rms(u: NDArray[np.float64]) -> float:
    """Of vectors along the first axis."""
    return float(np.sqrt(np.mean(np.sum(u**2, axis=0))))
