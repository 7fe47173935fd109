"""What a case needs before its solver starts: mesh, initial fields, decomposition."""

from __future__ import annotations

import shutil
from pathlib import Path

from ..errors import CaseError
from ..files import created
from .dictionary import Dictionary
from .initial import is_made_here, read_initial_field, write_velocity
from .layout import fiber_state, processors, time_folders, velocity_file
from .openfoam import utility
from .scene import Scene
from .times import Start, move_aside
from .trust import refuse_links_out


def prepare(scene: Scene, start: Start, ranks: int) -> None:
    """Mesh and initial fields where the case does not have them, decomposed for this many ranks."""
    case = scene.case
    if not start.continues:
        if _mesh_time(case) < _newest(case / "system/blockMeshDict"):
            refuse_links_out(case, case / "constant/polyMesh")
            utility(case, "blockMesh")
        initial_fields(scene)
    if not _mesh_time(case):
        raise CaseError(f"{case} has no mesh (constant/polyMesh) and no system/blockMeshDict to make one")
    if not (case / f"{case.name}.foam").is_file():  # ParaView opens the case by this name
        created(case / f"{case.name}.foam").close()
    _decompose(case, start, ranks)


def _mesh_time(case: Path) -> float:
    return _newest(case / "constant/polyMesh/points", case / "constant/polyMesh/points.gz")


def _newest(*files: Path) -> float:
    """When the newest of these files was written; 0 where there is none."""
    return max((f.stat().st_mtime for f in files if f.is_file()), default=0.0)


def initial_fields(scene: Scene) -> None:
    """`0` from `0.orig`, with the velocity of system/initialFieldDict where there is one.

    A velocity that is there already is only made anew if it was made here, and its dictionaries are newer.
    """
    case = scene.case
    zero = case / "0"
    made = not zero.is_dir()
    if made:
        if any(abs(t - scene.start_time) < 1e-9 * scene.time_step for t in time_folders(case)):
            return
        if not (case / "0.orig").is_dir():
            raise CaseError(f"{case} has neither a folder 0 nor 0.orig: initial fields are missing")
        shutil.copytree(case / "0.orig", zero)
    dictionary, velocity = case / "system/initialFieldDict", zero / "U"
    if not dictionary.is_file() or not (case / "0.orig/U").is_file():
        return
    newer = _newest(dictionary, case / "system/blockMeshDict") > _newest(velocity)
    if made or (newer and is_made_here(velocity)):
        if scene.cells is None:
            raise CaseError(f"{dictionary} needs a blockMeshDict of one uniform block")
        modes = read_initial_field(case)
        try:
            field = modes.on_lattice(scene.cells, offset=0.5)
        except ValueError as error:
            raise CaseError(f"{dictionary}: {error}") from None
        write_velocity(case / "0.orig/U", velocity, field)


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


def _decompose(case: Path, start: Start, ranks: int) -> None:
    """Make the folders that this number of ranks reads, from those that are there; none is lost."""
    present = processors(case)
    if start.continues and len(present) == (ranks if ranks > 1 else 0):
        return
    if present:
        if start.continues:
            reconstruct(case)
        move_aside(case, present)
    if ranks > 1:
        utility(case, "decomposePar", "-force", "-copyUniform", "-time", f"{start.time:.12g}")
