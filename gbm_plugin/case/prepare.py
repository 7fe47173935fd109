"""What a case needs before its solver starts: mesh, initial fields, decomposition.

What a failed or interrupted preparation leaves is never taken for a start: it is made again, or refused again.
"""

from __future__ import annotations

import logging
import shutil
from dataclasses import replace
from pathlib import Path

from ..errors import CaseError
from ..files import created
from . import made
from .dictionary import Dictionary
from .initial import read_initial_field, write_velocity
from .layout import fiber_state, processors, time_folders, velocity_file
from .mesh import difference, has_mesh, read_box
from .openfoam import utility
from .scene import Scene, box_of
from .times import ZERO, Start, is_same_time, move_aside, replaceable_zero
from .trust import refuse_links_out

log = logging.getLogger(__name__)

MESH = "mesh"


def prepare(scene: Scene, start: Start, ranks: int) -> Scene:
    """Mesh and initial fields where the case does not have them, decomposed for this many ranks. The scene as it is
    then, of whose box the mesh decides."""
    case = scene.case
    if not start.continues:
        make_mesh(case)
        scene = replace(scene, **box_of(read_box(case)))
        initial_fields(scene, start.time)
    if not has_mesh(case) and not processors(case):
        raise CaseError(f"{case} has no mesh (constant/polyMesh) and no system/blockMeshDict to make one")
    name_for_paraview(case)
    _decompose(scene, start, ranks)
    return scene


def name_for_paraview(folder: Path) -> None:
    """The empty file by whose name ParaView opens a case."""
    if not (folder / f"{folder.name}.foam").is_file():
        created(folder / f"{folder.name}.foam").close()


def make_mesh(case: Path) -> None:
    """constant/polyMesh by blockMesh where there is none, or one that gbm made after another blockMeshDict.

    A mesh of somebody else's making stays, and decides; where blockMeshDict describes another box, one line says so.
    """
    dictionary = case / "system/blockMeshDict"
    source = dictionary.read_text(errors="replace") if dictionary.is_file() else ""
    if has_mesh(case) and not made.is_half_made(case, MESH):
        outdated = not made.is_made_from(case, MESH, source) and made.is_own(case, MESH)
        if not source or not outdated:
            if source and (text := difference(case)):
                log.info("%s", text)
            return
    elif not source:
        raise CaseError(f"{case} has no mesh (constant/polyMesh) and no system/blockMeshDict to make one")
    refuse_links_out(case, case / "constant/polyMesh")
    made.note_begin(case, MESH)
    utility(case, "blockMesh")
    made.note_made(case, MESH, (p for p in (case / "constant/polyMesh").iterdir() if p.is_file()), source)


def initial_fields(scene: Scene, begin: float = 0.0) -> None:
    """For a run that begins at time 0: `0` from `0.orig`, with the velocity of system/initialFieldDict where there is
    one; whole or not at all. A `0` that gbm did not make stays as it is, and so does one that nothing can replace.
    """
    case = scene.case
    zero = case / ZERO
    if begin != 0:
        return
    if zero.is_dir():
        if not replaceable_zero(case):
            return
    elif (parts := processors(case)) and all(velocity_file(p / ZERO) for p in parts):
        return
    elif not velocity_file(case / "0.orig"):
        raise CaseError(f"{case} has neither a folder 0 nor 0.orig with a U: initial fields are missing")
    part = case / ".0.part"
    shutil.rmtree(part, ignore_errors=True)
    shutil.copytree(case / "0.orig", part)
    try:
        if (case / "system/initialFieldDict").is_file():
            _initial_velocity(scene, case / "0.orig/U", part / "U")
        if zero.is_dir() and any(not (part / p.relative_to(zero)).exists() for p in zero.rglob("*")):
            move_aside(case, [zero])  # with what somebody put there
        shutil.rmtree(zero, ignore_errors=True)
        part.rename(zero)
    finally:
        shutil.rmtree(part, ignore_errors=True)
    made.note_made(case, ZERO, (p for p in zero.rglob("*") if p.is_file()))


def _initial_velocity(scene: Scene, template: Path, target: Path) -> None:
    dictionary = scene.case / "system/initialFieldDict"
    if not template.is_file():
        raise CaseError(f"{dictionary} is there, and no {template} whose form its velocity could take")
    if scene.cells is None:
        raise CaseError(f"{dictionary} needs a mesh of one block of equal cells")
    modes = read_initial_field(scene.case).modes
    try:
        field = modes.on_lattice(scene.cells, offset=0.5)
    except ValueError as error:
        raise CaseError(f"{dictionary}: {error}") from None
    write_velocity(template, target, field)


def ranks_of(case: Path, parallel: bool) -> int:
    """Ranks of a run: 1, or those of system/decomposeParDict."""
    if not parallel:
        return 1
    return Dictionary.read(case, "system/decomposeParDict").integer("numberOfSubdomains", least=1)


def reconstruct(case: Path) -> None:
    """The time folders of a decomposed run that are not yet in the case itself, or not wholly."""
    parts = case / "processor0"
    names = [n for n in time_folders(case).values() if velocity_file(parts / n)]
    # the state comes last, so a folder without it is what a killed reconstructPar left
    cut = [n for n in names if fiber_state(parts / n) and not fiber_state(case / n)]
    if left := [case / n for n in cut if (case / n).is_dir()]:
        move_aside(case, left)
    if any(not (case / n).is_dir() for n in names):
        utility(case, "reconstructPar", "-newTimes")


def _decompose(scene: Scene, start: Start, ranks: int) -> None:
    """Make the folders that this number of ranks reads, from those that are there; none is lost."""
    case = scene.case
    present = processors(case)
    names = [n for t, n in time_folders(case).items() if is_same_time(t, start.time, scene.time_step)]
    together = any(velocity_file(case / n) for n in names)
    divided = bool(present) and any(all(velocity_file(p / n) for p in present) for n in names)
    fits = divided and len(present) == ranks if ranks > 1 else not present
    if fits and (start.continues or not together):
        return
    if present:
        if divided and not together:
            reconstruct(case)
        move_aside(case, present)
    if ranks > 1:
        utility(case, "decomposePar", "-force", "-copyUniform", "-time", f"{start.time:.12g}")
