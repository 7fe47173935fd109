"""What a run keeps of its fibers, step by step: the recording and the table."""

from __future__ import annotations

import contextlib
from pathlib import Path

import numpy as np

from .. import __version__
from ..case.layout import daemon_table, recording_name
from ..case.scene import Family, Scene
from ..case.share import WHOLE, Share
from ..files import created
from ..output.recording import FamilyRecord, Recorder
from ..output.restarts import keep_earlier
from .fleet import Fleet


class Journal:
    """Takes the samples of the flow for a fleet, and writes down what became of it.

    `fibers.h5` holds the positions of every `recordInterval`-th step, and of the first. `daemon.dat` has a row a
    step: sentAt and arrivedAt by the clock of the day [s], the prediction gap [m/s], <R^2>/L^2 of each family.
    """

    def __init__(self, scene: Scene, fleet: Fleet, folder: Path, *, origin, box, share: Share = WHOLE):
        """folder: of this start, where both files are made anew. origin, box (3,): of the flow's box [m]."""
        self.scene, self.fleet = scene, fleet
        self._recorded = False
        self.recorder = Recorder(
            keep_earlier(folder / recording_name(share)),
            [_family_record(f) for f in scene.families],
            box_origin=origin,
            box_size=box,
            dynamic_viscosity=scene.dynamic_viscosity,
            density=scene.density,
            dictionaries=scene.texts,
            program_version=__version__,
        )
        self._path = keep_earlier(folder / daemon_table(share))
        self._table = created(self._path, buffering=1)
        names = ["Time", "step", "sentAt", "arrivedAt", "gap", *(f"R2_{f.name}" for f in scene.families)]
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
        gap = fleet.check_prediction(velocity, step)
        self._add_row(step, sent_at, arrived_at, gap)
        if not self._recorded or step % self.scene.record_interval == 0:
            self.recorder.append(step, fleet.time, fleet.by_family)
            self._recorded = True
        return True

    def _add_row(self, step: int, sent_at: float, arrived_at: float, gap: float) -> None:
        row = [f"{self.fleet.time:.12g}", str(step), f"{sent_at:.6f}", f"{arrived_at:.6f}", f"{gap:.6g}"]
        row += [f"{ratio:.9g}" for ratio in self.fleet.end_to_end_ratio()]
        try:
            self._table.write("\t".join(row) + "\n")
        except OSError as error:
            raise OSError(error.errno, error.strerror, str(self._path)) from None

    def close(self) -> None:
        self.recorder.close()
        with contextlib.suppress(OSError):  # a full disk was named when a row did not fit
            self._table.close()


def _family_record(f: Family) -> FamilyRecord:
    """What the recording says of a family."""
    model = f.model.entries() | {"shape": f.shape}
    return FamilyRecord(f.name, f.count, f.beads, f.radius, f.bending_stiffness, f.seed, model)
