"""The velocity fields that a run stored, with its fibers at the same times: gradients at beads.

They are spectrally exact at the nodes and interpolated by quintics between them, which reads their squares low where
cells are wide; by how much, `gbm study rods` says: random rods against 4/15.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from ..case.layout import time_folders, velocity_file
from ..case.mesh import read_box
from ..errors import GbmError
from ..output.field import read_velocity
from ..sampling import lagrange_weights
from ..spectral import SpectralSolver
from .recorded import Family, FinishedRun
from .study import steps


class Field:
    """One stored field [SI] of a run, on a cube, and the fibers at its time."""

    def __init__(self, finished: FinishedRun, name: str, time: float):
        self.finished, self.time = finished, time
        mesh = read_box(finished.case)
        self.origin, self.box = np.array(mesh.origin), np.array(mesh.size)
        cells = mesh.cells
        self._solver = SpectralSolver(
            cells[0], finished.flow.viscosity, box=self.box[0], time_step=1.0, interpolation="quintic"
        )
        self._solver.set_velocity(read_velocity(finished.case, name, cells))
        self._corner = self.origin + 0.5 * self.box / cells  # of the values
        self.dissipation = self._solver.statistics()["dissipation"]

    def gradient(self, places: NDArray) -> NDArray:
        """du_i/dx_j (..., 3, 3) [1/s] at places (..., 3)."""
        return self._solver.sample(places - self._corner, 0.0, "gradient")[1]

    def positions(self, family: Family) -> NDArray:
        """(F, N, 3) [m] at this time: of its record, or a cubic through the four nearest, which are apart by less than
        the flow changes in."""
        times = self.finished.recording.times
        first = int(np.clip(np.searchsorted(times, self.time) - 2, 0, max(len(times) - 4, 0)))
        part = slice(first, min(first + 4, len(times)))
        weights = lagrange_weights(times[part], self.time)
        return np.tensordot(weights, self.finished.recording.families[family.name].positions[part], 1)

    def at_random(self, count: int, seed: int = 1) -> NDArray:
        """Gradients (count, 3, 3) at random places of the box: what tracers see, by the same interpolation."""
        places = np.random.default_rng(seed).uniform(0, 1, (count, 3))
        return self.gradient(self.origin + places * self.box)


def fields_of(finished: FinishedRun, most: int) -> Iterator[Field]:
    """Up to `most` stored fields from the start of the averages to the last record, equally spaced; none of a run that
    is not on a cube of equal cells, or stored none."""
    try:
        mesh = read_box(finished.case)
    except (GbmError, ValueError, OSError):
        return
    if (
        mesh is None
        or len(set(mesh.cells)) > 1
        or mesh.cells[0] % 2
        or np.ptp(mesh.size) > 1e-9 * max(mesh.size)
    ):
        return
    times = finished.recording.times
    slack = 1e-3 * float(np.diff(times).min())
    found = [
        (name, min(max(time, times[0]), times[-1]))
        for time, name in sorted(time_folders(finished.case).items())
        if max(finished.since, times[0]) - slack <= time <= times[-1] + slack
        and velocity_file(finished.case / name)
    ]
    if most and len(found) > most:
        found = [found[i] for i in np.linspace(0, len(found) - 1, most).round().astype(int)]
    for name, time in steps(
        found[: max(most, 0)], min(len(found), max(most, 0)), f"{finished.label}: fields"
    ):
        try:
            yield Field(finished, name, time)
        except ValueError:  # under way, or cut off
            continue
