"""Fibers and a flow that can be sampled in this process, step by step to the end of a run.

What the flow is (`Carrier`), the driver does not know; results go to a folder in the case, which is laid out as
an OpenFOAM case itself, so that `gbm report` and ParaView read it like one.
"""

from __future__ import annotations

import logging
import math
import os
import shutil
from pathlib import Path

import numpy as np

from ..case.box_mesh import MOST, write_box_mesh
from ..case.dictionary import Dictionary
from ..case.disk import Room, kept_folders
from ..case.initial import write_velocity
from ..case.layout import STATE_FILE, results
from ..case.mesh import has_mesh, read_box
from ..case.prepare import name_for_paraview
from ..case.scene import Scene
from ..case.times import Start
from ..errors import CaseError, RunError
from ..fiber import Reaction
from ..fleet.fleet import Fleet
from ..fleet.journal import Journal
from ..signals import Asked, handled
from .continued import compare
from .progress import Progress
from .words import closing, opening

log = logging.getLogger(__name__)


class Carrier:
    """A flow on its way through time beside the fibers. All but `sample` and `on_cells` may be left as they are."""

    cut: float | None = None  # largest resolved wavenumber of a spectral flow, over π/Δx

    def sample(self, positions: np.ndarray, time: float, need: str):
        """As in gbm_plugin.flow, at the present time of the run."""
        raise NotImplementedError

    def on_cells(self, time: float) -> np.ndarray:
        """Velocity (3, nx, ny, nz) [m/s] at the centres of the case's cells."""
        raise NotImplementedError

    def open(self, name: str) -> None:
        """The tables of a run that starts at the time of this name."""

    def advance(self) -> None:
        """One time step."""

    def react(self, positions: np.ndarray, reaction: Reaction) -> None:
        """Take what the fibers do to the flow at the present time, with feedback."""

    def note(self, time: float) -> None:
        """The row of a time."""

    def save(self, folder: Path) -> None:
        """What a restart needs, into a time folder."""

    def restore(self, folder: Path, time: float) -> None:
        """Continue from what save wrote at this time. CaseError or StateError where it is not of this flow."""

    def close(self) -> None:
        """The tables."""


def results_folder(case: Path, name: str) -> Path:
    """The folder `name` of the case, with the case's constant and system."""
    folder = case / name
    try:
        folder.mkdir(exist_ok=True)
        for part in ("constant", "system"):
            if not (folder / part).exists():
                os.symlink(Path("..") / part, folder / part)
        _mesh_for_paraview(case, folder)
        name_for_paraview(folder)
    except OSError as error:
        raise RunError(f"cannot write in {folder}: {error.strerror}") from None
    return folder


def _mesh_for_paraview(case: Path, folder: Path) -> None:
    """Where the case has no mesh, one of its box beside links to the rest of `constant`."""
    box, constant = read_box(case), folder / "constant"
    if has_mesh(case) or box is None:
        return
    if math.prod(box.cells) > MOST:
        log.info("for ParaView to show so many cells, make their mesh: blockMesh -case %s", case)
        return
    if constant.is_symlink():
        constant.unlink()
    constant.mkdir(exist_ok=True)
    for entry in (case / "constant").iterdir():
        if not (constant / entry.name).is_symlink():
            os.symlink(Path("../../constant") / entry.name, constant / entry.name)
    if not has_mesh(folder) or read_box(folder) != box:
        write_box_mesh(constant / "polyMesh", box)


class Run:
    """`scene.case` is the folder of the results."""

    def __init__(self, scene: Scene, carrier: Carrier, start: Start):
        self.scene, self.carrier, self.start = scene, carrier, start
        self._room = Room(scene)
        self._room.look(start.time)
        self._keep = kept_folders(Dictionary.read(scene.case, "system/controlDict"))
        self._written: list[Path] = []
        folders = [scene.case.parent / name for name in ("0.orig", "0")]
        self.template = next((f / "U" for f in folders if (f / "U").is_file()), None)
        if self.template is None:
            raise CaseError(
                f"{scene.case.parent} has no U in 0.orig or 0, after whose form the velocity is written"
            )
        upper = np.add(scene.origin, scene.box)
        self.fleet = Fleet.seeded(scene, scene.origin, upper, start.time, cut=carrier.cut)
        folder = scene.case / _name(start.time) if start.continues else None
        if folder:
            compare(scene)
            carrier.restore(folder, start.time)
            self.fleet.restore(folder)
            log.info("flow and fibers continue from %s", folder / STATE_FILE)
        name = _name(start.time)
        self.journal = Journal(
            scene,
            self.fleet,
            results(scene.case) / name,
            origin=scene.origin,
            box=scene.box,
            state=folder,
        )
        carrier.open(name)

    def to_the_end(self) -> bool:
        """Up to scene.end_time; False where a signal stopped it before, after the step under way."""
        stop = Asked()
        scene = self.scene
        every = scene.write_interval / scene.time_step
        every = round(every) if math.isfinite(every) else 0
        opening(scene, self.start.time)
        self.step = round(self.start.time / scene.time_step)
        last = self.step + round((scene.end_time - self.start.time) / scene.time_step)
        try:
            with handled(stop.note), Progress(scene, self.start.time) as progress:
                self._observe()
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
            self.journal.close()
            self.carrier.close()
        closing(scene, scene.case)
        return True

    def _observe(self) -> None:
        """The flow at the beads, until their places in this step are final."""
        fleet, taken = self.fleet, False
        while not taken:
            taken = self.journal.take(
                self.step, *self.carrier.sample(fleet.positions, fleet.time, fleet.need)
            )
        if self.journal.reaction is not None:
            self.carrier.react(fleet.positions, self.journal.reaction)
        self.carrier.note(fleet.time)

    def _advance(self) -> None:
        self.step += 1
        self.carrier.advance()
        self.fleet.advance(self.scene.time_step)
        self._observe()

    def _save(self) -> None:
        """U at the cell centres for whoever reads the folder as a case, then the states, complete with the last."""
        time = self.fleet.time
        self._room.look(time)
        folder = self.scene.case / _name(time)
        write_velocity(self.template, folder / "U", self.carrier.on_cells(time))
        self.carrier.save(folder)
        self.journal.save(folder, self.step, time)
        self._written.append(folder)
        while self._keep and len(self._written) > self._keep:
            shutil.rmtree(self._written.pop(0))  # as OpenFOAM: only what this run wrote


def _name(time: float) -> str:
    return f"{time:.8g}"
