"""Beads of one fiber that meet."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray


def closest_approach(positions: ArrayLike, apart: int) -> NDArray[np.float64]:
    """Smallest distance (...) between two beads of a fiber (..., N, 3) that are at least so many links apart; infinite
    where there are none."""
    x = np.asarray(positions, float)
    x = x - x[..., :1, :]
    beads = x.shape[-2]
    first, second = np.triu_indices(beads, apart)
    if not len(first):
        return np.full(x.shape[:-2], np.inf)
    product = x @ x.swapaxes(-1, -2)
    square = np.einsum("...ii->...i", product)
    distance = square[..., first] + square[..., second] - 2 * product[..., first, second]
    return np.sqrt(distance.min(axis=-1).clip(min=0))
