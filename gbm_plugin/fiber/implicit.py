"""Linearly implicit steps: the Rosenbrock pair 2(3) of Shampine & Reichelt (1997), for links that turn.

Second order whatever the Jacobian, L-stable, with an error estimate of third order. With d = 1/(2 + √2),
stage j solves k = f + h d J (k + κ) at its own links, so that nothing stiff is ever evaluated explicitly:

    k₁: links e,             flow at t + dh,      κ = 0
    k₂: links exp(h k₁/2) e, flow at t + h/2,     κ = −k₁
    e' = exp(h k₂) e
    k₃: links e',            flow at t + h − dh,  κ = −(6 + √2)(k₂ − k₁) − 2 k₁
    error = (h/6)(k₁ − 2k₂ + k₃), rms over the links: rad, which is bead displacement over fiber length.

Every fiber has its own step inside the flow step: rejected ones try again with less, accepted ones go on.
"""

import numpy as np
from numba import njit, prange

from .ab3 import turn_links
from .ambient import SAMPLES
from .mobility import stage, work_rows
from .simd import (
    LANES,
    add,
    add_scaled,
    dot,
    load,
    load3,
    smaller,
    splat,
    sqrt,
    store,
)

D = 1 / (2 + np.sqrt(2))
E32 = 6 + np.sqrt(2)
SAFETY, SHRINK, GROW = 0.9, 0.2, 5.0  # of the classical step-size rule
RIGID = 2e7  # largest σβ: bending rates above 1e9/h follow the flow no closer, but drown it in rounding
FLOW_TIMES = np.array([D, 0.5, 1 - D])  # of the stages, in steps


def scratch_rows(mobility: int, beads: int) -> int:
    """Scratch rows per thread for fibers of so many beads."""
    return 51 * beads + 8 + work_rows(mobility, beads, implicit=True)


@njit(forceinline=True)
def _gather(blocks, members, whole, out):
    """The lanes of eight fibers: their block itself, or, if they are of several blocks, copied into out."""
    if whole:
        return blocks[members[0] // LANES]
    for lane in range(LANES):
        b, place = members[lane] // LANES, members[lane] % LANES
        for row in range(blocks.shape[1]):
            out[row, lane] = blocks[b, row, place]
    return out


@njit(forceinline=True)
def _gather_samples(samples, members, whole, out):
    """The lanes of eight fibers in each of SAMPLES samples."""
    rows = samples[0].shape[1]
    return (
        _gather(samples[0], members, whole, out[:rows]),
        _gather(samples[1], members, whole, out[rows : 2 * rows]),
        _gather(samples[2], members, whole, out[2 * rows : 3 * rows]),
    )


@njit
def _lagrange(times, count, time, out, lane):
    """Weights of the values at times[:count] in their polynomial at one time, into out[:, lane]."""
    for j in range(SAMPLES):
        weight = 1.0 if j < count else 0.0
        for m in range(count):
            if m != j and j < count:
                weight *= (time - times[m]) / (times[j] - times[m])
        out[j, lane] = weight


@njit(forceinline=True)
def _blend(samples, weights, out):
    """Ambient field at each lane's own time, from its samples, one after the other in rows."""
    w0, w1, w2 = load(weights, 0), load(weights, 1), load(weights, 2)
    s0, s1, s2 = samples
    for row in range(out.shape[0]):
        store(out, row, w0 * load(s0, row) + w1 * load(s1, row) + w2 * load(s2, row))


@njit(parallel=True, cache=True)
def attempt(
    mobility, members, source, lagged, velocity, rotation, times, beta, radius, law, tolerance,
    scratch, trial, out, out_lagged, elapsed, step, error,
):  # fmt: skip
    """One step of its own size for every fiber in members, accepted where the error estimate allows.

    source → out (B, 3N, LANES), lagged → out_lagged (B, 3(N−1), LANES): links and multipliers; velocity,
    rotation: SAMPLES samples each, the first len(times) of them valid at times, counted from the start of
    the flow step. Per fiber: trial, the step to try; elapsed, step, error: time reached, suggested next
    step, and error estimate, updated.
    """
    rows = source.shape[1]
    links = rows // 3 - 1
    threads = scratch.shape[0]
    groups = (len(members) + LANES - 1) // LANES
    for thread in prange(threads):
        work = scratch[thread]
        own, mine = work[:rows], work[rows : 2 * rows]
        u, spin = work[2 * rows : 3 * rows], work[3 * rows : 4 * rows]
        middle, new = work[4 * rows : 5 * rows], work[5 * rows : 6 * rows]
        k1, k2, k3 = work[6 * rows : 7 * rows], work[7 * rows : 8 * rows], work[8 * rows : 9 * rows]
        history, tension = work[9 * rows : 10 * rows], work[10 * rows : 11 * rows]
        weights, sizes = work[17 * rows : 17 * rows + 3], work[17 * rows + 3 : 17 * rows + 8]
        rest = work[17 * rows + 8 :]
        eight = np.empty(LANES, np.int64)
        for group in range(thread, groups, threads):
            whole = True
            for lane in range(LANES):
                eight[lane] = members[min(group * LANES + lane, len(members) - 1)]
                whole = whole and eight[lane] % LANES == lane and eight[lane] - lane == eight[0]
                sizes[0, lane] = trial[eight[lane]]
                sizes[1, lane] = beta[eight[lane] // LANES, eight[lane] % LANES]
            now = _gather(source, eight, whole, own)
            lag = _gather(lagged, eight, whole, mine)
            flow = _gather_samples(velocity, eight, whole, work[11 * rows : 14 * rows])
            spins = _gather_samples(rotation, eight, whole, work[14 * rows : 17 * rows])
            h = load(sizes, 0)
            sigma = (0.5 * D / radius) * h
            stiff = smaller(load(sizes, 1), RIGID / sigma)
            for s in range(3):
                for lane in range(LANES):
                    at = elapsed[eight[lane]] + FLOW_TIMES[s] * sizes[0, lane]
                    _lagrange(times, len(times), at, weights, lane)
                _blend(flow, weights, u)
                _blend(spins, weights, spin)
                if s == 0:
                    for row in range(rows):
                        store(history, row, splat(0.0))
                    stage(mobility, now, u, spin, history, lag, sigma, stiff, radius, law, rest, tension, k1)
                    turn_links(now, k1, 0.5 * h, middle)
                elif s == 1:
                    for row in range(rows):
                        store(history, row, -load(k1, row))
                    stage(
                        mobility,
                        middle,
                        u,
                        spin,
                        history,
                        tension,
                        sigma,
                        stiff,
                        radius,
                        law,
                        rest,
                        tension,
                        k2,
                    )
                    turn_links(now, k2, h, new)
                else:
                    for row in range(rows):
                        store(history, row, (E32 - 2.0) * load(k1, row) - E32 * load(k2, row))
                    stage(
                        mobility, new, u, spin, history, tension, sigma, stiff, radius, law, rest, tension, k3
                    )
            total = splat(0.0)
            for i in range(links):
                gap = add_scaled(add(load3(k1, i), load3(k3, i)), -2.0, load3(k2, i))
                total = total + dot(gap, gap)
            store(sizes, 2, (1.0 / 6.0) * h * sqrt((1.0 / links) * total))
            for lane in range(LANES):
                fiber, estimate, size = eight[lane], sizes[2, lane], sizes[0, lane]
                b, place = fiber // LANES, fiber % LANES
                if group * LANES + lane >= len(members):
                    continue
                error[fiber] = estimate
                factor = SHRINK
                if estimate < np.inf:
                    factor = max(SHRINK, min(GROW, SAFETY * (tolerance / max(estimate, 1e-300)) ** (1 / 3)))
                step[fiber] = size * factor
                if estimate <= tolerance:
                    elapsed[fiber] += size
                    for row in range(rows):
                        out[b, row, place] = new[row, lane]
                    for row in range(3 * links):
                        out_lagged[b, row, place] = tension[row, lane]
                else:
                    for row in range(rows):
                        out[b, row, place] = now[row, lane]
                    for row in range(3 * links):
                        out_lagged[b, row, place] = lag[row, lane]
