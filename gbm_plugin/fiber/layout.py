"""Between arrays of fibers (F, rows) and blocks of lanes (B, rows, LANES), and links rotated in place.

The last block is filled up with copies of the last fiber.
"""

from contextlib import contextmanager

import numpy as np
from numba import get_num_threads, njit, prange, set_num_threads

from .simd import LANES, add, add_scaled, cross, dot, load3, scale, splat, store3, subtract, zero3

BEADS_PER_THREAD = 2000  # fewer bead-steps are not worth a second thread,
COPYING = 0.05  # and copying a bead is worth so much of a step


@contextmanager
def threads_for(beads: float):
    """Use as many threads as so many bead-steps are worth."""
    available = get_num_threads()
    set_num_threads(max(1, min(available, int(beads / BEADS_PER_THREAD))))
    try:
        yield
    finally:
        set_num_threads(available)


@njit(parallel=True, cache=True)
def _pack(values, blocks):
    for b in prange(blocks.shape[0]):
        for lane in range(LANES):
            fiber = min(b * LANES + lane, values.shape[0] - 1)
            for row in range(values.shape[1]):
                blocks[b, row, lane] = values[fiber, row]


@njit(parallel=True, cache=True)
def _unpack(blocks, values):
    for fiber in prange(values.shape[0]):
        for row in range(values.shape[1]):
            values[fiber, row] = blocks[fiber // LANES, row, fiber % LANES]


def pack(values: np.ndarray, out: np.ndarray | None = None) -> np.ndarray:
    """(F, …) as blocks (B, rows, LANES)."""
    flat = np.ascontiguousarray(values, dtype=float).reshape(len(values), -1)
    if out is None:
        out = np.empty((-(-len(values) // LANES), flat.shape[1], LANES))
    _pack(flat, out)
    return out


def unpack(blocks: np.ndarray, shape: tuple[int, ...]) -> np.ndarray:
    """Blocks (B, rows, LANES) as an array of the given shape (F, …)."""
    values = np.empty((shape[0], blocks.shape[1]))
    _unpack(blocks, values)
    return values.reshape(shape)


@njit(parallel=True, cache=True)
def bead_positions(state, diameter, positions):
    """Bead centres (F, N, 3) from links and centre of mass (B, 3N, LANES), the centre in the last place."""
    beads = positions.shape[1]
    for b in prange(state.shape[0]):
        block = state[b]
        local = np.empty((3 * beads, LANES))
        bead, total = zero3(), zero3()
        store3(local, 0, bead)
        for i in range(1, beads):
            bead = add_scaled(bead, diameter, load3(block, i - 1))
            total = add(total, bead)
            store3(local, i, bead)
        shift = add_scaled(load3(block, beads - 1), -1.0 / beads, total)
        for i in range(beads):
            store3(local, i, add(load3(local, i), shift))
        for lane in range(min(LANES, positions.shape[0] - b * LANES)):
            for i in range(beads):
                for c in range(3):
                    positions[b * LANES + lane, i, c] = local[3 * i + c, lane]


@njit(forceinline=True)
def rotated(link, angle):
    """Unit link turned by the rotation vector angle: exactly a rotation, of size |angle| to O(|angle|⁷).

    Gibbs vector g = tan(|φ|/2) φ/|φ|, its tangent as a series; one Newton step keeps the length from
    drifting.
    """
    square = dot(angle, angle)
    gibbs = scale(0.5 + square * (1.0 / 24.0 + square * (1.0 / 240.0)), angle)
    turn = cross(gibbs, add(link, cross(gibbs, link)))
    new = add_scaled(link, 2.0 / (1.0 + dot(gibbs, gibbs)), turn)
    return scale(1.5 - 0.5 * dot(new, new), new)


@njit(forceinline=True)
def difference(array, i):
    """array[i + 1] − array[i], as vectors."""
    return subtract(load3(array, i + 1), load3(array, i))


@njit(forceinline=True)
def mean_vector(array, count):
    """Mean of the first count vectors."""
    total = zero3()
    for i in range(count):
        total = add(total, load3(array, i))
    return scale(splat(1.0 / count), total)
