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

from ...case.copies import HEADER
from ...case.dictionary import Dictionary
from ...case.layout import results
from ...output.field import read_velocity
from ...output.recording import open_recording
from ...run.openfoam import run as run_openfoam
from ...run.openfoam import run_spectral
from ..scenes import rms, scene_copy, three_families

FLOW = """field random; spectrum table; table ((1 0.08) (2 0.12) (3 0.05)); seed {seed};
"""
FORCING = """linearForcing { type linearForcing; mode constantPower; power 0.05; }
"""
END_TIME = 1.2  # half a turnover: k/eps of this flow, at its start, is 2.5 s
VISCOSITY = 0.03  # Kolmogorov length 0.15: 24 cells are 1.8 of it wide


@dataclass(frozen=True)
class State:
    """Flow and fibers at the end of a run."""

    velocity: NDArray[np.float64]  # at the cell centres (3, n, n, n) [m/s]
    ends: Mapping[str, NDArray[np.float64]]  # end beads by family (count, 2, 3), over the fiber length


def sampling_word(case: Path | str) -> str:
    """How the case interpolates the flow at the beads."""
    return Dictionary.read(Path(case), "constant/fiberProperties").word("interpolation", default="trilinear")


def application(case: Path | str) -> str:
    """The solver of the case."""
    return Dictionary.read(Path(case), "system/controlDict").word("application")


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
    texts = {"system/initialFieldDict": FLOW.format(seed=seed), "constant/fvOptions": FORCING}
    entries = {}
    for name, change in (changes or {}).items():
        (texts if isinstance(change, str) else entries)[name] = change
    scene_copy(
        case,
        copy,
        cells=cells,
        steps=steps,
        end_time=END_TIME,
        viscosity=VISCOSITY,
        write_every=steps,
        texts=texts,
        entries=entries,
    )


def run(copy: Path, cells: int, steps: int, engine: str, interpolation: str, fibers: int = 50) -> State:
    """Run a copy from `make` in "openfoam" or "spectral". interpolation: of the flow at the beads. fibers: in each
    family. Raises as `gbm_plugin.run.openfoam.run`."""
    spectral = engine == "spectral"
    words = three_families(fibers, steps, 1e-6, interpolation)
    (copy / "constant/fiberProperties").write_text(HEADER + words)
    (run_spectral if spectral else run_openfoam)(copy)
    folder = copy / "spectral" if spectral else copy
    velocity = read_velocity(folder, f"{END_TIME:g}", (cells,) * 3)
    with open_recording(results(folder)) as recording:
        ends = {
            name: family.positions[-1][:, [0, -1]] / (2 * family.radius * family.beads)
            for name, family in recording.families.items()
        }
    return State(velocity, ends)


def velocity_distance(a: State, b: State) -> float:
    """Rms difference of the velocities over the rms of `b`'s."""
    return rms(a.velocity - b.velocity) / rms(b.velocity)


def fiber_distance(a: State, b: State) -> dict[str, float]:
    """Rms distance of the end beads over the fiber length, by family."""
    return {name: rms(np.moveaxis(x - b.ends[name], -1, 0)) for name, x in a.ends.items()}
