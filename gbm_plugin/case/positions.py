"""Bead positions that a case gives: a NumPy file, checked as a run will need it."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from ..arrays import read_array

TOUCHING = 1e-6  # largest relative difference of a bead spacing from 2a that double precision may have


def read_positions(path: Path) -> np.ndarray:
    """(fibers, beads, 3) [m] of a .npy file, neighbours one diameter apart. ValueError in words that follow the
    file's name. Spacings of single precision are made even, around the same centres and along the same links."""
    try:
        given = read_array(path)
    except ValueError as error:
        raise ValueError(f"cannot be read as a NumPy .npy file: {error}") from None
    if not isinstance(given, np.ndarray) or given.dtype.kind not in "fiu":
        raise ValueError("does not hold one array of real numbers (np.save of bead centres)")
    if given.ndim != 3 or given.shape[0] < 1 or given.shape[1] < 2 or given.shape[2] != 3:
        raise ValueError(
            f"has shape {given.shape}; (fibers, beads, 3) with 1 fiber and 2 beads or more is needed"
        )
    beads = given.astype(float)
    if not np.isfinite(beads).all():
        fiber = int(np.argmin(np.isfinite(beads).all(axis=(1, 2))))
        raise ValueError(f"has a value that is not finite in fiber {fiber}")
    bonds = np.diff(beads, axis=1)
    spacing = np.linalg.norm(bonds, axis=2)
    diameter = spacing.mean()
    if diameter == 0:
        raise ValueError("has beads that all lie in one point; neighbours must be one diameter 2a apart")
    apart = np.abs(spacing / diameter - 1)
    if apart.max() <= TOUCHING:
        return beads
    if apart.max() <= _rounding(given) / diameter:
        return _evened(beads, bonds / spacing[..., None], diameter)
    fiber, bead = np.unravel_index(int(apart.argmax()), apart.shape)
    raise ValueError(
        f"has neighbours {spacing.min():.9g} to {spacing.max():.9g} apart (beads {bead}, {bead + 1} of fiber {fiber} "
        f"are {spacing[fiber, bead]:.9g}): all must be one diameter 2a apart, to {TOUCHING:g} of it"
    )


def _rounding(given: np.ndarray) -> float:
    """How far a spacing may be off through the digits of the file [m]."""
    single = given.dtype.kind == "f" and given.dtype.itemsize <= 4
    return 4 * float(np.finfo(given.dtype).eps) * float(np.abs(given).max()) if single else 0.0


def _evened(beads: np.ndarray, links: np.ndarray, diameter: float) -> np.ndarray:
    even = np.zeros_like(beads)
    np.cumsum(diameter * links, axis=1, out=even[:, 1:])
    return even + (beads.mean(axis=1) - even.mean(axis=1))[:, None]
