"""Shape of fibers from their bead positions.

`positions` is (..., N, 3) [m] everywhere: bead centres, unwrapped, neighbours 2a apart; leading axes (times,
fibers) are kept. Equation numbers are the paper's.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..fiber.model import CURVATURE_LAWS
from ..sampling import one_of


def _checked(positions: ArrayLike, beads: int) -> NDArray[np.float64]:
    positions = np.asarray(positions, dtype=float)
    if positions.ndim < 2 or positions.shape[-1] != 3 or positions.shape[-2] < beads:
        raise ValueError(f"positions have shape {positions.shape}; allowed is (..., N, 3) with N >= {beads}")
    return positions


def _checked_radius(radius: float) -> float:
    if not (np.isscalar(radius) and np.isfinite(radius) and radius > 0):
        raise ValueError(f"radius is {radius}; allowed is one finite number > 0")
    return float(radius)


def _links(positions: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    links = np.diff(positions, axis=-2)
    return links, np.linalg.norm(links, axis=-1)


def end_to_end(positions: ArrayLike) -> NDArray[np.float64]:
    """End-to-end vector X_N − X_1, (..., 3) [m], eq. (13). Raises ValueError for a wrong shape."""
    positions = _checked(positions, 2)
    return positions[..., -1, :] - positions[..., 0, :]


def end_to_end_squared_ratio(positions: ArrayLike, radius: float) -> NDArray[np.float64]:
    """R²/(2a(N−1))², (...): 1 for a straight fiber.

    Normalised by the contour length between the end beads' centres, 2a(N−1), and not by L = 2aN.
    Raises ValueError for a wrong shape or radius.
    """
    positions = _checked(positions, 2)
    contour = 2 * _checked_radius(radius) * (positions.shape[-2] - 1)
    return (end_to_end(positions) ** 2).sum(axis=-1) / contour**2


def contour_length(positions: ArrayLike) -> NDArray[np.float64]:
    """Sum of the link lengths, (...) [m]; 2a(N−1) for an inextensible fiber. Raises ValueError."""
    return _links(_checked(positions, 2))[1].sum(axis=-1)


def link_length_error(positions: ArrayLike, radius: float) -> float:
    """Largest relative error |link − 2a|/2a over all links, one number. Raises ValueError."""
    diameter = 2 * _checked_radius(radius)
    _, lengths = _links(_checked(positions, 2))
    return float(np.max(np.abs(lengths - diameter), initial=0.0) / diameter)


def curvature(positions: ArrayLike, radius: float, law: str = "sine") -> NDArray[np.float64]:
    """Curvature at the inner beads, (..., N−2) [1/m], never negative.

    sine: |t_i × t_{i+1}|/2a, eqs. (4) and (5), which falls again beyond 90°; discreteRod: 2 tan(θ/2)/2a with
    θ the angle between the links (Bergou et al. 2008), which does not and is infinite at a fold.
    Raises ValueError for a wrong shape, radius or law.
    """
    one_of("curvature law", law, CURVATURE_LAWS)
    positions = _checked(positions, 2)
    diameter = 2 * _checked_radius(radius)
    links, lengths = _links(positions)
    tangents = links / lengths[..., None]
    sine = np.linalg.norm(np.cross(tangents[..., :-1, :], tangents[..., 1:, :]), axis=-1)
    if law == "sine":
        return sine / diameter
    # tan(θ/2) from |t' − t| and |t' + t|: no loss of digits near 0 or π
    difference = np.linalg.norm(tangents[..., 1:, :] - tangents[..., :-1, :], axis=-1)
    total = np.linalg.norm(tangents[..., 1:, :] + tangents[..., :-1, :], axis=-1)
    with np.errstate(divide="ignore"):
        return 2 * difference / total / diameter


def mean_curvature(positions: ArrayLike, radius: float, law: str = "sine") -> NDArray[np.float64]:
    """Mean of the curvature over the N−2 inner beads, (...) [1/m], eq. (11). Raises ValueError for N < 3."""
    return curvature(_checked(positions, 3), radius, law).mean(axis=-1)


def gyration_radius(positions: ArrayLike) -> NDArray[np.float64]:
    """sqrt(Σ r_i²/N), r_i the distance of bead i from the centre of mass, (...) [m], eq. (14).

    Raises ValueError for a wrong shape.
    """
    positions = _checked(positions, 2)
    offsets = positions - positions.mean(axis=-2, keepdims=True)
    return np.sqrt((offsets**2).sum(axis=-1).mean(axis=-1))


def bead_curvature(positions: ArrayLike, radius: float) -> NDArray[np.float64]:
    """Curvature of eq. (5) at every bead, (..., N) [1/m]: the end beads take their neighbours'."""
    inner = curvature(positions, radius)
    if inner.shape[-1] == 0:
        return np.zeros(np.shape(positions)[:-1])
    return np.concatenate([inner[..., :1], inner, inner[..., -1:]], axis=-1)


def bead_tension(links: ArrayLike) -> NDArray[np.float64]:
    """Tension (..., N−1) of links at every bead, (..., N): the mean of the links beside it."""
    links = np.asarray(links, dtype=float)
    padded = np.concatenate([links[..., :1], links, links[..., -1:]], axis=-1)
    return 0.5 * (padded[..., 1:] + padded[..., :-1])
