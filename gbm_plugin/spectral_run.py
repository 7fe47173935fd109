"""`gbm run CASE --flow spectral`: the case's physics in the pseudo-spectral solver, with the case's fibers.

Results go to the folder `spectral` in the case, which is laid out as an OpenFOAM case itself, so that
`gbm report CASE/spectral` and ParaView read it like the other engine's.
"""

from __future__ import annotations

import logging
import math
import os
import signal
from dataclasses import replace
from pathlib import Path

import numpy as np

from . import __version__
from .case.dictionary import CaseError
from .case.initial import read_initial_field, write_velocity
from .case.scene import Forcing, Scene
from .case.times import STATE_FILE, Start, choose_start
from .coupling.daemon import family_record
from .coupling.fleet import Fleet
from .coupling.steptable import StepTable
from .output.progress import Progress
from .output.recording import Recorder
from .output.restarts import keep_earlier
from .spectral import EswaranPope, LinearForcing, SpectralSolver
from .spectral.interpolation import WORDS

log = logging.getLogger(__name__)

FLOW_FILE = "uniform/flow.npz"
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
    cells, box = _cube(scene)
    if scene.interpolation not in WORDS:
        raise CaseError(
            f"{scene.case}/constant/fiberProperties: interpolation '{scene.interpolation}' is not one of the "
            f"spectral solver's; allowed: {' '.join(WORDS)}"
        )
    folder = _results_folder(scene.case)
    start = choose_start(folder, scene.start_time, scene.end_time, scene.time_step, fresh)
    solver = SpectralSolver(
        cells,
        scene.viscosity,
        box=box,
        forcing=_forcing(scene.forcing),
        time_step=scene.time_step,
        threads=threads,
        precision=precision,
        interpolation=scene.interpolation,
        device=device,
    )
    return _Run(replace(scene, case=folder), solver, start).to_the_end()


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


def _results_folder(case: Path) -> Path:
    folder = case / "spectral"
    try:
        folder.mkdir(exist_ok=True)
        for part in ("constant", "system"):
            if not (folder / part).exists():
                os.symlink(Path("..") / part, folder / part)
    except OSError as error:
        raise CaseError(f"cannot write in {folder}: {error.strerror}") from None
    return folder


class _Run:
    """Flow and fibers in one process; `scene.case` is the folder of the results."""

    def __init__(self, scene: Scene, solver: SpectralSolver, start: Start):
        self.scene, self.solver, self.start = scene, solver, start
        origin = np.asarray(scene.origin)
        self.origin = origin
        folders = [scene.case.parent / name for name in ("0.orig", "0")]
        self.template = next((f / "U" for f in folders if (f / "U").is_file()), None)
        if self.template is None:
            raise CaseError(
                f"{scene.case.parent} has no U in 0.orig or 0, after whose form the velocity is written"
            )
        self.fleet = Fleet.seeded(scene, origin, origin + scene.box, start.time)
        # energy and power before the last step, and at its end
        self.before: tuple[float, float] | None = None
        self.now: tuple[float, float] | None = None
        if start.continues:
            self._restore()
        else:
            modes = read_initial_field(scene.case)
            try:
                solver.set_velocity(modes.on_lattice(scene.cells, offset=0.0))
            except ValueError as error:
                raise CaseError(f"{scene.case}/system/initialFieldDict: {error}") from None
        self._open_outputs(_name(start.time))

    def _open_outputs(self, name: str) -> None:
        scene = self.scene
        fibers = scene.case / "postProcessing/fibers" / name
        self.recorder = Recorder(
            keep_earlier(fibers / "fibers.h5"),
            [family_record(f) for f in scene.families],
            box_origin=scene.origin,
            box_size=scene.box,
            viscosity=scene.dynamic_viscosity,
            density=scene.density,
            dictionaries=scene.texts,
            program_version=__version__,
        )
        self.table = StepTable(fibers, scene.families)
        path = scene.case / "postProcessing/linearForcing" / name / "linearForcing.dat"
        path.parent.mkdir(parents=True, exist_ok=True)
        self.flow_table = keep_earlier(path).open("w", buffering=1)
        self.flow_table.write(
            "# Pseudo-spectral solver, SI units, per unit mass\n# " + "\t".join(COLUMNS) + "\n"
        )

    def to_the_end(self) -> bool:
        stop: list[int] = []
        handlers = {n: signal.signal(n, lambda *_: stop.append(1)) for n in (signal.SIGINT, signal.SIGTERM)}
        scene = self.scene
        last = round(scene.end_time / scene.time_step)
        every = scene.write_interval / scene.time_step
        every = round(every) if math.isfinite(every) else 0
        self.step = round(self.start.time / scene.time_step)
        try:
            with Progress(scene, self.start.time) as progress:
                self._observe()
                self._note()
                while self.step < last:
                    self._advance()
                    stopping = bool(stop) and self.step < last
                    if stopping or self.step == last or (every and self.step % every == 0):
                        self._save()
                    if self.step % 10 == 0:
                        progress.update()
                    if stopping:
                        return False
        finally:
            self.recorder.close()
            self.table.close()
            self.flow_table.close()
            for number, handler in handlers.items():
                signal.signal(number, handler)
        return True

    def _sample(self):
        return self.solver.sample(self.fleet.positions - self.origin, self.solver.time, self.fleet.need)

    def _observe(self) -> None:
        velocity, extra = self._sample()
        self.fleet.observe(self.fleet.time, velocity, extra)
        if not self.fleet.provisional:
            self.gap = self.fleet.check_prediction(velocity, self.step)

    def _advance(self) -> None:
        self.solver.advance(1)
        self.fleet.advance(self.scene.time_step)
        while self.fleet.provisional:
            self._observe()
            self.fleet.correct()
        self._observe()
        self.step += 1
        self._note()

    def _note(self) -> None:
        """The tables' rows of this time, and the record if it is due."""
        time, fleet = self.fleet.time, self.fleet
        energy, power, dissipation = self.solver.energetics().values()
        balance = dissipation
        self.before, self.now = self.now, (energy, power)
        if self.before is not None:
            balance = 0.5 * (power + self.before[1]) - (energy - self.before[0]) / self.scene.time_step
        nu, u = self.scene.viscosity, math.sqrt(2 * energy / 3)
        reynolds = u**2 * math.sqrt(15 / (nu * dissipation)) if dissipation > 0 else 0.0
        eta = (nu**3 / dissipation) ** 0.25 if dissipation > 0 else math.inf
        coefficient = power / (2 * energy) if energy > 0 else 0.0
        mean = self.solver.coefficients[:, 0, 0, 0].real
        row = (time, energy, balance, dissipation, dissipation, u, reynolds, eta, coefficient, power, *mean)
        self.flow_table.write("\t".join(f"{x:.12g}" for x in row) + "\n")
        self.table.add(time, self.step, 0.0, 0.0, self.gap, fleet.end_to_end_ratio())
        if self.step % self.scene.record_interval == 0:
            self.recorder.append(self.step, time, fleet.by_family)

    def _save(self) -> None:
        """U at the cell centres for whoever reads the folder as a case, then the states, complete with the last."""
        folder = self.scene.case / _name(self.fleet.time)
        write_velocity(self.template, folder / "U", self.solver.shifted_velocity(0.5))
        path = folder / FLOW_FILE
        path.parent.mkdir(parents=True, exist_ok=True)
        with path.open("wb") as file:
            np.savez(file, before=self.before, **self.solver.state())
        self.fleet.save(folder, self.step, self.fleet.time)

    def _restore(self) -> None:
        folder = self.scene.case / _name(self.start.time)
        path = folder / FLOW_FILE
        try:
            with np.load(path) as data:
                state = {name: data[name] for name in data.files}
        except (OSError, ValueError) as error:
            raise CaseError(f"the state of the flow {path} cannot be read: {error}") from None
        self.now = tuple(state.pop("before"))  # the row of this time is made again
        self.solver.restore(state)
        self.fleet.restore(folder)
        log.info("flow and fibers continue from %s and %s", path, folder / STATE_FILE)


def _name(time: float) -> str:
    return f"{time:.8g}"
