"""`gbm run CASE --flow spectral`: the case's physics in the pseudo-spectral solver, with the case's fibers.

Results go to the folder `spectral` in the case, which is laid out as an OpenFOAM case itself, so that
`gbm report CASE/spectral` and ParaView read it like the other engine's.
"""

from __future__ import annotations

import logging
import math
from dataclasses import replace
from pathlib import Path

import numpy as np

from ..arrays import check_arrays, read_arrays
from ..case.initial import read_initial_field
from ..case.layout import FLOW_FILE, SPECTRAL, flow_table, results
from ..case.scene import Forcing, Scene
from ..case.solver import sub_cycles
from ..case.times import choose_start
from ..errors import CaseError, StateError
from ..fiber import Reaction
from ..files import created, replaced
from ..output.restarts import keep_earlier
from ..scales import kolmogorov_length, taylor_reynolds
from ..spectral import EswaranPope, LinearForcing, SpectralSolver
from ..spectral.interpolation import WORDS
from .driver import Carrier, Run, results_folder
from .words import COMPLETE

log = logging.getLogger(__name__)

SMALL = 1 << 20  # arrays of so many bytes are read, whatever they are
COLUMNS = (
    *("Time", "k", "epsilonBudget", "epsilonGradient", "epsilonLaplacian", "uPrime", "ReLambda", "eta"),
    *("A", "power", "meanUx", "meanUy", "meanUz"),
)


def run_spectral(
    scene: Scene, *, fresh: bool = False, threads: int = 1, precision: str = "double", device: str = "cpu"
) -> bool:
    """Run to the case's endTime, continuing an unfinished run; False where a signal stopped it before.

    Raises CaseError for what this engine cannot do, FloatingPointError where the flow or a fiber is not finite.
    """
    cells, box, cycles = check_spectral(scene)
    folder = results_folder(scene.case, SPECTRAL)
    start = choose_start(
        folder, scene.start_time, scene.end_time, scene.time_step, fresh, makes_beginning=True
    )
    if start.complete:
        log.info(COMPLETE, start.time)
        return True
    solver = SpectralSolver(
        cells,
        scene.kinematic_viscosity,
        box=box,
        forcing=_forcing(scene.forcing),
        time_step=scene.time_step / cycles,
        threads=threads,
        precision=precision,
        interpolation=scene.interpolation,
        device=device,
    )
    if not start.continues:
        _set_initial(scene, solver)
    scene = replace(scene, case=folder, application=SPECTRAL)
    return Run(scene, _SpectralFlow(scene, solver, cycles), start).to_the_end()


def _set_initial(scene: Scene, solver: SpectralSolver) -> None:
    initial = read_initial_field(scene.case)
    modes, force = initial.modes, initial.force
    if isinstance(solver.forcing, LinearForcing) and not np.any(modes.amplitudes):
        raise CaseError(
            f"{scene.case}/system/initialFieldDict: the forcing {scene.forcing.name} has nothing to force, k = 0"
        )
    try:
        modes.must_fit(scene.cells)
        solver.set_modes(modes.wavevectors, modes.amplitudes)
        if force and solver.forcing.forms():
            solver.forcing.restore(force)
    except ValueError as error:
        raise CaseError(f"{scene.case}/system/initialFieldDict: {error}") from None


def check_spectral(scene: Scene) -> tuple[int, float, int]:
    """Cells in a direction, edge of the box [m], and steps of the flow in one of the fibers. CaseError for what this
    engine cannot do."""
    cells, box = _cube(scene)
    if scene.interpolation not in WORDS:
        raise CaseError(
            f"{scene.case}/constant/fiberProperties: interpolation '{scene.interpolation}' is not one of the "
            f"spectral solver's; allowed: {' '.join(WORDS)}"
        )
    cycles = sub_cycles(scene.case)
    if scene.coupling.feedback and cycles > 1:
        raise CaseError(
            f"{scene.case}/system/fvSolution: nSubCycles is {cycles}: with feedback the flow and its fibers take the "
            "same steps, and it must be 1"
        )
    return cells, box, cycles


def _cube(scene: Scene) -> tuple[int, float]:
    if scene.box is None or scene.cells is None:
        raise CaseError(f"{scene.case}/system/blockMeshDict: the spectral solver needs one uniform block")
    if np.ptp(scene.box) > 1e-9 * scene.box[0] or len(set(scene.cells)) > 1 or scene.cells[0] % 2:
        raise CaseError(
            f"{scene.case}/system/blockMeshDict: the spectral solver needs a cube with the same even number of "
            f"cells in each direction, not {scene.cells} in a box of {tuple(f'{b:g}' for b in scene.box)}"
        )
    return scene.cells[0], scene.box[0]


def _forcing(forcing: Forcing | None) -> LinearForcing | EswaranPope | None:
    if forcing is None:
        return None
    v = forcing.values
    if forcing.type == "eswaranPope":
        return EswaranPope(
            variance=v["variance"], time_scale=v["timeScale"], cutoff=v["cutoff"], seed=v["seed"]
        )
    strength = {"coefficient": v["A"]} if v["mode"] == "constantCoefficient" else {"power": v["power"]}
    return LinearForcing(**strength) if all(strength.values()) else None


class _SpectralFlow(Carrier):
    """The solver, and its table of energies, where the forcing's writeToFile is not no."""

    def __init__(self, scene: Scene, solver: SpectralSolver, cycles: int = 1):
        self.scene, self.solver, self.cycles = scene, solver, cycles
        self.tabulates = scene.forcing is None or scene.forcing.table
        self.cut = (2 * solver.modes.cut + 1) / solver.cells
        # energy and power before the last step, and at its end
        self.before: tuple[float, float] | None = None
        self.now: tuple[float, float] | None = None

    def sample(self, positions: np.ndarray, time: float, need: str):
        return self.solver.sample(positions - np.asarray(self.scene.origin), self.solver.time, need)

    def on_cells(self, time: float) -> np.ndarray:
        return self.solver.shifted_velocity(0.5)

    def open(self, name: str) -> None:
        if not self.tabulates:
            return
        forcing = self.scene.forcing.name if self.scene.forcing else "flow"
        path = results(self.scene.case, forcing) / name / flow_table(forcing)
        path.parent.mkdir(parents=True, exist_ok=True)
        self.table = created(keep_earlier(path), buffering=1)
        columns = [*COLUMNS, *(["exchange"] if self.scene.coupling.feedback else [])]
        self.table.write("# Pseudo-spectral solver, SI units, per unit mass\n# " + "\t".join(columns) + "\n")

    def advance(self) -> None:
        self.solver.advance(self.cycles)

    def react(self, positions: np.ndarray, reaction: Reaction) -> None:
        places, density = positions - np.asarray(self.scene.origin), self.scene.density
        self.solver.set_point_forces(places, reaction.force / density, reaction.torque / density)

    def note(self, time: float) -> None:
        if not self.tabulates:
            return
        energy, power, dissipation, exchange = self.solver.energetics().values()
        balance = dissipation
        self.before, self.now = self.now, (energy, power + exchange)
        if self.before is not None:
            balance = (
                0.5 * (power + exchange + self.before[1]) - (energy - self.before[0]) / self.scene.time_step
            )
        nu, u = self.scene.kinematic_viscosity, math.sqrt(2 * energy / 3)
        reynolds = taylor_reynolds(u, nu, dissipation)
        eta = kolmogorov_length(nu, dissipation)
        coefficient = power / (2 * energy) if energy > 0 else 0.0
        mean = self.solver.mean
        row = (time, energy, balance, dissipation, dissipation, u, reynolds, eta, coefficient, power, *mean)
        row += (exchange,) if self.scene.coupling.feedback else ()
        self.table.write("\t".join(f"{x:.12g}" for x in row) + "\n")

    def save(self, folder: Path) -> None:
        path = folder / FLOW_FILE
        path.parent.mkdir(parents=True, exist_ok=True)
        with replaced(path, "wb") as file:
            before = self.before or self._energy_and_power()
            np.savez(file, before=before, **self.solver.state())

    def _energy_and_power(self) -> tuple[float, float]:
        """Of the present state, where no table has told them."""
        energy, power, _, exchange = self.solver.energetics().values()
        return energy, power + exchange

    def restore(self, folder: Path, time: float) -> None:
        path = folder / FLOW_FILE
        forms = self.solver.forms()
        try:
            state = read_arrays(path, [*forms, "before"], max(self.solver.coefficients.nbytes, SMALL))
            check_arrays(state, {"before": ("f", (2,))})
            self.now = tuple(state.pop("before").tolist())  # the row of this time is made again
            self.solver.restore(state)
            if abs(self.solver.time - time) > 0.5 * self.scene.time_step:
                raise ValueError(f"it is of time {self.solver.time:g}, not {time:g}")
        except (KeyError, ValueError) as error:
            raise StateError(f"the state of the flow {path} cannot be continued from: {error}") from None

    def close(self) -> None:
        if self.tabulates:
            self.table.close()
