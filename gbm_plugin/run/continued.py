"""A run that continues: what was changed since it began is said, and what cannot change is refused."""

from __future__ import annotations

import logging

import numpy as np

from ..case.changes import changes
from ..case.layout import results
from ..case.scene import Scene
from ..errors import CaseError
from ..output.recording import open_recording

log = logging.getLogger(__name__)


def compare(scene: Scene) -> None:
    """One line of what differs from the dictionaries of the part before. CaseError where the box does."""
    try:
        with open_recording(results(scene.case)) as recording:
            before, box = recording.metadata["dictionaries"], (recording.box_origin, recording.box_size)
    except (FileNotFoundError, ValueError):  # a flow without fibers, or a part that was killed when it began
        return
    if scene.box is not None and not np.allclose(
        box, (scene.origin, scene.box), rtol=0, atol=1e-5 * max(scene.box)
    ):
        raise CaseError(
            f"{scene.case}: the box of the mesh was {_listed(box[1])} from {_listed(box[0])} when the run began, and "
            f"is {_listed(scene.box)} from {_listed(scene.origin)}: restore the mesh, or --fresh begins again"
        )
    if found := changes(before, scene.texts):
        log.info("changed since the start: %s", ", ".join(found))


def _listed(values) -> str:
    return "(" + " ".join(f"{v:.6g}" for v in values) + ")"
