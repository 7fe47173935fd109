"""Interpolation: every word of `interpolation`, of both engines, on one field of a turbulent spectrum

Velocity and rotation at beads against the Fourier sum, rms over rms. OpenFOAM's are those of real coupled runs, of
which the first samples are read, and whose fibers after 0.3 s are compared with those of `quintic`; in the
spectral solver fibers move through the frozen field, compared with `exact`. Cost: a sample of velocity and rotation.
"""

from __future__ import annotations

import tempfile
import time
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ...case.copies import HEADER
from ...case.edit import set_entries
from ...case.fields import FourierModes, random_modes
from ...case.layout import COUPLING_TABLE, results
from ...case.new import new_case
from ...output.recording import open_recording
from ...output.tables import read_dat
from ...report.style import COLOURS, LINES
from ...run.openfoam import run as run_openfoam
from ...sampling import rotation_of
from ...spectral import SpectralSolver
from ...spectral.interpolation import WORDS
from ..scenes import ends_apart
from ..study import quiet
from .flows import BOX, Carrier
from .front import mark_front
from .march import march

STOCK = ("cell", "cellPoint", "cellPointFace", "pointMVC")  # OpenFOAM's own, on the first of the meshes
OPENFOAM = ("trilinear", "cubic", "quintic")
CELLS = (40, 64)
VISCOSITY, ETA, TAU, ENERGY, HIGHEST = (
    0.01,
    0.067,
    0.45,
    0.2,
    13,
)  # of the default case's turbulence; k_max η = 0.9
PERSISTENCE, COUNT, BEADS, LENGTH = 0.4, 64, 20, 2.0
END, STEP = 0.3, 0.01  # [s] of the coupled runs

FIBERS = """integrator auto; tolerance 1e-4; interpolation {word}; recordInterval {steps};
families {{ a {{ count {count}; beads {beads}; length {length}; bendingStiffness {stiffness!r}; seed 1; }} }}
"""


def spectrum() -> dict[int, float]:
    """Energy of each shell: Pope's model of the dissipation range (Turbulent Flows, eq. 6.248) behind k^(-5/3)."""
    k = np.arange(1, HIGHEST + 1)
    shape = k ** (-5 / 3) * np.exp(-5.2 * (((k * ETA) ** 4 + 0.4**4) ** 0.25 - 0.4))
    return {int(n): float(e) for n, e in zip(k, ENERGY * shape / shape.sum(), strict=True)}


def exact(modes: FourierModes, points: NDArray) -> tuple[NDArray, NDArray]:
    """Velocity and rotation (P, 3) of a field at points (P, 3), by its sum."""
    velocity, gradient = np.zeros(points.shape), np.zeros((*points.shape, 3))
    for part in np.array_split(np.arange(len(modes.wavevectors)), 40):
        k, a = modes.wavevectors[part] * (2 * np.pi / BOX), modes.amplitudes[part]
        wave = np.exp(1j * points @ k.T)
        velocity += (wave @ a).real
        gradient += np.einsum("pm,mi,mj->pij", wave, a, 1j * k).real
    return velocity, rotation_of(gradient)


def measure(quick: bool) -> list[dict]:
    """A row for each engine, number of cells and word."""
    modes = random_modes(spectrum(), seed=1)
    carrier = Carrier("frozen", None, LENGTH, VISCOSITY, TAU, np.inf)
    fibers = carrier.fibers(PERSISTENCE, BEADS, COUNT)
    truth = exact(modes, fibers.positions.reshape(-1, 3))
    rows = []
    for cells in CELLS[: 1 if quick else None]:
        rows += _spectral(modes, fibers, cells, truth)
        if not quick:
            rows += _openfoam(fibers, cells, truth)
    mark_front(rows, "engine", "cells", cost="microseconds", error="velocity_error")
    return rows


def _apart(found: NDArray, truth: NDArray) -> float:
    return float(np.sqrt(((found - truth) ** 2).sum() / (truth**2).sum()))


class _Frozen:
    """A solver's present field, at all times."""

    def __init__(self, solver: SpectralSolver):
        self.solver = solver

    def sample(self, positions, time, need):
        """As the solver's own."""
        return self.solver.sample(positions, self.solver.time, need)


def _spectral(modes: FourierModes, fibers, cells: int, truth) -> list[dict]:
    rows, points = [], fibers.positions.reshape(-1, 3)
    ends = {}
    for word in reversed(WORDS):
        solver = SpectralSolver(cells, VISCOSITY, time_step=1.0, interpolation=word)
        solver.set_velocity(modes.on_lattice((cells,) * 3))
        solver.sample(points, 0.0, "rotation")
        seconds = np.inf
        for _ in range(3):
            begin = time.process_time()
            velocity, rotation = solver.sample(points, 0.0, "rotation")
            seconds = min(seconds, time.process_time() - begin)
        carrier = Carrier("frozen", _Frozen(solver), LENGTH, VISCOSITY, TAU, np.inf)
        ends[word] = march(carrier, fibers, 0.1, 2.0, integrator="auto", tolerance=1e-4)
        row = {"engine": "spectral", "cells": cells, "word": word}
        row |= {"velocity_error": _apart(velocity, truth[0]), "rotation_error": _apart(rotation, truth[1])}
        row |= ends[word].errors(ends["exact"]) | {"microseconds": 1e6 * seconds / len(points)}
        rows.append(row)
    return rows[::-1]


def _openfoam(fibers, cells: int, truth) -> list[dict]:
    found = {}
    with tempfile.TemporaryDirectory(prefix="gbm-accuracy-") as folder:
        for word in OPENFOAM + STOCK * (cells == CELLS[0]):
            found[word] = _coupled(Path(folder) / word, word, cells, float(fibers.bending_stiffness[0]))
    last = found["quintic"][2]
    rows = []
    for word, (velocity, rotation, positions, seconds) in found.items():
        row = {"engine": "boxFoam", "cells": cells, "word": word}
        row |= {"velocity_error": _apart(velocity, truth[0]), "rotation_error": _apart(rotation, truth[1])}
        row |= {"error": ends_apart(positions, last, fibers.radius)}
        rows.append(row | {"microseconds": 1e6 * seconds / (COUNT * BEADS)})
    return rows


def _coupled(case: Path, word: str, cells: int, stiffness: float) -> tuple[NDArray, NDArray, NDArray, float]:
    """First samples (B, 3) of velocity and rotation of a run with this word, last positions, seconds of a sampling."""
    new_case(case)
    steps = round(END / STEP)
    set_entries(case / "system/blockMeshDict", {"n": cells})
    set_entries(case / "constant/transportProperties", {"nu": VISCOSITY})
    times = {"deltaT": STEP, "endTime": END, "writeInterval": 1, "purgeWrite": 0}
    set_entries(case / "system/controlDict", times)
    table = " ".join(f"({k} {e!r})" for k, e in spectrum().items())
    field = f"field random; spectrum table; table ({table}); seed 1;\n"
    (case / "system/initialFieldDict").write_text(HEADER + field)
    sizes = {"count": COUNT, "beads": BEADS, "length": LENGTH, "stiffness": stiffness}
    (case / "constant/fiberProperties").write_text(HEADER + FIBERS.format(word=word, steps=steps, **sizes))
    with quiet():
        run_openfoam(case)
    with np.load(case / f"{STEP:g}" / "uniform/fibers.npz") as state:
        assert state["a/sample_times"][0] == 0
        first = state["a/samples"][:, 0].reshape(COUNT, 2, BEADS, 3)
    with open_recording(results(case)) as recording:
        last = recording.families["a"].positions[-1]
    seconds = float(np.min(read_dat(results(case), COUPLING_TABLE)["sampling"][2:]))
    return first[:, 0].reshape(-1, 3), first[:, 1].reshape(-1, 3), last, seconds


def draw(axes, rows: list[dict]) -> None:
    """Error of the velocity against the cost of a sample."""
    for colour, engine in zip(COLOURS, dict.fromkeys(r["engine"] for r in rows), strict=False):
        for line, cells in zip(LINES, CELLS, strict=False):
            own = [r for r in rows if (r["engine"], r["cells"]) == (engine, cells) and r["word"] != "exact"]
            x, y = ([r[name] for r in own] for name in ("microseconds", "velocity_error"))
            axes.loglog(x, y, "o", linestyle="", color=colour, fillstyle="none" if line == "-" else "full")
            for r in own:
                place = (r["microseconds"], r["velocity_error"])
                axes.annotate(r["word"], place, (4, 3), textcoords="offset points", fontsize=6)
        axes.plot([], [], "o", color=colour, label=engine)
    axes.set(title="interpolation (full: 64³)", xlabel="µs a bead", ylabel="error of the velocity")
    axes.legend()


def lines(rows: list[dict]) -> list[str]:
    """+ marks the front of velocity and cost, in one engine."""
    text = ["engine     cells  word            velocity  rotation    ends/L    µs/bead"]
    for r in rows:
        text.append(
            f"{r['engine']:10s} {r['cells']:5d}  {r['word']:14s}{r['velocity_error']:10.1e}{r['rotation_error']:10.1e}"
            f"{r['error']:10.1e}{r['microseconds']:11.2f} {'+' * r['on_front']}"
        )
    return text
