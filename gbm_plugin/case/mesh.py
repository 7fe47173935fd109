"""The box of a case: `constant/polyMesh` decides; without one, system/blockMeshDict says what it will be."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ..errors import CaseError
from .dictionary import Dictionary
from .foamfile import read_list


@dataclass(frozen=True)
class Box:
    """One block of equal cells, x fastest: size and origin (3,) [m], cells (3,)."""

    size: tuple[float, float, float]
    origin: tuple[float, float, float]
    cells: tuple[int, int, int]

    def differs(self, other: Box) -> bool:
        """In its cells, or by more than the digits of a mesh in ascii."""
        scale = max(other.size)
        close = np.allclose(self.size + self.origin, other.size + other.origin, rtol=0, atol=1e-5 * scale)
        return self.cells != other.cells or not close

    def __str__(self) -> str:
        nx, ny, nz = self.cells
        return f"{nx} x {ny} x {nz} cells in ({' '.join(f'{b:g}' for b in self.size)})"


def has_mesh(case: Path) -> bool:
    return any((case / "constant/polyMesh" / name).exists() for name in ("points", "points.gz"))


def read_box(case: Path) -> Box | None:
    """The box of a case's mesh, or without one that of system/blockMeshDict; None where it is something else."""
    if not has_mesh(case):
        return described_box(case)
    try:
        cells, origin, size = box_mesh(case)
    except ValueError:
        return None
    return Box(tuple(size.tolist()), tuple(origin.tolist()), cells)


def difference(case: Path) -> str | None:
    """One line where the mesh is another than system/blockMeshDict describes; None where they agree, or one of them is
    no box."""
    described = described_box(case)
    mesh = read_box(case) if described and has_mesh(case) else None
    if mesh is None or not mesh.differs(described):
        return None
    return (
        f"constant/polyMesh, which decides, has {mesh}; system/blockMeshDict describes {described}: remove "
        "constant/polyMesh to have it made anew"
    )


def described_box(case: Path) -> Box | None:
    """One block of equal cells in system/blockMeshDict; None for what is another or cannot be read."""
    try:
        d = Dictionary.read(case, "system/blockMeshDict")
        scale = d.number("convertToMeters", d.number("scale", 1.0))
        vertices = np.array([list(v) for v in d.raw("vertices")], dtype=float) * scale
        _, corners, cells, grading, ratios = d.raw("blocks")
        low, size = vertices.min(axis=0), np.ptp(vertices, axis=0)
        box = vertices.shape == (8, 3) and np.allclose(
            vertices, low + size * _CORNERS, atol=1e-9 * size.max()
        )
        equal = grading == "simpleGrading" and [float(r) for r in ratios] == [1, 1, 1]
        if not box or not equal or [int(c) for c in corners] != list(range(8)):
            return None
        nx, ny, nz = (int(n) for n in cells)
    except (CaseError, TypeError, ValueError):
        return None
    return Box(tuple(size.tolist()), tuple(low.tolist()), (nx, ny, nz))


# corners of a box in blockMesh's order
_CORNERS = np.array([(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0), (0, 0, 1), (1, 0, 1), (1, 1, 1), (0, 1, 1)])


def box_mesh(case: Path | str) -> tuple[tuple[int, int, int], NDArray[np.float64], NDArray[np.float64]]:
    """Cells (nx, ny, nz), origin (3,) and size (3,) [m] of a mesh of one uniform block, x fastest.

    Raises ValueError for any other mesh, FileNotFoundError if there is none.
    """
    folder = Path(case) / "constant" / "polyMesh"
    if not any((folder / name).exists() for name in ("points", "points.gz")):
        raise FileNotFoundError(f"no mesh in {folder}")
    points, owner, neighbour = (read_list(folder / name) for name in ("points", "owner", "neighbour"))
    if points.ndim != 2 or not np.isfinite(points).all() or not len(points) or not len(owner):
        raise ValueError(f"{folder}: points or owner are not those of a mesh")
    origin, size = points.min(axis=0), np.ptp(points, axis=0)
    if not (size > 0).all() or not np.isfinite(size).all():
        raise ValueError(f"the mesh in {folder} is flat")
    planes = [np.unique(np.round((points[:, i] - origin[i]) / size[i], 9)) for i in range(3)]
    cells = tuple(len(plane) - 1 for plane in planes)
    uniform = all(
        np.allclose(np.diff(plane), 1 / n, rtol=1e-5) for plane, n in zip(planes, cells, strict=True)
    )
    # in a block with x fastest, neighbours across a face differ by one of three strides
    steps = np.unique(neighbour - owner[: len(neighbour)]) if len(neighbour) <= len(owner) else [-1]
    strides = {stride for stride, n in zip((1, cells[0], cells[0] * cells[1]), cells, strict=True) if n > 1}
    if not uniform or int(owner.max()) + 1 != np.prod(cells) or not set(map(int, steps)) <= strides:
        raise ValueError(f"the mesh in {folder} is not one block of equal cells, x fastest")
    return cells, origin, size
