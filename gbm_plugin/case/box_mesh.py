"""A mesh for ParaView: constant/polyMesh of one block of equal cells, written here, so that no program is run."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ..files import replaced
from .mesh import Box

MOST = 4_000_000  # cells: the mesh of more takes more than a time folder
_HEADER = """FoamFile
{{
    version     2.0;
    format      {format};
    class       {kind};
    arch        "LSB;label=32;scalar=64";
    location    "constant/polyMesh";
    object      {name};
}}

"""
_SIDES = ("xLow", "xHigh", "yLow", "yHigh", "zLow", "zHigh")


def write_box_mesh(folder: Path, box: Box) -> None:
    """Write points, faces, owner, neighbour and boundary (six patches) into `folder`: cells with x fastest, faces in
    the order that OpenFOAM's matrices want. Raises OSError where there is no room."""
    folder.mkdir(parents=True, exist_ok=True)
    n = np.array(box.cells)
    planes = [o + s * np.arange(m + 1) / m for o, s, m in zip(box.origin, box.size, box.cells, strict=True)]
    z, y, x = np.meshgrid(*planes[::-1], indexing="ij")
    _write(folder / "points", "vectorField", [np.stack([x, y, z], axis=-1).reshape(-1, 3)], "<f8")

    cell = np.arange(n.prod()).reshape(n[::-1])  # [k, j, i]
    point = np.arange((n + 1).prod()).reshape((n + 1)[::-1])
    stride, step = np.array([1, n[0], n[0] * n[1]]), np.array([1, n[0] + 1, (n[0] + 1) * (n[1] + 1)])
    low = point[:-1, :-1, :-1]  # of each cell, its lowest corner
    k, j, i = np.indices(n[::-1], sparse=True)
    inner = np.stack(  # whether there is a next cell
        np.broadcast_arrays(*(at < m - 1 for at, m in zip((i, j, k), n, strict=True))), axis=-1
    )
    beyond = np.stack(
        [_face(low + step[axis], axis, step) for axis in range(3)], axis=-2
    )  # [k, j, i, axis, 4]
    owners = [np.broadcast_to(cell[..., None], inner.shape)[inner]]
    neighbours = (cell[..., None] + stride)[inner]
    faces, starts = [beyond[inner]], [len(neighbours)]
    for axis in range(3):
        first, last = (np.take(cell, at, axis=2 - axis).ravel() for at in (0, n[axis] - 1))
        corner = low.ravel()
        owners += [first, last]
        faces += [_face(corner[first], axis, step)[:, ::-1], _face(corner[last] + step[axis], axis, step)]
        starts += [len(first), len(last)]
    owner, face = np.concatenate(owners), np.concatenate(faces)
    _write(folder / "owner", "labelList", [owner], "<i4")
    _write(folder / "neighbour", "labelList", [neighbours], "<i4")
    _write(folder / "faces", "faceCompactList", [4 * np.arange(len(face) + 1), face.ravel()], "<i4")
    ends = np.cumsum(starts)
    patches = "".join(
        f"    {name} {{ type patch; nFaces {count}; startFace {end}; }}\n"
        for name, count, end in zip(_SIDES, starts[1:], ends[:-1], strict=True)
    )
    with replaced(folder / "boundary") as file:
        head = _HEADER.format(format="ascii", kind="polyBoundaryMesh", name="boundary")
        file.write(f"{head}6\n(\n{patches})\n")


def _face(corner: NDArray, axis: int, step: NDArray) -> NDArray:
    """The corners of a face across an axis, from its lowest one, with the normal along the axis."""
    b, c = step[(axis + 1) % 3], step[(axis + 2) % 3]
    return np.stack([corner, corner + b, corner + b + c, corner + c], axis=-1)


def _write(file: Path, kind: str, lists: list[NDArray], dtype: str) -> None:
    with replaced(file, "wb") as content:
        content.write(_HEADER.format(format="binary", kind=kind, name=file.name).encode())
        for values in lists:
            content.write(f"{len(values)}\n(".encode())
            content.write(np.ascontiguousarray(values, dtype).tobytes())
            content.write(b")\n")
