"""What the model says at one instant: rates of links and centre, and the contact forces behind them."""

from __future__ import annotations

import numpy as np

from ..compiled import kernel, woven
from ..simd import blank, load
from . import free_drain, rpy
from .bending import velocity_scale
from .blocks import Chain, Flow, Material, Motion
from .fibers import Fibers
from .layout import pack, unpack
from .mobility import work_rows
from .model import CURVATURE_LAWS, MotionOptions


@woven
def _evaluate(link_rates, material, state, velocity, rotation, work, multipliers, rates):
    law, radius, beta = material
    for b in range(state.shape[0]):
        chain, flow = Chain(state[b], load(beta, b), radius, law), Flow(velocity[b], rotation[b])
        link_rates(chain, flow, work, Motion(rates[b], multipliers[b]))


@kernel
def _free_drain(material, state, velocity, rotation, work, multipliers, rates):
    drain = free_drain.link_rates
    _evaluate(drain, material, state, velocity, rotation, work, multipliers, rates)


@kernel
def _rpy(material, state, velocity, rotation, work, multipliers, rates):
    hydro = rpy.link_rates
    _evaluate(hydro, material, state, velocity, rotation, work, multipliers, rates)


_EVALUATE = {"freeDrain": _free_drain, "rpy": _rpy}


def instant_rates(fibers: Fibers, velocity, rotation, mobility="freeDrain"):
    """Rotation rates of the links (F, N−1, 3), velocity of the centres (F, 3), contact forces (F, N−1, 3).

    velocity, rotation: ambient, at the beads (F, N, 3). The force of link i acts on bead i, its opposite on
    bead i + 1; its part along the link is the tension.
    """
    state = pack(np.concatenate([fibers.links, fibers.centres[:, None]], axis=1))
    shape = (fibers.count, fibers.beads, 3)
    ambient = (pack(np.broadcast_to(field, shape)) for field in (velocity, rotation))
    return rates_of_blocks(fibers, state, *ambient, MotionOptions(mobility=mobility).mobility)


def rates_of_blocks(fibers: Fibers, state, velocity, rotation, mobility):
    """The same of fibers that have moved: links and centres, velocity, rotation in blocks (B, 3N, LANES)."""
    rates, multipliers = blank(*state.shape[:2]), blank(len(state), state.shape[1] - 3)
    work = blank(work_rows(mobility, fibers.beads, implicit=False))
    _EVALUATE[mobility](material(fibers), state, velocity, rotation, work, multipliers, rates)
    drag = 6 * np.pi * fibers.viscosity * fibers.radius
    forces = drag * unpack(multipliers, (fibers.count, fibers.beads - 1, 3))
    rates = unpack(rates, (fibers.count, fibers.beads, 3))
    return rates[:, :-1], rates[:, -1], forces


def material(fibers: Fibers) -> Material:
    """What kernels know of these fibers."""
    beta = pack(velocity_scale(fibers))[:, 0]
    return Material(CURVATURE_LAWS.index(fibers.curvature_law), float(fibers.radius), beta)
