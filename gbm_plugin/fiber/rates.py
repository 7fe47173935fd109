"""What the model says at one instant: rates of links and centre, and the contact forces behind them."""

from __future__ import annotations

import numpy as np
from numba import njit

from .bending import CURVATURE_LAWS, velocity_scale
from .fibers import Fibers, one_of
from .layout import pack, unpack
from .mobility import MOBILITIES, link_rates, work_rows
from .simd import load


@njit(cache=True)
def _evaluate(mobility, state, velocity, rotation, beta, radius, law, work, multipliers, rates):
    for b in range(state.shape[0]):
        stiffness, own = load(beta, b), multipliers[b]
        link_rates(mobility, state[b], velocity[b], rotation[b], stiffness, radius, law, work, own, rates[b])


def instant_rates(fibers: Fibers, velocity, rotation, mobility="freeDrain"):
    """Rotation rates of the links (F, N−1, 3), velocity of the centres (F, 3), contact forces (F, N−1, 3).

    velocity, rotation: ambient, at the beads (F, N, 3). The force of link i acts on bead i, its opposite on
    bead i + 1; its part along the link is the tension.
    """
    kind = MOBILITIES.index(one_of("mobility", mobility, MOBILITIES))
    state = pack(np.concatenate([fibers.links, fibers.centres[:, None]], axis=1))
    rates, multipliers = np.zeros_like(state), np.zeros((len(state), state.shape[1] - 3, state.shape[2]))
    beta = pack(velocity_scale(fibers))[:, 0]
    law = CURVATURE_LAWS.index(fibers.curvature_law)
    work = np.zeros((work_rows(kind, fibers.beads, implicit=False), state.shape[2]))
    shape = (fibers.count, fibers.beads, 3)
    velocity, rotation = np.broadcast_to(velocity, shape), np.broadcast_to(rotation, shape)
    _evaluate(kind, state, pack(velocity), pack(rotation), beta, fibers.radius, law, work, multipliers, rates)
    drag = 6 * np.pi * fibers.viscosity * fibers.radius
    forces = drag * unpack(multipliers, (fibers.count, fibers.beads - 1, 3))
    rates = unpack(rates, shape)
    return rates[:, :-1], rates[:, -1], forces
