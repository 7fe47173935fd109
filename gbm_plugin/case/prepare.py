"""What a case needs before its solver starts: mesh, initial fields, decomposition."""

from __future__ import annotations

import shutil
from pathlib import Path

from .dictionary import CaseError, Dictionary
from .initial import read_initial_field, write_velocity
from .openfoam import utility
from .scene import Scene
from .times import Start, time_folders


def prepare(scene: Scene, start: Start, ranks: int) -> None:
    """Mesh and initial fields where the case does not have them, decomposed for this many ranks."""
    case = scene.case
    if not start.continues:
        if (case / "system/blockMeshDict").is_file():
            utility(case, "blockMesh")
        initial_fields(scene)
    if not (case / "constant/polyMesh/points").is_file() and not (
        case / "constant/polyMesh/points.gz"
    ).is_file():
        raise CaseError(f"{case} has no mesh (constant/polyMesh) and no system/blockMeshDict to make one")
    (case / f"{case.name}.foam").touch()  # ParaView opens the case by this name
    _decompose(case, start, ranks)


def initial_fields(scene: Scene) -> None:
    """`0` from `0.orig`, with the velocity of system/initialFieldDict where there is one."""
    case = scene.case
    zero = case / "0"
    if not zero.is_dir():
        if any(abs(t - scene.start_time) < 1e-9 * scene.time_step for t in time_folders(case)):
            return
        if not (case / "0.orig").is_dir():
            raise CaseError(f"{case} has neither a folder 0 nor 0.orig: initial fields are missing")
        shutil.copytree(case / "0.orig", zero)
    if (case / "system/initialFieldDict").is_file() and (case / "0.orig/U").is_file():
        if scene.cells is None:
            raise CaseError(f"{case}/system/initialFieldDict needs a blockMeshDict of one uniform block")
        modes = read_initial_field(case)
        try:
            velocity = modes.on_lattice(scene.cells, offset=0.5)
        except ValueError as error:
            raise CaseError(f"{case}/system/initialFieldDict: {error}") from None
        write_velocity(case / "0.orig/U", zero / "U", velocity)


def ranks_of(case: Path, parallel: bool) -> int:
    """Ranks of a run: 1, or those of system/decomposeParDict."""
    if not parallel:
        return 1
    return Dictionary.read(case, "system/decomposeParDict").integer("numberOfSubdomains", least=1)


def reconstruct(case: Path) -> None:
    """The time folders of a decomposed run that are not yet in the case itself."""
    decomposed = {name for name in time_folders(case).values() if (case / "processor0" / name / "U").is_file()}
    if any(not (case / name).is_dir() for name in decomposed):
        utility(case, "reconstructPar", "-newTimes")


def _decompose(case: Path, start: Start, ranks: int) -> None:
    """Make the folders that this number of ranks reads, from those that are there; none is lost."""
    present = len(list(case.glob("processor[0-9]*")))
    if present == (ranks if ranks > 1 else 0):
        return
    if present and start.continues:
        reconstruct(case)
    if ranks > 1:
        utility(case, "decomposePar", "-force", "-copyUniform", "-time", f"{start.time:.12g}")
    elif present:
        for folder in case.glob("processor[0-9]*"):
            shutil.rmtree(folder)
