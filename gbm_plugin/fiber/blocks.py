"""What kernels pass to each other: a block of eight fibers, the flow around it, and parts of a thread's scratch.

Scratch is one array of rows for each thread. A function that lays it out takes its parts one after the other
with `take`; run on an empty array, the same function says how many rows that is (`rows_of`).
"""

from typing import Any, NamedTuple

import numpy as np
from llvmlite import ir
from numba import types
from numba.core import cgutils
from numba.extending import lower_builtin, type_callable
from numba.np.arrayobj import make_array, populate_array

from ..simd import LANES


class Material(NamedTuple):
    """What all fibers of a family are: the place of the curvature law among CURVATURE_LAWS, the bead radius, and beta
    (B, LANES) of bending.velocity_scale."""

    law: int
    radius: float
    beta: np.ndarray


class Samples(NamedTuple):
    """The newest samples of the flow at the beads, newest first: SAMPLES arrays (B, 3N, LANES) of velocity and of
    rotation, the first len(times) of which count, and their times (S,)."""

    velocity: tuple[np.ndarray, ...]
    rotation: tuple[np.ndarray, ...]
    times: np.ndarray


class Chain(NamedTuple):
    """Eight fibers: links (3N, LANES), unit links i → i + 1 and in the last place the centre of mass; beta, lanes
    of bending.velocity_scale; bead radius; law, the place of the curvature law among model.CURVATURE_LAWS."""

    links: Any
    beta: Any
    radius: float
    law: int


class Flow(NamedTuple):
    """Ambient velocity and rotation at the beads, (3N, LANES) each."""

    velocity: Any
    rotation: Any


class Ahead(NamedTuple):
    """Where an implicit stage takes its torques: at the links turned by h d (rates + history). history (3N, LANES);
    lagged (3(N−1), LANES), multipliers of the stiffness of taut chains; sigma, lanes of h d/2a."""

    history: Any
    lagged: Any
    sigma: Any


class Motion(NamedTuple):
    """What comes out: rates (3N, LANES) of the links' rotation and, in the last place, of the centre; multipliers
    (3(N−1), LANES), contact forces over 6πμa."""

    rates: Any
    multipliers: Any


def take(work, at, rows):
    """The next rows of scratch from place at on, and the place after them."""
    return work[at : at + rows], at + rows


def rows_of(layout, beads: int) -> int:
    """How many rows a layout(work, beads) -> (parts, place after them) takes."""
    return layout(np.empty((0, LANES)), beads)[1]


@type_callable(take)
def _type_take(context):
    def typer(work, at, rows):
        return types.Tuple((work, types.intp))

    return typer


@lower_builtin(take, types.Array, types.Integer, types.Integer)
def _lower_take(context, builder, signature, arguments):
    """A view that does not own its memory: it costs no counting of references, and no checks."""
    kind = signature.args[0]
    whole, (at, rows) = make_array(kind)(context, builder, arguments[0]), arguments[1:]
    place = builder.gep(whole.data, [builder.mul(at, ir.Constant(at.type, LANES))])
    view = make_array(kind)(context, builder)
    populate_array(
        view,
        data=place,
        shape=[rows, cgutils.unpack_tuple(builder, whole.shape)[1]],
        strides=cgutils.unpack_tuple(builder, whole.strides),
        itemsize=whole.itemsize,
        meminfo=None,
    )
    parts = [view._getvalue(), builder.add(at, rows)]
    return context.make_tuple(builder, signature.return_type, parts)
