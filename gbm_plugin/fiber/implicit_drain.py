"""One linearly implicit stage in free drain: the bending and contact torques are taken at links e + δe.

With δe = h d (de/dt + κ × e) linear in the unknown multipliers, 2a de/dt = ΔU + Dλ, D the second
difference, the rolling equations of free_drain become

    A λ + σ Σ_k E_ik (D λ)_k = right side − σ Σ_k E_ik (ΔU + 2a κ × e)_k,     σ = h d/2a,

where E_ik, k = i − 2 … i + 2, is minus the derivative of e_i × [β(M_(i+1) − M_(i−1) + M_(i+2) − M_i) + ¾(2
e_i × λ_i + e_(i−1) × λ_(i−1) + e_(i+1) × λ_(i+1))] with respect to the links in the bracket: bending, and
the stiffness that contact forces give to a taut chain. Every E_ik is α I + p e_iᵀ (plus one outer product
per joint for the discrete rod), and the matrix has seven block diagonals. It is solved by block
elimination, O(N).
"""

from typing import Any, NamedTuple

from numba.extending import register_jitable

from ..compiled import inlined, part
from ..simd import (
    add,
    add_scaled,
    arithmetic,
    cross,
    dot,
    load,
    load3,
    load9,
    scale,
    splat,
    store,
    store3,
    store9,
    subtract,
    zero3,
)
from .bending import rod_factor
from .blocks import take
from .layout import difference, mean_vector
from .matrix3 import apply, identity_plus, inverse, minus_apply, minus_product, plus_outer, product

PAD = 2  # zero vectors before and after the links of a padded array: no special rows at the ends


class _Parts(NamedTuple):
    """Scratch: padded vectors of links, gaps, multipliers, moments; scalars of joints; the eliminated matrix."""

    e: Any
    g: Any
    tension: Any
    moments: Any
    factor: Any
    slope: Any
    upper: Any
    solution: Any


@register_jitable
def layout(work, beads):
    """The parts of scratch for fibers of so many beads."""
    links = beads - 1
    padded = links + 2 * PAD
    e, at = take(work, 0, 3 * padded)
    g, at = take(work, at, 3 * padded)
    tension, at = take(work, at, 3 * padded)
    moments, at = take(work, at, 3 * padded)
    factor, at = take(work, at, padded)
    slope, at = take(work, at, padded)
    upper, at = take(work, at, 27 * (links + 3))
    solution, at = take(work, at, 3 * (links + 6))
    return _Parts(e, g, tension, moments, factor, slope, upper, solution), at


@inlined
def _joints(e, links, law, factor, slope, moments):
    """f, df/dcosθ and moments of the joints 0 … links + 1 of padded links e (joint j lies before link j)."""
    for j in range(links + 4):
        store(factor, j, splat(0.0))
        store(slope, j, splat(0.0))
        store3(moments, j, zero3())
    for j in range(1, links):
        t, u = load3(e, j + PAD - 1), load3(e, j + PAD)
        f = splat(1.0)
        if law == 1:
            f = rod_factor(t, u)
            store(slope, j + PAD, -0.5 * f * f)
        store(factor, j + PAD, f)
        store3(moments, j + PAD, scale(f, cross(t, u)))


@arithmetic
def _second_difference(left, here, right):
    """left − 2 here + right of a scalar of lanes."""
    return left - 2.0 * here + right


@arithmetic
def _second_difference3(left, here, right):
    """left − 2 here + right of a vector."""
    return add_scaled(add(left, right), -2.0, here)


@arithmetic
def _outer_joint(row, y, t, u):
    """Add y (D-combination of t, u)ᵀ to four blocks of a row: derivative of a joint's f."""
    a, b, c, d = row
    return (
        plus_outer(a, y, u),
        plus_outer(b, y, add_scaled(t, -2.0, u)),
        plus_outer(c, y, add_scaled(u, -2.0, t)),
        plus_outer(d, y, t),
    )


@part
def stage(chain, flow, ahead, work, motion):
    """Motion of a Chain in a Flow with torques Ahead; work: scratch."""
    state, beta, radius, law = chain
    velocity, rotation = flow
    history, lagged, sigma = ahead
    rates, multipliers = motion
    links = rates.shape[0] // 3 - 1
    (e, g, tension, moments, factor, slope, upper, solution), _ = layout(work, links + 1)
    for k in range(PAD):
        for end in (k, links + PAD + k):
            store3(e, end, zero3())
            store3(g, end, zero3())
            store3(tension, end, zero3())
    for k in range(81):
        store(upper, k, splat(0.0))
    for k in range(3):
        store3(solution, k, zero3())
        store3(solution, links + 3 + k, zero3())
    for i in range(links):
        link = load3(state, i)
        store3(e, i + PAD, link)
        store3(tension, i + PAD, load3(lagged, i))
        turned = cross(load3(history, i), link)
        store3(g, i + PAD, add_scaled(difference(velocity, i), 2.0 * radius, turned))
    _joints(e, links, law, factor, slope, moments)
    stiffness = sigma * beta
    for i in range(links):
        o = i + PAD
        e0, e1, e2, e3, e4 = load3(e, o - 2), load3(e, o - 1), load3(e, o), load3(e, o + 1), load3(e, o + 2)
        fa, fb = stiffness * load(factor, o - 1), stiffness * load(factor, o)
        fc, fd = stiffness * load(factor, o + 1), stiffness * load(factor, o + 2)
        c1, c3 = dot(e1, e2), dot(e2, e3)
        # σ E at the five links around i
        a0, p0 = fa * c1, scale(-1.0 * fa, e1)
        a1, p1 = fb - fa * dot(e0, e2), subtract(scale(fa, e0), scale(fb, e2))
        a2, p2 = -1.0 * (fb * c1 + fc * c3), add(scale(fb, e1), scale(fc, e3))
        a3, p3 = fc - fd * dot(e2, e4), subtract(scale(fd, e4), scale(fc, e2))
        a4, p4 = fd * c3, scale(-1.0 * fd, e3)
        l1, l2, l3 = load3(tension, o - 1), load3(tension, o), load3(tension, o + 1)
        s1, s2 = 0.75 * sigma, 1.5 * sigma
        a1, p1 = a1 - s1 * dot(e2, l1), add_scaled(p1, s1, l1)
        a2, p2 = a2 - s2 * dot(e2, l2), add_scaled(p2, s2, l2)
        a3, p3 = a3 - s1 * dot(e2, l3), add_scaled(p3, s1, l3)
        # right side
        spin = scale(radius, add(load3(rotation, i), load3(rotation, i + 1)))
        ahead = add(load3(moments, o + 1), load3(moments, o + 2))
        torque = subtract(ahead, add(load3(moments, o - 1), load3(moments, o)))
        right = add(difference(velocity, i), cross(e2, add_scaled(spin, beta, torque)))
        g0, g1, g2, g3, g4 = load3(g, o - 2), load3(g, o - 1), load3(g, o), load3(g, o + 1), load3(g, o + 2)
        right = add_scaled(add_scaled(right, -1.0 * a0, g0), -1.0 * dot(e2, g0), p0)
        right = add_scaled(add_scaled(right, -1.0 * a1, g1), -1.0 * dot(e2, g1), p1)
        right = add_scaled(add_scaled(right, -1.0 * a2, g2), -1.0 * dot(e2, g2), p2)
        right = add_scaled(add_scaled(right, -1.0 * a3, g3), -1.0 * dot(e2, g3), p3)
        right = add_scaled(add_scaled(right, -1.0 * a4, g4), -1.0 * dot(e2, g4), p4)
        # the seven blocks of row i: A + σ E D
        zero, none = splat(0.0), zero3()
        m0 = identity_plus(a0, p0, e2)
        m1 = identity_plus(a1 - 2.0 * a0, add_scaled(p1, -2.0, p0), e2)
        p = add_scaled(_second_difference3(p0, p1, p2), -0.75, e1)
        m2 = identity_plus(_second_difference(a0, a1, a2) + 0.75 * c1 - 1.0, p, e2)
        p = add_scaled(_second_difference3(p1, p2, p3), -1.5, e2)
        m3 = identity_plus(_second_difference(a1, a2, a3) + 3.5, p, e2)
        p = add_scaled(_second_difference3(p2, p3, p4), -0.75, e3)
        m4 = identity_plus(_second_difference(a2, a3, a4) + 0.75 * c3 - 1.0, p, e2)
        m5 = identity_plus(_second_difference(a3, a4, zero), _second_difference3(p3, p4, none), e2)
        m6 = identity_plus(a4, p4, e2)
        if law == 1:
            ya = scale(stiffness * load(slope, o - 1), cross(e2, cross(e0, e1)))
            yb = scale(stiffness * load(slope, o), cross(e2, cross(e1, e2)))
            yc = scale(-1.0 * stiffness * load(slope, o + 1), cross(e2, cross(e2, e3)))
            yd = scale(-1.0 * stiffness * load(slope, o + 2), cross(e2, cross(e3, e4)))
            m0, m1, m2, m3 = _outer_joint((m0, m1, m2, m3), ya, e0, e1)
            m1, m2, m3, m4 = _outer_joint((m1, m2, m3, m4), yb, e1, e2)
            m2, m3, m4, m5 = _outer_joint((m2, m3, m4, m5), yc, e2, e3)
            m3, m4, m5, m6 = _outer_joint((m3, m4, m5, m6), yd, e3, e4)
            right = add_scaled(right, -1.0 * (dot(e1, g0) + dot(e0, g1)), ya)
            right = add_scaled(right, -1.0 * (dot(e2, g1) + dot(e1, g2)), yb)
            right = add_scaled(right, -1.0 * (dot(e3, g2) + dot(e2, g3)), yc)
            right = add_scaled(right, -1.0 * (dot(e4, g3) + dot(e3, g4)), yd)
        # eliminate with the three rows before: each holds (U₁, U₂, U₃) and its right side
        u = 3 * i
        m1 = minus_product(m1, m0, load9(upper, u))
        m2 = minus_product(m2, m0, load9(upper, u + 1))
        m3 = minus_product(m3, m0, load9(upper, u + 2))
        right = minus_apply(right, m0, load3(solution, i))
        m2 = minus_product(m2, m1, load9(upper, u + 3))
        m3 = minus_product(m3, m1, load9(upper, u + 4))
        m4 = minus_product(m4, m1, load9(upper, u + 5))
        right = minus_apply(right, m1, load3(solution, i + 1))
        m3 = minus_product(m3, m2, load9(upper, u + 6))
        m4 = minus_product(m4, m2, load9(upper, u + 7))
        m5 = minus_product(m5, m2, load9(upper, u + 8))
        right = minus_apply(right, m2, load3(solution, i + 2))
        pivot = inverse(m3)
        store9(upper, u + 9, product(pivot, m4))
        store9(upper, u + 10, product(pivot, m5))
        store9(upper, u + 11, product(pivot, m6))
        store3(solution, i + 3, apply(pivot, right))
    for k in range(links):
        i = links - 1 - k
        u = 3 * i + 9
        x = load3(solution, i + 3)
        x = minus_apply(x, load9(upper, u), load3(solution, i + 4))
        x = minus_apply(x, load9(upper, u + 1), load3(solution, i + 5))
        x = minus_apply(x, load9(upper, u + 2), load3(solution, i + 6))
        store3(solution, i + 3, x)
    store3(solution, 2, zero3())
    for i in range(links):
        here = load3(solution, i + 3)
        store3(multipliers, i, here)
        bend = _second_difference3(load3(solution, i + 2), here, load3(solution, i + 4))
        gap = add(difference(velocity, i), bend)
        store3(rates, i, scale(0.5 / radius, cross(load3(state, i), gap)))
    store3(rates, links, mean_vector(velocity, links + 1))
