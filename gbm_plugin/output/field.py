"""Velocity on the uniform box mesh of an OpenFOAM case, as an array."""

from __future__ import annotations

import struct
import zlib
from pathlib import Path

import fluidfoam
import numpy as np
from fluidfoam.readof import OpenFoamFile
from numpy.typing import NDArray

from ..case.layout import numbered, processors

_ALL_DIGITS = 30  # decimals to which fluidfoam rounds: beyond those of any velocity


def latest_time(case: Path | str, field: str) -> str | None:
    """Name of the latest time folder that holds `field`, also in a decomposed case; None if there is none."""
    folders = [f for root in (Path(case), *processors(Path(case))) for f in numbered(root).items()]
    times = [
        (time, path.name) for time, path in folders for end in ("", ".gz") if (path / (field + end)).is_file()
    ]
    return max(times)[1] if times else None


def box_mesh(case: Path | str) -> tuple[tuple[int, int, int], NDArray[np.float64], NDArray[np.float64]]:
    """Cells (nx, ny, nz), origin (3,) and size (3,) [m] of a mesh of one uniform block, x fastest.

    Raises ValueError for any other mesh, FileNotFoundError if there is none.
    """
    folder = Path(case) / "constant" / "polyMesh"
    if not any((folder / name).exists() for name in ("points", "points.gz")):
        raise FileNotFoundError(f"no mesh in {folder}")
    points = OpenFoamFile(str(folder), name="points", verbose=False).values.reshape(-1, 3)
    origin, size = points.min(axis=0), np.ptp(points, axis=0)
    planes = [np.unique(np.round((points[:, i] - origin[i]) / size[i], 9)) for i in range(3)]
    cells = tuple(len(plane) - 1 for plane in planes)
    uniform = all(
        np.allclose(np.diff(plane), 1 / n, rtol=1e-5) for plane, n in zip(planes, cells, strict=True)
    )
    owner, neighbour = (
        np.asarray(OpenFoamFile(str(folder), name=name, verbose=False).values, dtype=np.int64)
        for name in ("owner", "neighbour")
    )
    # in a block with x fastest, neighbours across a face differ by one of three strides
    steps = np.unique(neighbour - owner[: len(neighbour)])
    strides = {stride for stride, n in zip((1, cells[0], cells[0] * cells[1]), cells, strict=True) if n > 1}
    if not uniform or owner.max() + 1 != np.prod(cells) or not set(steps.tolist()) <= strides:
        raise ValueError(f"the mesh in {folder} is not one block of equal cells, x fastest")
    return cells, origin, size


def read_velocity(case: Path | str, time: str, cells: tuple[int, int, int]) -> NDArray[np.float64]:
    """U of a time folder through fluidfoam, (3, nx, ny, nz) [m/s], also of a decomposed case. Raises ValueError
    for another count, or a file that is not whole."""
    try:
        values = fluidfoam.readvector(str(case), time, "U", precision=_ALL_DIGITS, verbose=False)
    except (OSError, EOFError, ValueError, IndexError, KeyError, struct.error, zlib.error) as error:
        if isinstance(error, FileNotFoundError):
            raise
        raise ValueError(f"{case}/{time}/U cannot be read, it may be cut off: {error}") from None
    values = values.reshape(3, -1)
    if values.shape[1] == 1:  # a uniform field
        values = np.broadcast_to(values, (3, int(np.prod(cells))))
    if values.shape[1] != np.prod(cells):
        raise ValueError(f"{case}/{time}/U has {values.shape[1]} values for {np.prod(cells)} cells")
    return values.reshape(3, *cells, order="F")


def vorticity_magnitude(velocity: NDArray, size: NDArray) -> NDArray[np.float64]:
    """|∇×u| (nx, ny, nz) [1/s] of a periodic field (3, nx, ny, nz), by central differences."""
    spacing = np.asarray(size) / velocity.shape[1:]

    def d(component: int, axis: int) -> NDArray:
        u = velocity[component]
        return (np.roll(u, -1, axis) - np.roll(u, 1, axis)) / (2 * spacing[axis])

    return np.sqrt(sum((d((i + 2) % 3, (i + 1) % 3) - d((i + 1) % 3, (i + 2) % 3)) ** 2 for i in range(3)))
