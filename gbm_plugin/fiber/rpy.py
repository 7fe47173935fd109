"""Rotne–Prager–Yamakawa mobility: beads move and spin each other, overlapping ones too; dense solves per
fiber.

Tensors of Wajnryb, Mizerski, Zuk & Szymczak (2013) and Zuk et al. (2014) for equal spheres. Forces F are
scaled by 1/6πμa and torques T by 1/6πμa², so that all are velocities, and spins are times a. With r in
units of a and n from bead j to bead i,

    v_i = (A I + B n nᵀ) F_j + q T_j × n,       a ω_i = q F_j × n + ¾ (C I + D n nᵀ) T_j.

All are continuous at contact, and the whole mobility is symmetric positive definite for any positions.
"""

from typing import Any, NamedTuple

from numba.extending import register_jitable

from ..compiled import inlined, part
from .bending import moment, rod_factor
from .blocks import take
from .layout import difference, mean_vector
from .simd import (
    add,
    add_scaled,
    arithmetic,
    cross,
    dot,
    larger,
    load,
    load3,
    scale,
    select_less,
    splat,
    sqrt,
    store,
    store3,
    subtract,
    zero3,
)

COEFFICIENTS = 8  # per pair: A, B, q, C, D, n


@arithmetic
def pair(x):
    """A, B, q, C, D and n of two spheres a distance x apart, in units of a."""
    square = larger(dot(x, x), 1e-24)
    r = sqrt(square)
    i = 1.0 / r
    i3 = i * i * i
    far, r3 = 2.0, r * square
    a = select_less(r, far, 1.0 - 9.0 / 32.0 * r, 0.75 * i + 0.5 * i3)
    b = select_less(r, far, 3.0 / 32.0 * r, 0.75 * i - 1.5 * i3)
    q = select_less(r, far, 0.375 * r - 9.0 / 64.0 * square, 0.75 * i * i)
    c = select_less(r, far, 1.0 - 27.0 / 32.0 * r + 5.0 / 64.0 * r3, -0.5 * i3)
    d = select_less(r, far, 9.0 / 32.0 * r - 3.0 / 64.0 * r3, 1.5 * i3)
    return a, b, q, c, d, scale(i, x)


@inlined
def _load_pair(pairs, i, j):
    """A, B, q, C, D of beads i ≠ j, and the direction from j to i."""
    high, low = max(i, j), min(i, j)
    p = COEFFICIENTS * (high * (high - 1) // 2 + low)
    sign = 1.0 if i > j else -1.0
    n = sign * load(pairs, p + 5), sign * load(pairs, p + 6), sign * load(pairs, p + 7)
    return load(pairs, p), load(pairs, p + 1), load(pairs, p + 2), load(pairs, p + 3), load(pairs, p + 4), n


@inlined
def response(pairs, i, j, force, torque):
    """Velocity and spin of bead i from force and torque on bead j."""
    if i == j:
        return force, scale(0.75, torque)
    a, b, q, c, d, n = _load_pair(pairs, i, j)
    velocity = add_scaled(scale(a, force), b * dot(n, force), n)
    spin = add_scaled(scale(0.75 * c, torque), 0.75 * d * dot(n, torque), n)
    return add_scaled(velocity, q, cross(torque, n)), add_scaled(spin, q, cross(force, n))


@inlined
def torque_response(pairs, i, j, torque):
    """Velocity and spin of bead i from a torque on bead j."""
    if i == j:
        return zero3(), scale(0.75, torque)
    _, _, q, c, d, n = _load_pair(pairs, i, j)
    return scale(q, cross(torque, n)), add_scaled(scale(0.75 * c, torque), 0.75 * d * dot(n, torque), n)


class _Parts(NamedTuple):
    """Scratch of rates and stage: pairs, Cholesky factor, response of the gaps; per bead velocity, spin, torque."""

    pairs: Any
    factor: Any
    gaps: Any
    v: Any
    s: Any
    torques: Any


class _StageParts(NamedTuple):
    """More scratch of a stage: response of the gaps to joint moments, the joints' matrix and moments; gaps without
    bending, gaps ahead, one column; slips and gaps of three columns at once."""

    bending: Any
    matrix: Any
    moments: Any
    free: Any
    ahead: Any
    column: Any
    slips: Any
    columns: Any


@register_jitable
def layout(work, beads):
    """The parts of scratch for the rates of fibers of so many beads."""
    n = 3 * (beads - 1)
    pairs, at = take(work, 0, COEFFICIENTS * beads * (beads - 1) // 2)
    factor, at = take(work, at, n * n)
    gaps, at = take(work, at, (n + 3) * n)
    v, at = take(work, at, n + 3)
    s, at = take(work, at, n + 3)
    torques, at = take(work, at, n + 3)
    return _Parts(pairs, factor, gaps, v, s, torques), at


@register_jitable
def stage_layout(work, beads):
    """The parts of scratch for a stage of fibers of so many beads."""
    n, m = 3 * (beads - 1), 3 * (beads - 2)
    parts, at = layout(work, beads)
    bending, at = take(work, at, (n + 3) * m)
    matrix, at = take(work, at, m * m)
    moments, at = take(work, at, m)
    free, at = take(work, at, n + 3)
    ahead, at = take(work, at, n)
    column, at = take(work, at, n + 3)
    slips, at = take(work, at, 3 * n)
    columns, at = take(work, at, 3 * (n + 3))
    return (parts, _StageParts(bending, matrix, moments, free, ahead, column, slips, columns)), at


@inlined
def _slip(state, v, s, i):
    """v_i − v_(i+1) − e_i × (s_i + s_(i+1)): what rolling contact forbids."""
    return subtract(scale(-1.0, difference(v, i)), cross(load3(state, i), add(load3(s, i), load3(s, i + 1))))


@inlined
def _dot_rows(a, first_a, stride, b, first_b, count):
    """Σ a[first_a + k stride] b[first_b + k], in four sums so that they do not wait for each other."""
    s0, s1, s2, s3 = splat(0.0), splat(0.0), splat(0.0), splat(0.0)
    fours = count - count % 4
    for k in range(0, fours, 4):
        at = first_a + k * stride
        s0 = s0 + load(a, at) * load(b, first_b + k)
        s1 = s1 + load(a, at + stride) * load(b, first_b + k + 1)
        s2 = s2 + load(a, at + 2 * stride) * load(b, first_b + k + 2)
        s3 = s3 + load(a, at + 3 * stride) * load(b, first_b + k + 3)
    for k in range(fours, count):
        s0 = s0 + load(a, first_a + k * stride) * load(b, first_b + k)
    return (s0 + s1) + (s2 + s3)


@part
def assemble(state, pairs, factor, gaps, v, s):
    """Cholesky factor (lower, its diagonal inverted) of the constraint matrix, and gaps from multipliers.

    Column 3k + c of gaps (3N, 3(N−1)) holds, for a unit multiplier of link k, all v_(i+1) − v_i and the
    mean v.
    """
    links = state.shape[0] // 3 - 1
    n = 3 * links
    p = 0
    for i in range(1, links + 1):
        x = zero3()
        for j in range(i - 1, -1, -1):  # from the nearest bead on: x = r_i − r_j
            x = add_scaled(x, 2.0, load3(state, j))
            a, b, q, c, d, unit = pair(x)
            at = COEFFICIENTS * (p + j)
            store(pairs, at, a)
            store(pairs, at + 1, b)
            store(pairs, at + 2, q)
            store(pairs, at + 3, c)
            store(pairs, at + 4, d)
            store(pairs, at + 5, unit[0])
            store(pairs, at + 6, unit[1])
            store(pairs, at + 7, unit[2])
        p += i
    one, none = splat(1.0), splat(0.0)
    for k in range(links):
        e = load3(state, k)
        for c in range(3):
            force = (one if c == 0 else none, one if c == 1 else none, one if c == 2 else none)
            torque = cross(e, force)
            back = scale(-1.0, force)
            for i in range(links + 1):
                v1, s1 = response(pairs, i, k, force, torque)
                v2, s2 = response(pairs, i, k + 1, back, torque)
                store3(v, i, add(v1, v2))
                store3(s, i, add(s1, s2))
            column = 3 * k + c
            for i in range(links):
                gap = difference(v, i)
                for d in range(3):
                    store(gaps, (3 * i + d) * n + column, gap[d])
                if i >= k:
                    slip = _slip(state, v, s, i)
                    for d in range(3):
                        store(factor, (3 * i + d) * n + column, slip[d])
            mean = mean_vector(v, links + 1)
            for d in range(3):
                store(gaps, (n + d) * n + column, mean[d])
    for j in range(n):
        inverse = 1.0 / sqrt(load(factor, j * n + j) - _dot_rows(factor, j * n, 1, factor, j * n, j))
        store(factor, j * n + j, inverse)
        for i in range(j + 1, n):
            rest = load(factor, i * n + j) - _dot_rows(factor, i * n, 1, factor, j * n, j)
            store(factor, i * n + j, rest * inverse)


@part
def roll(state, factor, gaps, v, s, multipliers, out):
    """Multipliers that stop the slip of velocities v and spins s; out: resulting gaps and mean velocity."""
    links = state.shape[0] // 3 - 1
    n = 3 * links
    for i in range(links):
        store3(multipliers, i, scale(-1.0, _slip(state, v, s, i)))
    for i in range(n):
        rest = load(multipliers, i) - _dot_rows(factor, i * n, 1, multipliers, 0, i)
        store(multipliers, i, rest * load(factor, i * n + i))
    for back in range(n):
        i = n - 1 - back
        rest = load(multipliers, i) - _dot_rows(factor, (i + 1) * n + i, n, multipliers, i + 1, back)
        store(multipliers, i, rest * load(factor, i * n + i))
    for i in range(links):
        store3(out, i, difference(v, i))
    store3(out, links, mean_vector(v, links + 1))
    for row in range(n + 3):
        store(out, row, load(out, row) + _dot_rows(gaps, row * n, 1, multipliers, 0, n))


@inlined
def _dot_columns(a, first, stride, x, begin, count):
    """Σ a[first + k stride] x[begin + k] for three columns at once, row by row in x."""
    even, odd = zero3(), zero3()
    twos = count - count % 2
    for k in range(0, twos, 2):
        at = first + k * stride
        even = add_scaled(even, load(a, at), load3(x, begin + k))
        odd = add_scaled(odd, load(a, at + stride), load3(x, begin + k + 1))
    if count > twos:
        even = add_scaled(even, load(a, first + twos * stride), load3(x, begin + twos))
    return add(even, odd)


@part
def _roll_columns(factor, gaps, n, x, out):
    """As roll for three columns at once: x, their slips, is overwritten; out, their gaps, is completed."""
    for i in range(n):
        rest = subtract(load3(x, i), _dot_columns(factor, i * n, 1, x, 0, i))
        store3(x, i, scale(load(factor, i * n + i), rest))
    for back in range(n):
        i = n - 1 - back
        rest = subtract(load3(x, i), _dot_columns(factor, (i + 1) * n + i, n, x, i + 1, back))
        store3(x, i, scale(load(factor, i * n + i), rest))
    for row in range(n + 3):
        store3(out, row, subtract(load3(out, row), _dot_columns(gaps, row * n, 1, x, 0, n)))


@part
def torques_to_motion(pairs, torques, v, s):
    """Add to v and s what torques on all beads cause."""
    beads = v.shape[0] // 3
    for i in range(beads):
        velocity, spin = load3(v, i), load3(s, i)
        for j in range(beads):
            dv, ds = torque_response(pairs, i, j, load3(torques, j))
            velocity, spin = add(velocity, dv), add(spin, ds)
        store3(v, i, velocity)
        store3(s, i, spin)


@part
def ambient(flow, radius, v, s):
    """v, s = the ambient velocity and a × rotation."""
    velocity, rotation = flow
    for i in range(v.shape[0] // 3):
        store3(v, i, load3(velocity, i))
        store3(s, i, scale(radius, load3(rotation, i)))


@part
def contacts(chain, flow, torques, work, multipliers, gaps_of):
    """Multipliers under the flow and given torques on the beads, once assembled; gaps_of: what roll gives."""
    state, _, radius, _ = chain
    (pairs, factor, gaps, v, s, _), _ = layout(work, state.shape[0] // 3)
    ambient(flow, radius, v, s)
    torques_to_motion(pairs, torques, v, s)
    roll(state, factor, gaps, v, s, multipliers, gaps_of)


@inlined
def _joint_moment(state, j, law):
    """Moment at bead j, none at the ends."""
    if j < 1 or j > state.shape[0] // 3 - 2:
        return zero3()
    return moment(load3(state, j - 1), load3(state, j), law)


@part
def link_rates(chain, flow, work, motion):
    """As free_drain.link_rates, with this mobility."""
    state, beta, radius, law = chain
    rates, multipliers = motion
    links = state.shape[0] // 3 - 1
    (pairs, factor, gaps, v, s, torques), _ = layout(work, links + 1)
    assemble(state, pairs, factor, gaps, v, s)
    ambient(flow, radius, v, s)
    for i in range(links + 1):
        torque = subtract(_joint_moment(state, i + 1, law), _joint_moment(state, i - 1, law))
        store3(torques, i, scale(4.0 / 3.0 * beta, torque))
    torques_to_motion(pairs, torques, v, s)
    roll(state, factor, gaps, v, s, multipliers, rates)
    tension = splat(0.0)
    for i in range(links):
        e = load3(state, i)
        pull = dot(e, load3(multipliers, i))
        tension = larger(pull * pull, tension)
        store3(rates, i, scale(0.5 / radius, cross(e, load3(rates, i))))
    return tension


@inlined
def _moment_change(state, g, j, law):
    """Change of the moment at bead j (and the moment) when the links around it change by g."""
    t, u = load3(state, j - 1), load3(state, j)
    dt, du = load3(g, j - 1), load3(g, j)
    bend, change = cross(t, u), add(cross(dt, u), cross(t, du))
    if law == 1:
        f = rod_factor(t, u)
        change = add_scaled(scale(f, change), -0.5 * f * f * (dot(dt, u) + dot(t, du)), bend)
        bend = scale(f, bend)
    return bend, change


@part
def stage(chain, flow, ahead, work, motion):
    """As implicit_drain.stage, with this mobility: the unknowns are the joint moments βM at links e + δe.

    With W their response in the gaps 2a de/dt, and C the derivative of M, (I − βσ C W) βM = β (M + σ C g),
    g the gaps without bending plus 2a κ × e: compliant and rigid joints alike are well conditioned.
    """
    state, beta, radius, law = chain
    history, _, sigma = ahead
    rates, multipliers = motion
    links = state.shape[0] // 3 - 1
    n, m = 3 * links, 3 * (links - 1)
    (common, own), _ = stage_layout(work, links + 1)
    pairs, factor, gaps, v, s, _ = common
    bending, matrix, moments, free, g, gap_column, slips, columns = own
    assemble(state, pairs, factor, gaps, v, s)
    one, none = splat(1.0), splat(0.0)
    for j in range(1, links):
        for c in range(3):
            unit = (one if c == 0 else none, one if c == 1 else none, one if c == 2 else none)
            ahead, behind = scale(4.0 / 3.0, unit), scale(-4.0 / 3.0, unit)
            for i in range(links + 1):
                v1, s1 = torque_response(pairs, i, j - 1, ahead)
                v2, s2 = torque_response(pairs, i, j + 1, behind)
                store3(v, i, add(v1, v2))
                store3(s, i, add(s1, s2))
            for i in range(links):
                slip, gap = _slip(state, v, s, i), difference(v, i)
                for d in range(3):
                    store(slips, 3 * (3 * i + d) + c, slip[d])
                    store(columns, 3 * (3 * i + d) + c, gap[d])
            mean = mean_vector(v, links + 1)
            for d in range(3):
                store(columns, 3 * (n + d) + c, mean[d])
        _roll_columns(factor, gaps, n, slips, columns)
        for c in range(3):
            column = 3 * (j - 1) + c
            for row in range(n + 3):
                value = load(columns, 3 * row + c)
                store(gap_column, row, value)
                store(bending, row * m + column, value)
            for i in range(1, links):
                _, change = _moment_change(state, gap_column, i, law)
                for d in range(3):
                    row = 3 * (i - 1) + d
                    store(
                        matrix, row * m + column, (one if row == column else none) - beta * sigma * change[d]
                    )
    ambient(flow, radius, v, s)
    roll(state, factor, gaps, v, s, multipliers, free)
    for i in range(links):
        turned = cross(load3(history, i), load3(state, i))
        store3(g, i, add_scaled(load3(free, i), 2.0 * radius, turned))
    for j in range(1, links):
        bend, change = _moment_change(state, g, j, law)
        store3(moments, j - 1, scale(beta, add_scaled(bend, sigma, change)))
    for k in range(m):
        inverse = 1.0 / load(matrix, k * m + k)
        for i in range(k + 1, m):
            ratio = load(matrix, i * m + k) * inverse
            for j in range(k + 1, m):
                store(matrix, i * m + j, load(matrix, i * m + j) - ratio * load(matrix, k * m + j))
            store(moments, i, load(moments, i) - ratio * load(moments, k))
    for back in range(m):
        i = m - 1 - back
        rest = load(moments, i) - _dot_rows(matrix, i * m + i + 1, 1, moments, i + 1, back)
        store(moments, i, rest / load(matrix, i * m + i))
    for row in range(n + 3):
        store(rates, row, load(free, row) + _dot_rows(bending, row * m, 1, moments, 0, m))
    for i in range(links):
        store3(rates, i, scale(0.5 / radius, cross(load3(state, i), load3(rates, i))))
