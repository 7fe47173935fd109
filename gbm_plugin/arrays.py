"""Arrays out of files that may have been altered: nothing in them is evaluated, or believed before it is checked."""

from __future__ import annotations

import zipfile
import zlib
from collections.abc import Collection, Mapping
from pathlib import Path
from typing import IO

import numpy as np
from numpy.lib import format as npy

MOST_WORDS = 1 << 20  # bytes of an array of text
Form = tuple[
    str, tuple[int | range, ...]
]  # numbers ("f", "c16", "U" ...) and shape; a range: any length in it


def read_arrays(path: Path, names: Collection[str], most: int) -> dict[str, np.ndarray]:
    """The arrays of a .npz file. ValueError, in words that may follow the file's name, where it is
    damaged, holds others than `names`, or one of more than `most` bytes."""
    if not path.is_file():
        raise ValueError("there is no such file")
    try:
        with zipfile.ZipFile(path) as archive:
            members = {name.removesuffix(".npy"): name for name in archive.namelist()}
            if unknown := sorted(set(members) - set(names)):
                raise ValueError(f"it holds '{unknown[0][:60]}', which is not of it")
            return {name: _read(name, archive.open(member), most) for name, member in members.items()}
    except (OSError, EOFError, RuntimeError, NotImplementedError, zipfile.BadZipFile, zlib.error) as error:
        raise ValueError(str(error) or "it is cut off") from None


def read_array(path: Path) -> np.ndarray:
    """The array of a .npy file. ValueError, in words that may follow the file's name, where it holds none."""
    if not path.is_file():
        raise ValueError("there is no such file")
    try:
        return _read(path.name, path.open("rb"), path.stat().st_size)
    except (OSError, EOFError) as error:
        raise ValueError(str(error)) from None


def check_arrays(
    arrays: Mapping[str, np.ndarray],
    forms: Mapping[str, Form],
    optional: Collection[str] = (),
    infinite: Collection[str] = (),
) -> None:
    """ValueError where one of the forms has no array, but for the optional ones, or one of another kind or shape, or
    one that is not finite, but for infinity where it is allowed."""
    for name, (kind, shape) in forms.items():
        if name not in arrays:
            if name in optional:
                continue
            raise ValueError(f"'{name}' is missing")
        found = arrays[name]
        fits = len(found.shape) == len(shape) and all(
            n in allowed if isinstance(allowed, range) else n == allowed
            for n, allowed in zip(found.shape, shape, strict=True)
        )
        if not found.dtype.str[1:].startswith(kind) or not fits:
            wanted = ", ".join(f"{n.start}...{n.stop - 1}" if isinstance(n, range) else str(n) for n in shape)
            raise ValueError(f"'{name}' is {found.dtype}{found.shape}; {kind}({wanted}) is needed")
        if kind != "U" and (np.isnan(found).any() or (name not in infinite and np.isinf(found).any())):
            raise ValueError(f"'{name}' is not finite")


def _read(name: str, stream: IO[bytes], most: int) -> np.ndarray:
    with stream:
        version = npy.read_magic(stream)
        if version not in ((1, 0), (2, 0)):
            raise ValueError(f"'{name}' has version {version} of NumPy's format")
        header = npy.read_array_header_1_0 if version == (1, 0) else npy.read_array_header_2_0
        shape, fortran, dtype = header(stream)
        if dtype.kind not in "fciuU":
            raise ValueError(f"'{name}' is of kind {dtype}")
        size = dtype.itemsize
        for n in shape:  # of whole numbers without bound
            size *= n
        if size > (MOST_WORDS if dtype.kind == "U" else most) or size < 0:
            raise ValueError(f"'{name}' has shape {shape}, which is too large")
        data = stream.read(size)
        if len(data) < size:
            raise ValueError(f"'{name}' is cut off")
    array = np.frombuffer(bytearray(data), dtype).reshape(shape, order="F" if fortran else "C")
    return np.ascontiguousarray(array, dtype.newbyteorder("=")).reshape(shape)
