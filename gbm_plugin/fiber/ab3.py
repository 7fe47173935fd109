"""Third-order Adams–Bashforth steps for links that turn, with a consistent start.

The rotation vector of a step from t to t + h with rates w_n, w_(n−1), w_(n−2) is ∫w of the polynomial through
them, plus the leading Magnus term −(h³/12) w_n × w', w' = (w_n − w_(n−1))/(t_n − t_(n−1)): rotations do not
commute. The first two steps, without history, are midpoint steps: their error is of third order, once.
"""

from typing import Any, NamedTuple

import numpy as np
from numba.extending import register_jitable

from ..compiled import inlined, kernel, part_of, woven
from ..simd import (
    add,
    add_scaled,
    arithmetic,
    cross,
    dot,
    larger,
    load,
    load3,
    scale,
    splat,
    sqrt,
    store,
    store3,
    subtract,
)
from . import free_drain, rpy
from .ambient import SAMPLES
from .bending import TORQUES
from .blocks import Chain, Flow, Motion, rows_of, take
from .layout import rotated
from .mobility import work_rows

STAGES = 2  # times per step at which the flow is wanted: its start, and its middle (by a starting step)
LIMIT = 6 / 11  # of AB3 on the negative real axis
BENDING_RATE = 0.252  # fastest bending mode over K/μd⁴, of long chains: 0.206 in free drain, 0.252 with rpy
TENSION_RATE = 1.2  # fastest transverse relaxation of a taut chain over tension/(6πμa 2a): 0.87 in free drain


class History(NamedTuple):
    """Links and centre, and the two newest rates, at one end of a step: (B, 3N, LANES) each."""

    links: np.ndarray
    newest: np.ndarray
    older: np.ndarray


class Plan(NamedTuple):
    """Sub-steps: length (S,); start (S,), whether it is a midpoint step; weights (S, 3) of w_n, w_(n−1), w_(n−2) and
    magnus (S,) of w_n × w_(n−1); error (S, 3), the weights of third less second order; flow (S, STAGES, SAMPLES),
    weights of the samples."""

    length: np.ndarray
    start: np.ndarray
    weights: np.ndarray
    magnus: np.ndarray
    error: np.ndarray
    flow: np.ndarray


class _Parts(NamedTuple):
    """Scratch: multipliers; links in the middle of a start, and rates there; velocity, rotation; a ring of rates."""

    multipliers: Any
    middle: Any
    rates: Any
    velocity: Any
    rotation: Any
    ring: Any


@register_jitable
def layout(work, beads):
    """The parts of scratch for fibers of so many beads; what follows is that of the mobility."""
    rows = 3 * beads
    multipliers, at = take(work, 0, rows)
    middle, at = take(work, at, rows)
    rates, at = take(work, at, rows)
    velocity, at = take(work, at, rows)
    rotation, at = take(work, at, rows)
    ring, at = take(work, at, 3 * rows)
    return _Parts(multipliers, middle, rates, velocity, rotation, ring), at


def scratch_rows(mobility: str, beads: int) -> int:
    """Scratch rows per thread for fibers of so many beads."""
    return rows_of(layout, beads) + work_rows(mobility, beads, implicit=False)


def stable_step(fibers, softness: float, tension: float) -> float:
    """Largest stable step: eq. (10), times softness, cos²(θ/2) of the sharpest joint of a discrete rod.

    tension: T/6πμa. It matters for long chains in strong extension, where it outruns bending.
    """
    diameter = 2 * fibers.radius
    stiffness = fibers.bending_stiffness.max() / (fibers.viscosity * diameter**4 * softness)
    factor = TORQUES[fibers.bending_torque] / TORQUES["consistent"]
    rate = BENDING_RATE * factor * stiffness + TENSION_RATE * tension / diameter
    return min(1 / stiffness if stiffness > 0 else np.inf, LIMIT / rate if rate > 0 else np.inf)


def plan(ages: list[float], step: float, flow: np.ndarray) -> Plan:
    """Plan of equal sub-steps, as many as flow (S, STAGES, SAMPLES) has weights for.

    ages: how long before the first step's start the rates w_(n−1), w_(n−2) were taken, as many as there are.
    """
    count = len(flow)
    made = Plan(
        np.full(count, step), np.zeros(count, bool), np.zeros((count, 3)), np.zeros(count), np.zeros((count, 3)), flow
    )  # fmt: skip
    ages = list(ages)
    for s in range(min(count, 3)):
        if len(ages) < 2:
            made.start[s] = True
        else:
            # ∫ over [0, h] of the Lagrange polynomials at the nodes 0, −p, −q
            p, q = ages[:2]
            h2, h3 = step**2 / 2, step**3 / 3
            row = made.weights[s]
            row[0] = step + (h2 * (p + q) + h3) / (p * q)
            row[1] = (h3 + q * h2) / (p * (p - q))
            row[2] = (h3 + p * h2) / (q * (q - p))
            made.magnus[s] = step**3 / (12 * p)
            made.error[s] = row - (step + h2 / p, -h2 / p, 0)
        ages = [step, *(age + step for age in ages[:1])]
    for rows in (made.weights, made.magnus, made.error):
        rows[3:] = rows[2:3]  # two sub-steps behind it, each is as the one before
    return made


def sample_weights(times: np.ndarray, step: float, count: int) -> np.ndarray:
    """(count, STAGES, SAMPLES) weights of samples at these times, at the stages of sub-steps from time 0 on."""
    at = (np.arange(count)[:, None] + np.arange(STAGES) / STAGES) * step
    nodes = np.arange(len(times))
    apart = np.subtract.outer(times, times)
    apart[nodes, nodes] = 1.0
    factors = (at[..., None, None] - times) / apart
    factors[..., nodes, nodes] = 1.0
    weights = np.zeros((count, STAGES, SAMPLES))
    weights[..., nodes] = factors.prod(axis=-1)
    return weights


@inlined
def _blend(samples, b, weights, out):
    """Ambient field of block b: the weighted sum of samples, or the one it equals."""
    for s in range(SAMPLES):
        if weights[s] == 1.0:
            return samples[s][b]
    w0, w1, w2 = weights[0], weights[1], weights[2]
    s0, s1, s2 = samples[0][b], samples[1][b], samples[2][b]
    for row in range(out.shape[0]):
        store(out, row, w0 * load(s0, row) + w1 * load(s1, row) + w2 * load(s2, row))
    return out


@inlined
def turn_links(state, angles, factor, out):
    """out = state with links turned by factor × angles and the centre moved by factor × its velocity."""
    links = state.shape[0] // 3 - 1
    for i in range(links):
        store3(out, i, rotated(load3(state, i), scale(factor, load3(angles, i))))
    store3(out, links, add_scaled(load3(state, links), factor, load3(angles, links)))


@arithmetic
def _weighted(weights, w0, w1, w2):
    """Sum of three vectors, with three weights."""
    return add_scaled(add_scaled(scale(weights[0], w0), weights[1], w1), weights[2], w2)


@woven
def _advance(link_rates, share, shares, material, samples, plan, before, after, scratch, error, tension):
    """One flow step, in the sub-steps of a Plan, for every block of this share.

    material: Material; samples: Samples; before, after: History, of which after is written; scratch (threads, rows,
    LANES). error (B, LANES): rms over links of |third − second order| rotation, largest sub-step; tension: largest
    |e·λ|.
    """
    law, radius, beta = material
    state, out, count = before.links, after.links, plan.length.shape[0]
    rows = state.shape[1]
    links = rows // 3 - 1
    (multipliers, middle, rates, velocity, rotation, ring), used = layout(scratch[share], links + 1)
    work, _ = take(scratch[share], used, scratch.shape[1] - used)
    begin, end = part_of(share, shares, state.shape[0])
    for b in range(begin, end):
        now, past, far = state[b], before.newest[b], before.older[b]
        worst, pull, stiffness = splat(0.0), splat(0.0), load(beta, b)
        for s in range(count):
            h = plan.length[s]
            if s == count - 1:
                w = after.newest[b]
            elif s == count - 2:
                w = after.older[b]
            else:
                w, _ = take(ring, s % 3 * rows, rows)
            chain, into, stages = now, w, 2 if plan.start[s] else 1
            for stage in range(stages):
                u = _blend(samples.velocity, b, plan.flow[s, stage], velocity)
                o = _blend(samples.rotation, b, plan.flow[s, stage], rotation)
                block = Chain(chain, stiffness, radius, law)
                largest = link_rates(block, Flow(u, o), work, Motion(into, multipliers))
                if stage == 0:
                    pull = largest
                if stage + 1 < stages:
                    turn_links(now, w, 0.5 * h, middle)
                    chain, into = middle, rates
            total = splat(0.0)
            if stages == 2:
                turn_links(now, rates, h, out[b])
                for i in range(links):
                    gap = scale(h, subtract(load3(rates, i), load3(w, i)))
                    total = total + dot(gap, gap)
            else:
                c, d, magnus = plan.weights[s], plan.error[s], plan.magnus[s]
                c0, c1, c2, d0, d1, d2 = c[0], c[1], c[2], d[0], d[1], d[2]
                for i in range(links):
                    w0, w1, w2 = load3(w, i), load3(past, i), load3(far, i)
                    angle = add_scaled(_weighted((c0, c1, c2), w0, w1, w2), magnus, cross(w0, w1))
                    gap = _weighted((d0, d1, d2), w0, w1, w2)
                    total = total + dot(gap, gap)
                    store3(out[b], i, rotated(load3(now, i), angle))
                move = _weighted((c0, c1, c2), load3(w, links), load3(past, links), load3(far, links))
                store3(out[b], links, add(load3(now, links), move))
            worst = larger(worst, total)  # keeps a NaN of total
            now, past, far = out[b], w, past
        store(error, b, sqrt((1.0 / links) * worst))
        store(tension, b, sqrt(pull))


@kernel
def _free_drain(share, shares, material, samples, plan, before, after, scratch, error, tension):
    drain = free_drain.link_rates
    _advance(drain, share, shares, material, samples, plan, before, after, scratch, error, tension)


@kernel
def _rpy(share, shares, material, samples, plan, before, after, scratch, error, tension):
    hydro = rpy.link_rates
    _advance(hydro, share, shares, material, samples, plan, before, after, scratch, error, tension)


ADVANCE = {"freeDrain": _free_drain, "rpy": _rpy}
