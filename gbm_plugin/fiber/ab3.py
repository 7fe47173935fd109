"""Third-order Adams–Bashforth steps for links that turn, with a consistent start.

The rotation vector of a step from t to t + h with rates w_n, w_(n−1), w_(n−2) is ∫w of the polynomial through
them, plus the leading Magnus term −(h³/12) w_n × w', w' = (w_n − w_(n−1))/(t_n − t_(n−1)): rotations do not
commute. The first two steps, without history, are midpoint steps: their error is of third order, once.
"""

import numpy as np
from numba import njit, prange

from .ambient import SAMPLES
from .bending import TORQUES
from .layout import rotated
from .mobility import link_rates, work_rows
from .simd import (
    add,
    add_scaled,
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

STAGES = 2  # times per step at which the flow is wanted: its start, and its middle (by a starting step)
LIMIT = 6 / 11  # of AB3 on the negative real axis
BENDING_RATE = 0.252  # fastest bending mode over K/μd⁴, of long chains: 0.206 in free drain, 0.252 with rpy
TENSION_RATE = 1.2  # fastest transverse relaxation of a taut chain over tension/(6πμa 2a): 0.87 in free drain


def scratch_rows(mobility: int, beads: int) -> int:
    """Scratch rows per thread for fibers of so many beads."""
    return 24 * beads + work_rows(mobility, beads, implicit=False)


def stable_step(fibers, softness: float, tension: float) -> float:
    """Largest stable step: eq. (10), times softness, cos²(θ/2) of the sharpest joint of a discrete rod.

    tension: T/6πμa. It matters for long chains in strong extension, where it outruns bending.
    """
    diameter = 2 * fibers.radius
    stiffness = fibers.bending_stiffness.max() / (fibers.viscosity * diameter**4 * softness)
    factor = TORQUES[fibers.bending_torque] / TORQUES["consistent"]
    rate = BENDING_RATE * factor * stiffness + TENSION_RATE * tension / diameter
    return min(1 / stiffness if stiffness > 0 else np.inf, LIMIT / rate if rate > 0 else np.inf)


def plan(ages: list[float], step: float, count: int) -> np.ndarray:
    """Weights of each of count steps, a row: w_n, w_(n−1), w_(n−2); w_n × w_(n−1); third less second order;
    start.

    ages: how long before the first step's start the rates w_(n−1), w_(n−2) were taken, as many as there are.
    """
    rows = np.zeros((count, 8))
    ages = list(ages)
    for row in rows:
        if len(ages) < 2:
            row[0], row[7] = step, 1.0
        else:
            # ∫ over [0, h] of the Lagrange polynomials at the nodes 0, −p, −q
            p, q = ages[:2]
            h2, h3 = step**2 / 2, step**3 / 3
            row[0] = step + (h2 * (p + q) + h3) / (p * q)
            row[1] = (h3 + q * h2) / (p * (p - q))
            row[2] = (h3 + p * h2) / (q * (q - p))
            row[3] = step**3 / (12 * p)
            row[4:7] = row[:3] - (step + h2 / p, -h2 / p, 0)
        ages = [step, *(age + step for age in ages[:1])]
    return rows


@njit(forceinline=True)
def _blend(samples, b, weights, out):
    """Ambient field of block b: the weighted sum of samples, or the one it equals."""
    for s in range(SAMPLES):
        if weights[s] == 1.0:
            return samples[s][b]
    for row in range(out.shape[0]):
        newer = weights[0] * load(samples[0][b], row) + weights[1] * load(samples[1][b], row)
        store(out, row, newer + weights[2] * load(samples[2][b], row))
    return out


@njit(forceinline=True)
def turn_links(state, angles, factor, out):
    """out = state with links turned by factor × angles and the centre moved by factor × its velocity."""
    links = state.shape[0] // 3 - 1
    for i in range(links):
        store3(out, i, rotated(load3(state, i), scale(factor, load3(angles, i))))
    store3(out, links, add_scaled(load3(state, links), factor, load3(angles, links)))


@njit(parallel=True, cache=True)
def advance(
    mobility, state, newest, older, velocity, rotation, weights, steps, beta, radius, law, scratch,
    out, error, tension,
):  # fmt: skip
    """One flow step in len(steps) sub-steps, for every block.

    state → out (B, 3N, LANES); newest, older: rates w_(n−1) and w_(n−2), each (given, written); velocity,
    rotation: SAMPLES each; weights (sub-steps, STAGES, SAMPLES): of the samples; steps: plan(). error (B,
    LANES): rms over links of |third − second order| rotation, largest sub-step; tension: largest |e·λ|.
    """
    count, rows = steps.shape[0], state.shape[1]
    links = rows // 3 - 1
    threads = scratch.shape[0]
    for thread in prange(threads):
        work = scratch[thread]
        multipliers, middle, rates = work[:rows], work[rows : 2 * rows], work[2 * rows : 3 * rows]
        flow, spin, rest = work[3 * rows : 4 * rows], work[4 * rows : 5 * rows], work[8 * rows :]
        for b in range(thread, state.shape[0], threads):
            now, past, far = state[b], newest[0][b], older[0][b]
            worst, pull, stiffness = splat(0.0), splat(0.0), load(beta, b)
            for s in range(count):
                h, start = steps[s, 0], steps[s, 7] == 1.0
                if s == count - 1:
                    w = newest[1][b]
                elif s == count - 2:
                    w = older[1][b]
                else:
                    ring = (5 + s % 3) * rows
                    w = work[ring : ring + rows]
                u, o = _blend(velocity, b, weights[s, 0], flow), _blend(rotation, b, weights[s, 0], spin)
                pull = link_rates(mobility, now, u, o, stiffness, radius, law, rest, multipliers, w)
                total = splat(0.0)
                if start:
                    turn_links(now, w, 0.5 * h, middle)
                    u, o = _blend(velocity, b, weights[s, 1], flow), _blend(rotation, b, weights[s, 1], spin)
                    link_rates(mobility, middle, u, o, stiffness, radius, law, rest, multipliers, rates)
                    turn_links(now, rates, h, out[b])
                    for i in range(links):
                        gap = scale(h, subtract(load3(rates, i), load3(w, i)))
                        total = total + dot(gap, gap)
                else:
                    c0, c1, c2, magnus = steps[s, 0], steps[s, 1], steps[s, 2], steps[s, 3]
                    d0, d1, d2 = steps[s, 4], steps[s, 5], steps[s, 6]
                    for i in range(links):
                        w0, w1, w2 = load3(w, i), load3(past, i), load3(far, i)
                        angle = add_scaled(add_scaled(scale(c0, w0), c1, w1), c2, w2)
                        angle = add_scaled(angle, magnus, cross(w0, w1))
                        gap = add_scaled(add_scaled(scale(d0, w0), d1, w1), d2, w2)
                        total = total + dot(gap, gap)
                        store3(out[b], i, rotated(load3(now, i), angle))
                    w0, w1, w2 = load3(w, links), load3(past, links), load3(far, links)
                    move = add_scaled(add_scaled(scale(c0, w0), c1, w1), c2, w2)
                    store3(out[b], links, add(load3(now, links), move))
                worst = larger(worst, total)  # keeps a NaN of total
                now, past, far = out[b], w, past
            store(error, b, sqrt((1.0 / links) * worst))
            store(tension, b, sqrt(pull))
