"""Between arrays of fibers (F, rows) and blocks of lanes (B, rows, LANES), and links rotated in place.

The last block is filled up with copies of the last fiber.
"""

import numpy as np

from ..compiled import inlined, kernel, only_read, part_of
from ..simd import (
    LANES,
    add,
    add_scaled,
    arithmetic,
    blank,
    cross,
    dot,
    load3,
    scale,
    store3,
    subtract,
    zero3,
)
from ..threads import COPYING, in_shares


@kernel
def _pack(share, shares, values, blocks):
    begin, end = part_of(share, shares, blocks.shape[0])
    for b in range(begin, end):
        for lane in range(LANES):
            fiber = min(b * LANES + lane, values.shape[0] - 1)
            for row in range(values.shape[1]):
                blocks[b, row, lane] = values[fiber, row]


@kernel
def _unpack(share, shares, blocks, values):
    begin, end = part_of(share, shares, blocks.shape[0])
    for b in range(begin, end):
        for fiber in range(b * LANES, min((b + 1) * LANES, values.shape[0])):
            for row in range(values.shape[1]):
                values[fiber, row] = blocks[b, row, fiber % LANES]


def pack(values: np.ndarray, out: np.ndarray | None = None) -> np.ndarray:
    """(F, …) as blocks (B, rows, LANES)."""
    flat = only_read(np.asarray(values, dtype=float).reshape(len(values), -1))
    if out is None:
        out = blank(-(-len(values) // LANES), flat.shape[1])
    in_shares(_pack, COPYING * flat.size / 3, flat, out)
    return out


def unpack(blocks: np.ndarray, shape: tuple[int, ...]) -> np.ndarray:
    """Blocks (B, rows, LANES) as an array of the given shape (F, …)."""
    values = np.empty((shape[0], blocks.shape[1]))
    in_shares(_unpack, COPYING * values.size / 3, blocks, values)
    return values.reshape(shape)


@kernel
def bead_positions(share, shares, state, diameter, scratch, positions):
    """Bead centres (F, N, 3) from links and centre of mass (B, 3N, LANES), the centre in the last place; scratch
    (threads, 3N or more, LANES)."""
    beads = positions.shape[1]
    local = scratch[share]
    begin, end = part_of(share, shares, state.shape[0])
    for b in range(begin, end):
        block = state[b]
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


@arithmetic
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


@inlined
def difference(array, i):
    """array[i + 1] − array[i], as vectors."""
    return subtract(load3(array, i + 1), load3(array, i))


@inlined
def mean_vector(array, count):
    """Mean of the first count vectors."""
    total = zero3()
    for i in range(count):
        total = add(total, load3(array, i))
    return scale(1.0 / count, total)
