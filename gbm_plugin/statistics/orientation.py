"""How fibers turn, and along what of the flow they lie.

Directions are unit vectors (..., 3); p and −p are one direction for all that is squared here.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from .fibers import end_to_end

AXES = ("vorticity", "stretching", "middle", "compression")  # of the flow, that directions may lie along


def directions(positions: ArrayLike) -> NDArray[np.float64]:
    """Unit vectors (..., 3) along the end-to-end vectors of fibers (..., N, 3)."""
    vector = end_to_end(positions)
    return vector / np.linalg.norm(vector, axis=-1, keepdims=True)


def turned(first: ArrayLike, second: ArrayLike) -> NDArray[np.float64]:
    """Angles (...) [rad] between unit vectors (..., 3), exact for small ones too."""
    first, second = np.asarray(first, float), np.asarray(second, float)
    return 2 * np.arctan2(np.linalg.norm(second - first, axis=-1), np.linalg.norm(second + first, axis=-1))


def tumbling(directions: ArrayLike, spacing: float) -> NDArray[np.float64]:
    """ṗ² (T − 2, F) [1/s²] of directions (T, F, 3), `spacing` [s] apart.

    From the angles turned in one interval and in two, extrapolated to none: a steady rotation is exact, and the error
    of another is of fourth order in the interval.
    """
    p = np.asarray(directions, float)
    if p.ndim != 3 or len(p) < 3:
        raise ValueError(f"directions have shape {p.shape}; (T, F, 3) with T >= 3 is needed")
    single = (turned(p[1:], p[:-1]) / spacing) ** 2
    double = (turned(p[2:], p[:-2]) / (2 * spacing)) ** 2
    return (2 * (single[1:] + single[:-1]) - double) / 3


def first_tumbling(directions: ArrayLike, spacing: float) -> NDArray[np.float64]:
    """ṗ² (F,) [1/s²] at the first of at least four times, extrapolated from the angles turned since: of third order
    in the interval."""
    p = np.asarray(directions, float)
    since = [(turned(p[n], p[0]) / (n * spacing)) ** 2 for n in (1, 2, 3)]
    return 3 * since[0] - 3 * since[1] + since[2]


def rod_tumbling(gradient: ArrayLike, direction: ArrayLike, shape: float = 1.0) -> NDArray[np.float64]:
    """ṗ (..., 3) [1/s] of a short rod along p in the gradient du_i/dx_j (..., 3, 3): Wp + Λ(Sp − p p·Sp), Jeffery.

    shape: Λ = (r² − 1)/(r² + 1) of the aspect ratio r; 1 for a thin rod, 0 for a sphere.
    """
    g, p = np.asarray(gradient, float), np.asarray(direction, float)
    strain, spin = (g + g.swapaxes(-1, -2)) / 2, (g - g.swapaxes(-1, -2)) / 2
    stretched = np.einsum("...ij,...j->...i", strain, p)
    along = (stretched * p).sum(axis=-1, keepdims=True)
    return np.einsum("...ij,...j->...i", spin, p) + shape * (stretched - along * p)


def bead_rod_shape(beads: int) -> float:
    """Λ of a rigid straight chain of touching beads in free drain: r² = (N² + 1)/2 for even N, 1 + N²/2 for odd."""
    square = (beads**2 + 1) / 2 if beads % 2 == 0 else 1 + beads**2 / 2
    return (square - 1) / (square + 1)


def random_tumbling(shape: float = 1.0) -> float:
    """<ṗ²>ν/ε of randomly oriented short rods in isotropic turbulence: 1/6 + Λ²/10, that is 4/15 for thin ones and 1/6
    for spheres."""
    return 1 / 6 + shape**2 / 10


def vorticity(gradient: ArrayLike) -> NDArray[np.float64]:
    """∇×u (..., 3) [1/s] of the gradient du_i/dx_j (..., 3, 3)."""
    g = np.asarray(gradient, float)
    return np.stack(
        [g[..., 2, 1] - g[..., 1, 2], g[..., 0, 2] - g[..., 2, 0], g[..., 1, 0] - g[..., 0, 1]], axis=-1
    )


def alignments(direction: ArrayLike, gradient: ArrayLike) -> dict[str, NDArray[np.float64]]:
    """cos² (...) of the angles between directions (..., 3) and the vorticity, and the eigenvectors of the strain from
    the most stretching to the most compressing one, at gradients (..., 3, 3): 1/3 on average where there is no
    preference."""
    p, g = np.asarray(direction, float), np.asarray(gradient, float)
    omega = vorticity(g)
    square = (omega**2).sum(axis=-1)
    found = {"vorticity": (p * omega).sum(axis=-1) ** 2 / np.where(square > 0, square, 1.0)}
    _, axes = np.linalg.eigh((g + g.swapaxes(-1, -2)) / 2)
    along = np.einsum("...i,...ij->...j", p, axes) ** 2
    return found | {"stretching": along[..., 2], "middle": along[..., 1], "compression": along[..., 0]}


def anisotropy(vectors: ArrayLike) -> float:
    """How far <v v>/<v²> of vectors (M, 3) is from a third of the unit tensor: the root of the sum of its squares over
    that of a single direction, 0 for isotropic vectors and 1 for parallel ones."""
    v = np.asarray(vectors, float).reshape(-1, 3)
    tensor = v.T @ v / (v**2).sum() - np.eye(3) / 3
    return float(np.sqrt((tensor**2).sum() / (2 / 3)))
