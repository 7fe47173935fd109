"""Beads of one fiber that meet without being neighbours: counted, and pushed apart if asked to."""

import numpy as np

from ..compiled import inlined, kernel, only_read, part_of
from ..threads import in_shares


@inlined
def _between(positions, f, i, j):
    """From bead j to bead i of fiber f."""
    return (
        positions[f, i, 0] - positions[f, j, 0],
        positions[f, i, 1] - positions[f, j, 1],
        positions[f, i, 2] - positions[f, j, 2],
    )


@kernel
def _count(share, shares, positions, diameter, counts):
    begin, end = part_of(share, shares, positions.shape[0])
    for f in range(begin, end):
        for i in range(positions.shape[1]):
            for j in range(i + 2, positions.shape[1]):
                x = _between(positions, f, i, j)
                if x[0] ** 2 + x[1] ** 2 + x[2] ** 2 < diameter**2:
                    counts[f] += 1


@kernel
def _push(share, shares, positions, diameter, rate, velocity):
    begin, end = part_of(share, shares, positions.shape[0])
    for f in range(begin, end):
        for i in range(positions.shape[1]):
            for j in range(i + 2, positions.shape[1]):
                x = _between(positions, f, i, j)
                r = np.sqrt(x[0] ** 2 + x[1] ** 2 + x[2] ** 2)
                if 0 < r < diameter:
                    push = 0.5 * rate * (diameter / r - 1)
                    for c in range(3):
                        velocity[f, i, c] += push * x[c]
                        velocity[f, j, c] -= push * x[c]


def self_contacts(positions: np.ndarray, diameter: float) -> np.ndarray:
    """(F,) number of pairs of beads that overlap and are not neighbours; positions (F, N, 3)."""
    counts = np.zeros(len(positions), dtype=np.int64)
    positions = only_read(np.asarray(positions, dtype=float))
    in_shares(_count, positions.shape[1] * counts.size, positions, diameter, counts)
    return counts


def repulsion_velocity(positions: np.ndarray, diameter: float, rate: float) -> np.ndarray:
    """(F, N, 3) velocities that part overlapping pairs: their overlap decays at the given rate (1/time).

    The force behind it is linear in the overlap and of zero range beyond contact; it acts through each
    bead's own drag, is evaluated with the flow sample, and needs rate × flow step below about 1.
    """
    velocity = np.zeros(positions.shape)
    positions = only_read(np.asarray(positions, dtype=float))
    in_shares(_push, velocity.size / 3, positions, diameter, rate, velocity)
    return velocity
