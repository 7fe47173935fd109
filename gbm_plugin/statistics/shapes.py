"""Shapes of bent fibers in a plane, told apart by the modes of their bending.

The angles θ_j between the links at the N−2 inner beads are taken apart in sines that vanish at the free ends, as
moments do: c_m = (2/(N−1))^½ Σ_j θ_j sin(π m j/(N−1)), m = 1 … N−2, an orthogonal transform. The shape is that of
the largest c_m: U for m = 1, S for 2, W for 3, `higher` beyond. A V has its bend gathered in the middle: c₃/c₁ < −1/3,
between the softest bending mode of a free fiber (−0.12 for N = 6) and a kink (−0.62 at the two middle beads of six, −1
at one bead), with c₁ not below c₃ (by more than a tenth) and above c₂.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

SHAPES = ("U", "V", "S", "W", "higher")
KINK = -1 / 3


def bend_angles(positions: ArrayLike) -> NDArray[np.float64]:
    """(..., N−2) signed angles [rad] between links of planar fibers (..., N, 2), anticlockwise positive."""
    positions = np.asarray(positions, float)
    if positions.ndim < 2 or positions.shape[-1] != 2 or positions.shape[-2] < 3:
        raise ValueError(f"positions have shape {positions.shape}; allowed is (..., N, 2) with N >= 3")
    links = np.diff(positions, axis=-2)
    first, second = links[..., :-1, :], links[..., 1:, :]
    turn = first[..., 0] * second[..., 1] - first[..., 1] * second[..., 0]
    return np.arctan2(turn, (first * second).sum(axis=-1))


def bending_modes(positions: ArrayLike) -> NDArray[np.float64]:
    """(..., N−2) amplitudes c_m [rad] of planar fibers (..., N, 2). Σ c_m² = Σ θ_j²."""
    angles = bend_angles(positions)
    count = angles.shape[-1]
    j = np.arange(1, count + 1)
    return angles @ (np.sqrt(2 / (count + 1)) * np.sin(np.pi * np.outer(j, j) / (count + 1)))


def classify(positions: ArrayLike) -> tuple[NDArray[np.int64], NDArray[np.float64]]:
    """The place in SHAPES of each planar fiber (..., N, 2), and the share of Σ c_m² that its largest mode has.

    Straight fibers, which have none, are U with the share NaN.
    """
    modes = bending_modes(positions)
    square = modes**2
    largest = square.argmax(axis=-1)
    with np.errstate(invalid="ignore"):
        share = square.max(axis=-1) / square.sum(axis=-1)
    shape = np.array([SHAPES.index(word) for word in ("U", "S", "W", "higher")])[np.minimum(largest, 3)]
    if modes.shape[-1] < 3:
        return shape, share
    c1, c2, c3 = np.moveaxis(modes[..., :3], -1, 0)
    kinked = (c3 * c1 < KINK * c1**2) & (np.abs(c1) > 0.9 * np.abs(c3)) & (np.abs(c1) > np.abs(c2))
    return np.where(kinked, SHAPES.index("V"), shape), share
