"""Velocity on the uniform box mesh of an OpenFOAM case, as an array."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ..case.foamfile import read_field, read_list
from ..case.layout import numbered, processors, velocity_file


def latest_time(case: Path | str, field: str) -> str | None:
    """Name of the latest time folder that holds `field`, also in a decomposed case; None if there is none."""
    folders = [f for root in (Path(case), *processors(Path(case))) for f in numbered(root).items()]
    times = [
        (time, path.name) for time, path in folders for end in ("", ".gz") if (path / (field + end)).is_file()
    ]
    return max(times)[1] if times else None


def read_velocity(
    case: Path | str, time: str, cells: tuple[int, int, int], name: str = "U"
) -> NDArray[np.float64]:
    """U, or another vector, of a time folder, (3, nx, ny, nz) [m/s], also of a decomposed case. Raises ValueError for
    another count, or a file that is not whole."""
    case, count = Path(case), int(np.prod(cells))
    parts = processors(case)
    if velocity_file(case / time) is not None or not parts:
        values = _of_cells(case / time / name, count)
    else:
        values = np.empty((count, 3))
        left = np.ones(count, dtype=bool)
        for part in parts:
            file = part / "constant/polyMesh/cellProcAddressing"
            places = read_list(file)
            if places.ndim != 1 or (len(places) and not 0 <= places.min() <= places.max() < count):
                raise ValueError(f"{file} names cells that are not among the {count} of the mesh")
            values[places] = _of_cells(part / time / name, len(places))
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
