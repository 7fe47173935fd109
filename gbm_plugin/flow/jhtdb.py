"""Cut-outs of the Johns Hopkins Turbulence Databases, as giverny, pyJHTDB and the web service write them.

An HDF5 file with velocity_0001, velocity_0011, … (nz, ny, nx, 3), float32, a data set for each stored time, and the
coordinates xcoor, ycoor, zcoor of its points.
"""

from __future__ import annotations

import re
from pathlib import Path
from typing import NamedTuple

import h5py
import numpy as np
from numpy.typing import ArrayLike, NDArray

from .stored import StoredFlow

AXES = ("xcoor", "ycoor", "zcoor")
UNEVEN = 1e-3  # of a spacing: single precision of the coordinates, and less than any stretched mesh


class _DataSet(NamedTuple):
    """Time between stored fields, of which the first is number 1 at time 0, and width of the periodic box."""

    interval: float
    box: float


DATA_SETS = {
    "isotropic1024coarse": _DataSet(0.002, 2 * np.pi),
    "isotropic1024fine": _DataSet(0.0002, 2 * np.pi),
    "mixing": _DataSet(0.04, 2 * np.pi),
}


def jhtdb_flow(
    path: Path | str,
    data_set: str | None = None,
    times: ArrayLike | None = None,
    box: ArrayLike | None = None,
    interpolation: str = "cubic",
    in_time: str = "cubic",
) -> StoredFlow:
    """The flow in a cut-out, read field by field.

    data_set: one of DATA_SETS, from which times and box follow; else times (T,) [s] of the fields in the order of
    their numbers are needed where there are several (one is a steady flow). box: width of the periodic box, one or
    three [m]; a cut-out that fills it is periodic, any other is bounded, and fibers that leave it stop there.
    interpolation, in_time: as in StoredFlow. ValueError, with the file's name, for a file of another layout.
    """
    path = Path(path)
    if data_set is not None and data_set not in DATA_SETS:
        raise ValueError(
            f"data_set is {data_set!r}; known are {', '.join(DATA_SETS)}: of others give times and box"
        )
    if not path.is_file():
        raise FileNotFoundError(f"there is no file {path}")
    known = DATA_SETS.get(data_set) if data_set else None
    try:
        with h5py.File(path, "r") as file:
            names = _fields(file)
            first, spacing, shape = _lattice(file, file[names[0]].shape)
        numbers = np.array([int(name.rpartition("_")[2]) for name in names])
        if times is None:
            if known is None and len(names) > 1:
                raise ValueError(f"it has {len(names)} fields: give their times, or the data set")
            times = (numbers - 1) * known.interval if known else [0.0]
        if len(np.atleast_1d(times)) != len(names):
            raise ValueError(f"{len(np.atleast_1d(times))} times are given for its {len(names)} fields")
        whole = box if box is not None else known.box if known else None
        periodic = whole is not None and np.allclose(spacing * shape, whole, rtol=UNEVEN)
        widths = np.broadcast_to(np.asarray(whole, dtype=float), (3,)) if periodic else spacing * (shape - 1)
        return StoredFlow(
            times,
            lambda n: _read(path, names[n]),
            widths,
            first,
            0.0,
            interpolation,
            in_time,
            periodic,
            steady=len(names) == 1,
        )
    except (ValueError, KeyError, OSError) as error:
        raise ValueError(f"{path}: {error}") from None


def _fields(file: h5py.File) -> list[str]:
    """Names of the velocity fields, in the order of their numbers."""
    found = [name for name in file if re.fullmatch(r"velocity_\d+", name, re.IGNORECASE)]
    lacking = [] if found else ["velocity_0001"]
    lacking += [axis for axis in AXES if axis not in file]
    if lacking:
        raise ValueError(f"it lacks {', '.join(lacking)}")
    return sorted(found, key=lambda name: int(name.rpartition("_")[2]))


def _lattice(file: h5py.File, shape: tuple[int, ...]) -> tuple[NDArray, NDArray, NDArray]:
    """First point (3,), spacing (3,) and number (3,) of points of an even lattice."""
    axes = [np.asarray(file[axis][()], dtype=float).ravel() for axis in AXES]
    counts = np.array([len(axis) for axis in axes])
    if shape != (*counts[::-1], 3):
        raise ValueError(f"velocity has shape {shape}; its coordinates need {(*counts[::-1].tolist(), 3)}")
    if (counts < 4).any():
        raise ValueError(
            f"it has {' x '.join(map(str, counts))} points; 4 in each direction are needed at least"
        )
    spacing = np.array([(axis[-1] - axis[0]) / (len(axis) - 1) for axis in axes])
    for name, axis, step in zip(AXES, axes, spacing, strict=True):
        if not step > 0 or np.abs(np.diff(axis) / step - 1).max() > UNEVEN:
            raise ValueError(f"{name} is not even: stretched meshes are not supported")
    return np.array([axis[0] for axis in axes]), spacing, counts


def _read(path: Path, name: str) -> NDArray:
    """One field as (3, nx, ny, nz)."""
    with h5py.File(path, "r") as file:
        return np.ascontiguousarray(np.transpose(file[name][()], (3, 2, 1, 0)), dtype=float)
