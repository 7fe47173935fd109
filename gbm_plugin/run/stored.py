"""`gbm run CASE --flow stored`: a case's fibers in velocity fields that are there already.

The fields are those of the case's own time folders, or of an HDF5 file of another code (`flow.hdf5`). Results go
to the folder `stored` in the case, laid out as a case itself.
"""

from __future__ import annotations

import itertools
import json
import logging
from dataclasses import replace
from pathlib import Path

import numpy as np

from ..case.scene import Scene
from ..case.times import choose_start
from ..errors import CaseError, StateError
from ..files import write_text
from ..flow import StoredFlow, hdf5_flow
from ..flow.grid import WORDS
from ..flow.stored import SAME_TIME, refuse_gaps
from ..output.stored import case_flow
from .driver import Carrier, Run, results_folder
from .words import COMPLETE

log = logging.getLogger(__name__)

RESOLVED = 1.0  # Kolmogorov times between fields: cubics then cost 1e-2 L in 7 of them, twice it 7e-2
SOURCE_FILE = "uniform/stored.json"
MOST = 1 << 16  # characters of it


def run_stored(
    scene: Scene,
    *,
    fresh: bool = False,
    fields: Path | str | None = None,
    in_time: str = "cubic",
    every: int = 1,
) -> bool:
    """Move the fibers from startTime to endTime as far as the fields reach, continuing an unfinished replay;
    False where a signal stopped it before.

    fields: an HDF5 file; None: the case's time folders, every so many of them. in_time: "cubic" or "linear".
    Raises CaseError or ValueError for what cannot be replayed, FloatingPointError where a field or a fiber is
    not finite.
    """
    if scene.coupling.feedback:
        raise CaseError(
            f"{scene.case}/constant/fiberProperties: feedback is yes, and stored fields cannot be changed: with "
            "--flow stored it must be no"
        )
    if scene.cells is None:
        raise CaseError(f"{scene.case}/system/blockMeshDict: a replay needs a mesh of one uniform block")
    if scene.interpolation not in WORDS:
        raise CaseError(
            f"{scene.case}/constant/fiberProperties: interpolation '{scene.interpolation}' is not one of those "
            f"for stored fields; allowed: {' '.join(WORDS)}"
        )
    if fields is None:
        where = (scene.cells, scene.box, scene.origin)
        flow = case_flow(scene.case, *where, scene.interpolation, in_time, every)
    else:
        flow = hdf5_flow(fields, scene.interpolation, in_time)
        if not np.allclose(flow.box, scene.box, rtol=1e-6, atol=0):
            raise CaseError(
                f"{fields}: box is {_listed(flow.box)}, that of {scene.case}/system/blockMeshDict is "
                f"{_listed(scene.box)}: they must be the same"
            )
    begin, end = _range(scene, flow, every if fields is None else 0)
    _warn_of_intervals(flow, begin, end)
    folder = results_folder(scene.case, "stored")
    start = choose_start(folder, begin, end, scene.time_step, fresh, makes_beginning=True)
    if start.complete:
        log.info(COMPLETE, start.time)
        return True
    source = {
        "fields": str(Path(fields).resolve()) if fields else "time folders",
        "every": every,
        "interpolation": scene.interpolation,
        "inTime": in_time,
    }
    carrier = _Stored(flow, scene, source)
    return Run(replace(scene, case=folder, end_time=end), carrier, start).to_the_end()


def _warn_of_intervals(flow: StoredFlow, begin: float, end: float) -> None:
    """A word where fields are too far apart to be interpolated between."""
    times = flow.times
    used = [b - a for a, b in itertools.pairwise(times) if b > begin and a < end]
    ratio = max(used, default=0.0) / flow.kolmogorov_time(begin)
    if ratio > RESOLVED:
        log.warning(
            "fields are up to %.2g Kolmogorov times apart: more than %g is not interpolated well in time "
            "(docs/results/replay.md)",
            ratio,
            RESOLVED,
        )


def _range(scene: Scene, flow: StoredFlow, every: int) -> tuple[float, float]:
    """First and last time of the replay: the case's, as far as the fields reach. every: how many of the fields that
    the case writes count as one; 0 for those of another code."""
    first, last, step = flow.times[0], flow.times[-1], scene.time_step
    slack = SAME_TIME * step
    begin, end = scene.start_time, scene.end_time
    if begin < first - slack:
        log.info("startTime is %g; the fields begin at %g, and so does the replay", begin, first)
        begin = float(first)
    steps = round((end - begin) / step)
    if begin + steps * step > last + slack:
        steps = int(np.floor((last - begin + slack) / step))
        log.info("endTime is %g; the fields end at %g, the replay at %g", end, last, begin + steps * step)
    if steps < 1:
        raise CaseError(
            f"{scene.case}/system/controlDict: from startTime {scene.start_time:g} to endTime "
            f"{scene.end_time:g} there is no step of {step:g} within the fields, {first:.9g} to {last:.9g}"
        )
    end = begin + steps * step
    interval = scene.write_interval * every if every and np.isfinite(scene.write_interval) else 0.0
    refuse_gaps(flow.times, begin, end, interval)
    return begin, end


class _Stored(Carrier):
    """The fields, and what a continued replay must have in common with its beginning."""

    def __init__(self, flow: StoredFlow, scene: Scene, source: dict):
        self.flow, self.scene, self.source = flow, scene, source

    def sample(self, positions: np.ndarray, time: float, need: str):
        return self.flow.sample(positions, time, need)

    def on_cells(self, time: float) -> np.ndarray:
        nx, ny, nz = self.scene.cells
        plane = np.stack(np.meshgrid(0.5, np.arange(ny) + 0.5, np.arange(nz) + 0.5, indexing="ij"), axis=-1)
        planes = (
            plane + np.array([i, 0, 0]) for i in range(nx)
        )  # one by one: places take as much memory as fields
        width = np.divide(self.scene.box, self.scene.cells)
        parts = [self.flow.sample(self.scene.origin + p * width, time, "velocity")[0] for p in planes]
        return np.moveaxis(np.concatenate(parts), -1, 0)

    def save(self, folder: Path) -> None:
        path = folder / SOURCE_FILE
        path.parent.mkdir(parents=True, exist_ok=True)
        write_text(path, json.dumps(self.source, indent=2) + "\n")

    def restore(self, folder: Path, time: float) -> None:
        path = folder / SOURCE_FILE
        try:
            with path.open() as file:
                earlier = json.loads(file.read(MOST))
            if not isinstance(earlier, dict):
                raise ValueError("it holds no entries")
        except (OSError, ValueError, RecursionError) as error:
            raise StateError(f"{path} cannot be read: {error}") from None
        for name, value in self.source.items():
            if earlier.get(name) != value:
                raise CaseError(
                    f"{path}: the replay began with {name} '{earlier.get(name)}', this one has '{value}': "
                    "use the same, or --fresh to start anew"
                )


def _listed(values) -> str:
    return "(" + " ".join(f"{v:.9g}" for v in values) + ")"
