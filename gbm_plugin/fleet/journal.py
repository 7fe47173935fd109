"""What a run keeps of its fibers, step by step: the recording and the table."""

from __future__ import annotations

import contextlib
import logging
from collections.abc import Sequence
from pathlib import Path
from typing import IO

import numpy as np

from .. import __version__
from ..case.layout import daemon_table, recording_name, warnings_file
from ..case.scene import Family, Scene
from ..case.share import WHOLE, Share
from ..fiber import Reaction
from ..files import created
from ..output.recording import FamilyRecord, Recorder
from ..output.restarts import keep_earlier
from ..sampling import rotation_of
from .fleet import GAP_WARNING, Fleet
from .gathering import Gathering

log = logging.getLogger(__name__)


class Journal:
    """Takes the samples of the flow for a fleet, and writes down what became of it.

    `fibers.h5` holds the positions, and what the entry `record` names, of every `recordInterval`-th step and of the
    first. `daemon.dat` has a row a step: sentAt and arrivedAt by the clock of the day [s], the prediction gap [m/s],
    <R^2>/L^2 of each family; with feedback also exchange, the power that the fluid gets, friction, Φ, bending, dE_b/dt,
    and own, that part of the exchange which beads would find of themselves and do not: exchange = own − friction −
    bending [W]. `statistics.h5`, where it is asked for, has what `Gathering` gathers.
    """

    def __init__(
        self,
        scene: Scene,
        fleet: Fleet,
        folder: Path,
        *,
        origin,
        box,
        share: Share = WHOLE,
        state: Path | None = None,
    ):
        """folder: of this start, where the files are made anew. origin, box (3,): of the flow's box [m]. state: the
        time folder that the fleet continues from."""
        self.scene, self.fleet = scene, fleet
        self._recorded = False
        self.reaction: Reaction | None = None  # of the fibers on the flow at the newest sample, with feedback
        self._folder, self._share = folder, share
        self._warnings: IO | None = None
        self._steps, self._badly_predicted = 0, 0
        self._warned, self._worst = 0.0, 0.0
        self.recorder = Recorder(
            keep_earlier(folder / recording_name(share)),
            [_family_record(f) for f in scene.families],
            box_origin=origin,
            box_size=box,
            dynamic_viscosity=scene.dynamic_viscosity,
            density=scene.density,
            dictionaries=scene.texts,
            program_version=__version__,
            tension="tension" in scene.record,
        )
        self.gathering = Gathering(scene, folder, share) if scene.statistics else None
        if self.gathering and state is not None:
            self.gathering.restore(state)
        self._path = keep_earlier(folder / daemon_table(share))
        self._table = created(self._path, buffering=1)
        names = ["Time", "step", "sentAt", "arrivedAt", "gap", *(f"R2_{f.name}" for f in scene.families)]
        names += ["exchange", "friction", "bending", "own"] if scene.coupling.feedback else []
        self._table.write("# " + "\t".join(names) + "\n")

    def take(
        self,
        step: int,
        velocity: np.ndarray,
        extra: np.ndarray | None,
        sent_at: float = 0.0,
        arrived_at: float = 0.0,
    ) -> bool:
        """The flow (B, 3) at the fleet's beads, in the present step. False where this only corrected a provisional
        step, whose beads must be sampled once more; else the row, and the record where one is due."""
        fleet = self.fleet
        provisional = fleet.provisional
        fleet.observe(fleet.time, velocity, extra)
        if provisional:
            fleet.correct()
            return False
        gap, wrong = fleet.check_prediction(velocity, step)
        self._note_prediction(step, wrong)
        powers = []
        if self.scene.coupling.feedback:
            self.reaction = fleet.reaction(self.scene.time_step)
            rotation = rotation_of(extra) if extra.ndim == 3 else extra
            own = self.reaction.exchange(*fleet.own_motion.swapaxes(0, 1))
            exchange = self.reaction.exchange(velocity, rotation)
            powers = [exchange, self.reaction.friction, self.reaction.bending, own]
        self._add_row(step, sent_at, arrived_at, gap, powers)
        if not self._recorded or step % self.scene.record_interval == 0:
            tension = [s.tension for s in fleet.steppers] if self.recorder.tension else None
            self.recorder.append(step, fleet.time, fleet.by_family, tension)
            self._recorded = True
        if self.gathering:
            self.gathering.take(step, fleet.time, fleet.by_family)
        return True

    def save(self, folder: Path, step: int, time: float) -> None:
        """What a restart needs, into a time folder, which is complete with the last of it, the fibers' own state."""
        if self.gathering:
            self.gathering.save(folder)
            self.gathering.write()
        self.fleet.save(folder, step, time)

    def _note_prediction(self, step: int, wrong: float) -> None:
        """A warning the first time, and whenever it has doubled; the count comes at the end."""
        self._steps += 1
        if not wrong:
            return
        self._badly_predicted += 1
        if wrong > 2 * self._warned:
            self._warned = wrong
            self.warn(
                f"step {step}: the flow at the fibers was predicted with an error of {100 * wrong:.0f} % of its rms: "
                "a shorter deltaT would be wise"
            )
        self._worst = max(self._worst, wrong)

    def warn(self, text: str) -> None:
        """Into the log, and into the file in which `gbm run` sees it."""
        log.warning("%s", text)
        with contextlib.suppress(OSError):  # a full disk is named by what must not be lost
            if self._warnings is None:
                self._warnings = created(keep_earlier(self._folder / warnings_file(self._share)), buffering=1)
            self._warnings.write(text + "\n")

    def _add_row(
        self, step: int, sent_at: float, arrived_at: float, gap: float, powers: Sequence[float]
    ) -> None:
        row = [f"{self.fleet.time:.12g}", str(step), f"{sent_at:.6f}", f"{arrived_at:.6f}", f"{gap:.6g}"]
        row += [f"{ratio:.9g}" for ratio in self.fleet.end_to_end_ratio()]
        row += [f"{power:.15g}" for power in powers]
        try:
            self._table.write("\t".join(row) + "\n")
        except OSError as error:
            raise OSError(error.errno, error.strerror, str(self._path)) from None

    def close(self) -> None:
        if self._badly_predicted > 1:
            self.warn(
                f"in {self._badly_predicted} of {self._steps} steps the flow at the fibers was predicted with an error "
                f"of more than {100 * GAP_WARNING:.0f} % of its rms, up to {100 * self._worst:.0f} %: a shorter deltaT "
                "would be wise"
            )
        if self.gathering:
            with contextlib.suppress(OSError):  # as below
                self.gathering.write()
        self.recorder.close()
        if self._warnings is not None:
            self._warnings.close()
        with contextlib.suppress(OSError):  # a full disk was named when a row did not fit
            self._table.close()


def _family_record(f: Family) -> FamilyRecord:
    """What the recording says of a family."""
    model = f.model.entries() | {"shape": f.shape}
    return FamilyRecord(f.name, f.count, f.beads, f.radius, f.bending_stiffness, f.seed, model)
