"""Velocity fields of any code in an HDF5 file of a plain layout.

    time      (T,)               [s], increasing
    velocity  (T, 3, nx, ny, nz) [m/s], [t, c, i, j, k] at (x_i, y_j, z_k); any precision, chunks and compression
    box       (3,)               [m], widths of the periodic box
    origin    (3,)               [m], its lower corner; without it (0, 0, 0)
    location  "nodes"            x_i = origin + i box/nx, or
              "centres"          x_i = origin + (i + 1/2) box/nx

time and velocity are datasets; box, origin and location are attributes of the file or datasets in it.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import h5py
import numpy as np
from numpy.typing import NDArray

from .stored import LOCATIONS, StoredFlow


def hdf5_flow(path: Path | str, interpolation: str = "trilinear", in_time: str = "cubic") -> StoredFlow:
    """The flow in a file, read field by field; words as in StoredFlow. ValueError, with the file's name, for a
    file that is not of this layout."""
    path = Path(path)
    try:
        with _opened(path) as file:
            missing = [name for name in ("time", "velocity") if not isinstance(file.get(name), h5py.Dataset)]
            missing += [name for name in ("box", "location") if name not in file and name not in file.attrs]
            if missing:
                raise ValueError(f"it lacks {', '.join(missing)}")
            times = np.asarray(file["time"][()], dtype=float)
            velocity = file["velocity"]
            shape = (*times.shape, 3, "nx", "ny", "nz")
            if velocity.ndim != 5 or velocity.shape[:2] != shape[:2]:
                wanted = ", ".join(map(str, shape))
                raise ValueError(f"velocity has shape {velocity.shape}; ({wanted}) is needed")
            box, origin, location = (_value(file, name) for name in ("box", "origin", "location"))
        location = location.decode() if isinstance(location, bytes) else location
        if location not in LOCATIONS:
            raise ValueError(f"location is '{location}'; allowed: {' '.join(LOCATIONS)}")
        return StoredFlow(
            times,
            lambda number: _read(path, number),
            np.asarray(box, dtype=float),
            np.zeros(3) if origin is None else np.asarray(origin, dtype=float),
            LOCATIONS[location],
            interpolation,
            in_time,
        )
    except (ValueError, TypeError, KeyError) as error:
        raise ValueError(f"{path}: {error}") from None


def _opened(path: Path) -> h5py.File:
    if not path.is_file():
        raise FileNotFoundError(f"there is no file {path}")
    try:
        return h5py.File(path, "r")
    except OSError as error:
        raise ValueError(f"it cannot be read as HDF5: {error}") from None


def _value(file: h5py.File, name: str) -> Any:
    """An attribute, or else a dataset; None where there is neither."""
    if name in file.attrs:
        return file.attrs[name]
    return file[name][()] if name in file else None


def _read(path: Path, number: int) -> NDArray:
    with _opened(path) as file:
        return file["velocity"][number]
