"""Velocity on the uniform box mesh of an OpenFOAM case, as an array."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ..case.layout import numbered, processors, velocity_file
from .foamfile import read_field, read_list


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


def read_velocity(case: Path | str, time: str, cells: tuple[int, int, int]) -> NDArray[np.float64]:
    """U of a time folder, (3, nx, ny, nz) [m/s], also of a decomposed case. Raises ValueError for another count, or
    a file that is not whole."""
    case, count = Path(case), int(np.prod(cells))
    parts = processors(case)
    if velocity_file(case / time) is not None or not parts:
        values = _of_cells(case / time / "U", count)
    else:
        values = np.empty((count, 3))
        left = np.ones(count, dtype=bool)
        for part in parts:
            file = part / "constant/polyMesh/cellProcAddressing"
            places = read_list(file)
            if places.ndim != 1 or (len(places) and not 0 <= places.min() <= places.max() < count):
                raise ValueError(f"{file} names cells that are not among the {count} of the mesh")
            values[places] = _of_cells(part / time / "U", len(places))
            left[places] = False
        if left.any():
            raise ValueError(f"{case}: no processor folder has the cell {int(left.argmax())} of the mesh")
    return values.reshape(*cells[::-1], 3).transpose()


def _of_cells(file: Path, count: int) -> NDArray[np.float64]:
    """The velocity (count, 3) of a file."""
    values = read_field(file, "vector", most=count)
    if len(values) not in (1, count):
        raise ValueError(f"{file} has {len(values)} values for {count} cells")
    return np.broadcast_to(values, (count, 3))


def vorticity_magnitude(velocity: NDArray, size: NDArray) -> NDArray[np.float64]:
    """|∇×u| (nx, ny, nz) [1/s] of a periodic field (3, nx, ny, nz), by central differences."""
    spacing = np.asarray(size) / velocity.shape[1:]

    def d(component: int, axis: int) -> NDArray:
        u = velocity[component]
        return (np.roll(u, -1, axis) - np.roll(u, 1, axis)) / (2 * spacing[axis])

    return np.sqrt(sum((d((i + 2) % 3, (i + 1) % 3) - d((i + 1) % 3, (i + 2) % 3)) ** 2 for i in range(3)))
