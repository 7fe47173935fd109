"""OpenFOAM's own cloud of beads, lagrangian/fibers, completed with what OpenFOAM does not know of them."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ..case.foamfile import read_list
from ..case.layout import FIBERS, find_state, time_folders
from ..case.scene import Scene
from ..case.trust import refuse_links_out
from ..errors import StateError
from ..files import replaced
from ..statistics.fibers import bead_curvature, bead_tension
from .fleet import Fleet

PLACE = f"lagrangian/{FIBERS}"
LABELS = ("family", "fiber", "bead")  # which OpenFOAM writes; fiber counts over all families
_HEADER = """FoamFile
{{
    version     2.0;
    format      binary;
    class       {kind}Field;
    arch        "LSB;label=32;scalar=64";
    location    "{time}/{place}";
    object      {name};
}}

{count}
("""


def complete_clouds(scene: Scene) -> list[str]:
    """Beside the labels of each time's cloud: curvature [1/m], velocity [m/s], radius [m], stiffness K^b [N m2] and
    tension [N] of each bead, by the state of the fibers at that time. Times that have them stay as they are.

    Returns the names of the times written. Raises StateError or ValueError where a state or a cloud is not of the
    scene's fibers.
    """
    case, fleet, written = scene.case, None, []
    for name in time_folders(case).values():
        folder, state = case / name / PLACE, find_state(case, name)
        if state is None or not _is_there(folder / "bead") or _is_there(folder / "stiffness"):
            continue
        refuse_links_out(case, case / name)
        fleet = fleet or Fleet.seeded(scene, np.zeros(3), scene.box or np.ones(3), 0.0)
        fleet.restore(state)
        places = _places(fleet, folder)
        for field, values in _values(fleet).items():  # stiffness comes last: it says that all are there
            _write(folder / field, name, values[places])
        written.append(name)
    return written


def _is_there(file: Path) -> bool:
    return file.is_file() or file.with_name(f"{file.name}.gz").is_file()


def _values(fleet: Fleet) -> dict[str, NDArray]:
    """At all beads of the fleet, in its order."""
    steppers = fleet.steppers
    pairs = list(zip(fleet.by_family, steppers, strict=True))
    each = {
        "curvature": [bead_curvature(x, s.fibers.radius) for x, s in pairs],
        "velocity": [s.bead_velocities for s in steppers],
        "tension": [bead_tension(s.tension) for s in steppers],
        "radius": [np.full(x.shape[:2], s.fibers.radius) for x, s in pairs],
        "stiffness": [np.broadcast_to(s.fibers.bending_stiffness[:, None], x.shape[:2]) for x, s in pairs],
    }
    return {
        name: np.concatenate([v.reshape(-1, *v.shape[2:]) for v in values]) for name, values in each.items()
    }


def _places(fleet: Fleet, folder: Path) -> NDArray[np.int64]:
    """For each particle of a cloud, which bead of the fleet it is."""
    family, fiber, bead = (read_list(folder / name) for name in LABELS)
    counts, beads = (np.array(n) for n in zip(*((c, b) for c, b, _ in fleet.sizes), strict=True))
    first = np.cumsum([0, *counts])
    start = np.cumsum([0, *(counts * beads)])
    if not len(family) == len(fiber) == len(bead) == fleet.beads:
        raise StateError(f"{folder} has {len(bead)} beads, the case has {fleet.beads}")
    known = (family >= 0) & (family < len(counts))
    own = np.where(known, family, 0)
    places = start[own] + (fiber - first[own]) * beads[own] + bead
    known &= (bead >= 0) & (bead < beads[own]) & (first[own] <= fiber) & (fiber < first[own + 1])
    if not known.all() or len(np.unique(places)) != fleet.beads:
        raise StateError(f"{folder} has beads that are not those of the case's families")
    return places


def _write(file: Path, time: str, values: NDArray) -> None:
    kind = "vector" if values.ndim == 2 else "scalar"
    head = _HEADER.format(kind=kind, time=time, place=PLACE, name=file.name, count=len(values))
    with replaced(file, "wb") as content:
        content.write(head.encode() + np.ascontiguousarray(values, "<f8").tobytes() + b")\n")
