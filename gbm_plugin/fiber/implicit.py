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

from typing import Any, NamedTuple

import numpy as np
from numba.extending import register_jitable

from ..compiled import inlined, kernel, part, part_of, woven
from ..simd import LANES, add, add_scaled, dot, larger, load, load3, smaller, splat, sqrt, store
from . import implicit_drain, rpy
from .ab3 import turn_links
from .ambient import SAMPLES
from .blocks import Ahead, Chain, Flow, Motion, rows_of, take
from .mobility import work_rows

D = 1 / (2 + np.sqrt(2))
E32 = 6 + np.sqrt(2)
SAFETY, SHRINK, GROW = 0.9, 0.2, 5.0  # of the classical step-size rule
RIGID = 2e7  # largest σβ: bending rates above 1e9/h follow the flow no closer, but drown it in rounding
FLOW_TIMES = np.array([D, 0.5, 1 - D])  # of the stages, in steps


class Ends(NamedTuple):
    """Links and centre (B, 3N, LANES) and multipliers (B, 3(N−1), LANES) at one end of a step."""

    links: np.ndarray
    multipliers: np.ndarray


class Pace(NamedTuple):
    """Per fiber, (F,): trial, the step to try; elapsed, step, error: time reached in the flow step, suggested next
    step, and error estimate; tension: largest |e·λ| of the links at the time reached."""

    trial: np.ndarray
    elapsed: np.ndarray
    step: np.ndarray
    error: np.ndarray
    tension: np.ndarray


class _Parts(NamedTuple):
    """Scratch: links and multipliers of eight fibers, and their samples; velocity and rotation of a stage; links in
    the middle and at the end; k₁, k₂, k₃; κ; multipliers; weights of samples; h, β, the estimate and
    the tension."""

    own: Any
    mine: Any
    velocities: Any
    rotations: Any
    velocity: Any
    rotation: Any
    middle: Any
    new: Any
    k: Any
    history: Any
    tension: Any
    weights: Any
    sizes: Any


@register_jitable
def layout(work, beads):
    """The parts of scratch for fibers of so many beads; what follows is that of the mobility."""
    rows = 3 * beads
    own, at = take(work, 0, rows)
    mine, at = take(work, at, rows - 3)
    velocities, at = take(work, at, SAMPLES * rows)
    rotations, at = take(work, at, SAMPLES * rows)
    velocity, at = take(work, at, rows)
    rotation, at = take(work, at, rows)
    middle, at = take(work, at, rows)
    new, at = take(work, at, rows)
    k, at = take(work, at, 3 * rows)
    history, at = take(work, at, rows)
    tension, at = take(work, at, rows - 3)
    weights, at = take(work, at, SAMPLES)
    sizes, at = take(work, at, 4)
    parts = _Parts(
        own, mine, velocities, rotations, velocity, rotation, middle, new, k, history, tension, weights, sizes
    )
    return parts, at


def scratch_rows(mobility: str, beads: int) -> int:
    """Scratch rows per thread for fibers of so many beads."""
    return rows_of(layout, beads) + work_rows(mobility, beads, implicit=True)


@part
def _gather(blocks, members, whole, out):
    """The lanes of eight fibers: their block itself, or, if they are of several blocks, copied into out."""
    if whole:
        return blocks[members[0] // LANES]
    for lane in range(LANES):
        b, place = members[lane] // LANES, members[lane] % LANES
        for row in range(blocks.shape[1]):
            out[row, lane] = blocks[b, row, place]
    return out


@inlined
def _gather_samples(samples, members, whole, out):
    """The lanes of eight fibers in each of SAMPLES samples."""
    rows = samples[0].shape[1]
    return (
        _gather(samples[0], members, whole, take(out, 0, rows)[0]),
        _gather(samples[1], members, whole, take(out, rows, rows)[0]),
        _gather(samples[2], members, whole, take(out, 2 * rows, rows)[0]),
    )


@part
def _lagrange(times, count, time, out, lane):
    """Weights of the values at times[:count] in their polynomial at one time, into out[:, lane]."""
    for j in range(SAMPLES):
        weight = 1.0 if j < count else 0.0
        for m in range(count):
            if m != j and j < count:
                weight *= (time - times[m]) / (times[j] - times[m])
        out[j, lane] = weight


@inlined
def _blend(samples, weights, out):
    """Ambient field at each lane's own time, from its samples, one after the other in rows."""
    w0, w1, w2 = load(weights, 0), load(weights, 1), load(weights, 2)
    s0, s1, s2 = samples
    for row in range(out.shape[0]):
        store(out, row, w0 * load(s0, row) + w1 * load(s1, row) + w2 * load(s2, row))


@woven
def _attempt(stage, share, shares, material, members, samples, tolerance, before, after, pace, scratch):
    """One step of its own size for every fiber in members, accepted where the error estimate allows.

    material: Material; samples: Samples, times counted from the start of the flow step; before, after: Ends, of which
    after is written; pace: Pace, of which all but trial is updated; scratch (threads, rows, LANES).
    """
    law, radius, beta = material
    out, out_lagged, times = after.links, after.multipliers, samples.times
    trial, elapsed, step, error, pulls = pace
    rows = out.shape[1]
    links = rows // 3 - 1
    parts, used = layout(scratch[share], links + 1)
    own, mine, velocities, rotations, velocity, rotation, middle, new, k, history, tension, weights, sizes = (
        parts
    )
    work, _ = take(scratch[share], used, scratch.shape[1] - used)
    k1, _ = take(k, 0, rows)
    k2, _ = take(k, rows, rows)
    k3, _ = take(k, 2 * rows, rows)
    eight = np.empty(LANES, np.int64)
    begin, end = part_of(share, shares, (len(members) + LANES - 1) // LANES)
    for group in range(begin, end):
        whole = True
        for lane in range(LANES):
            eight[lane] = members[min(group * LANES + lane, len(members) - 1)]
            whole = whole and eight[lane] % LANES == lane and eight[lane] - lane == eight[0]
            sizes[0, lane] = trial[eight[lane]]
            sizes[1, lane] = beta[eight[lane] // LANES, eight[lane] % LANES]
        now = _gather(before.links, eight, whole, own)
        lag = _gather(before.multipliers, eight, whole, mine)
        flow = _gather_samples(samples.velocity, eight, whole, velocities)
        spins = _gather_samples(samples.rotation, eight, whole, rotations)
        h = load(sizes, 0)
        sigma = (0.5 * D / radius) * h
        stiff = smaller(load(sizes, 1), RIGID / sigma)
        at, lagged = now, lag
        for s in range(3):
            for lane in range(LANES):
                time = elapsed[eight[lane]] + FLOW_TIMES[s] * sizes[0, lane]
                _lagrange(times, len(times), time, weights, lane)
            _blend(flow, weights, velocity)
            _blend(spins, weights, rotation)
            for row in range(rows):
                if s == 0:
                    store(history, row, splat(0.0))
                elif s == 1:
                    store(history, row, -load(k1, row))
                else:
                    store(history, row, (E32 - 2.0) * load(k1, row) - E32 * load(k2, row))
            rates, _ = take(k, s * rows, rows)
            stage(
                Chain(at, stiff, radius, law),
                Flow(velocity, rotation),
                Ahead(history, lagged, sigma),
                work,
                Motion(rates, tension),
            )
            lagged = tension
            if s < 2:
                at = middle if s == 0 else new
                turn_links(now, rates, (0.5 if s == 0 else 1.0) * h, at)
        total, pull = splat(0.0), splat(0.0)
        for i in range(links):
            gap = add_scaled(add(load3(k1, i), load3(k3, i)), -2.0, load3(k2, i))
            total = total + dot(gap, gap)
            along = dot(load3(new, i), load3(tension, i))
            pull = larger(along * along, pull)
        store(sizes, 2, (1.0 / 6.0) * h * sqrt((1.0 / links) * total))
        store(sizes, 3, sqrt(pull))
        for lane in range(min(LANES, len(members) - group * LANES)):
            fiber, estimate, size = eight[lane], sizes[2, lane], sizes[0, lane]
            b, place = fiber // LANES, fiber % LANES
            error[fiber] = estimate
            factor = SHRINK
            if estimate < np.inf:
                factor = max(SHRINK, min(GROW, SAFETY * (tolerance / max(estimate, 1e-300)) ** (1 / 3)))
            step[fiber] = size * factor
            accepted = estimate <= tolerance
            if accepted:
                elapsed[fiber] += size
                pulls[fiber] = sizes[3, lane]
            source, contact = (new, tension) if accepted else (now, lag)
            for row in range(rows):
                out[b, row, place] = source[row, lane]
            for row in range(3 * links):
                out_lagged[b, row, place] = contact[row, lane]


@kernel
def _free_drain(share, shares, material, members, samples, tolerance, before, after, pace, scratch):
    drain = implicit_drain.stage
    _attempt(drain, share, shares, material, members, samples, tolerance, before, after, pace, scratch)


@kernel
def _rpy(share, shares, material, members, samples, tolerance, before, after, pace, scratch):
    hydro = rpy.stage
    _attempt(hydro, share, shares, material, members, samples, tolerance, before, after, pace, scratch)


ATTEMPT = {"freeDrain": _free_drain, "rpy": _rpy}
