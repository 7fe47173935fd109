"""Free drain: every bead feels its own Stokes drag only, and the rolling constraint is block tridiagonal.

With drag 6πμa and 8πμa³, ambient velocity U and rotation Ω, moments M in units of K/2a, and multipliers λ
scaled to velocities (contact force × 1/6πμa), bead velocities and link rates are

    v_i = U_i + λ_i − λ_(i−1),        2a de_i/dt = v_(i+1) − v_i,

and rolling, v_i − a e_i×ω_i = v_(i+1) + a e_i×ω_(i+1), gives for every link the three equations

    (7/2 I − 3/2 e_i e_iᵀ) λ_i + B_i λ_(i−1) + B_(i+1)ᵀ λ_(i+1)
        = U_(i+1) − U_i + e_i × [a(Ω_i + Ω_(i+1)) + β(M_(i+1) − M_(i−1) + M_(i+2) − M_i)],
    B_i = (3/4 e_(i−1)·e_i − 1) I − 3/4 e_(i−1) e_iᵀ.

The matrix is symmetric positive definite; it is solved by block elimination.
"""

from numba.extending import register_jitable

from ..compiled import inlined, part
from ..simd import (
    add,
    add_scaled,
    cross,
    dot,
    larger,
    load3,
    load6,
    scale,
    splat,
    store3,
    store6,
    subtract,
    zero3,
)
from .bending import moment
from .blocks import take
from .layout import difference, mean_vector
from .matrix3 import apply_symmetric, inverse_symmetric


@register_jitable
def layout(work, beads):
    """The inverse pivots of the links, in scratch."""
    return take(work, 0, 6 * (beads - 1))


@inlined
def _pivot(e, p, alpha, x):
    """Diagonal block of link e minus B X Bᵀ, X the inverse pivot of the link p before it."""
    y = apply_symmetric(x, e)
    g = add_scaled(scale(-0.75 * alpha, y), 0.28125 * dot(e, y), p)
    square = alpha * alpha
    return (
        3.5 - 1.5 * e[0] * e[0] - square * x[0] - 2.0 * p[0] * g[0],
        -1.5 * e[0] * e[1] - square * x[1] - p[0] * g[1] - p[1] * g[0],
        -1.5 * e[0] * e[2] - square * x[2] - p[0] * g[2] - p[2] * g[0],
        3.5 - 1.5 * e[1] * e[1] - square * x[3] - 2.0 * p[1] * g[1],
        -1.5 * e[1] * e[2] - square * x[4] - p[1] * g[2] - p[2] * g[1],
        3.5 - 1.5 * e[2] * e[2] - square * x[5] - 2.0 * p[2] * g[2],
    )


@part
def link_rates(chain, flow, work, motion):
    """Motion of a Chain in a Flow; work: scratch. Returns the largest |e·λ|², the tension over 6πμa."""
    state, beta, radius, law = chain
    velocity, rotation = flow
    rates, multipliers = motion
    links = rates.shape[0] // 3 - 1
    pivots, _ = layout(work, links + 1)
    e = load3(state, 0)
    before = zero3()  # moments at the beads i − 1, i, i + 1
    here = zero3()
    after = zero3()
    if links > 1:
        after = moment(e, load3(state, 1), law)
    spin = load3(rotation, 0)
    none = splat(0.0)
    p, x, r = e, (none, none, none, none, none, none), zero3()
    for i in range(links):
        beyond = zero3()
        if i + 2 < links:
            beyond = moment(load3(state, i + 1), load3(state, i + 2), law)
        next_spin = load3(rotation, i + 1)
        torque = subtract(add(after, beyond), add(before, here))
        turn = add_scaled(scale(radius, add(spin, next_spin)), beta, torque)
        right = add(difference(velocity, i), cross(e, turn))
        alpha = 0.75 * dot(p, e) - 1.0
        z = apply_symmetric(x, r)
        r = add_scaled(add_scaled(right, -1.0 * alpha, z), 0.75 * dot(e, z), p)
        x = inverse_symmetric(_pivot(e, p, alpha, x))
        store6(pivots, i, x)
        store3(multipliers, i, r)
        before, here, after, spin = here, after, beyond, next_spin
        p = e
        if i + 1 < links:
            e = load3(state, i + 1)
    above = zero3()
    above_e = e
    for k in range(links):
        i = links - 1 - k
        e = load3(state, i)
        alpha = 0.75 * dot(e, above_e) - 1.0
        r = add_scaled(load3(multipliers, i), -1.0 * alpha, above)
        r = add_scaled(r, 0.75 * dot(e, above), above_e)
        above = apply_symmetric(load6(pivots, i), r)
        store3(multipliers, i, above)
        above_e = e
    tension = splat(0.0)
    below = zero3()
    here = load3(multipliers, 0)
    inverse_diameter = 0.5 / radius
    for i in range(links):
        above = zero3()
        if i + 1 < links:
            above = load3(multipliers, i + 1)
        e = load3(state, i)
        gap = add(difference(velocity, i), subtract(add(above, below), scale(2.0, here)))
        store3(rates, i, scale(inverse_diameter, cross(e, gap)))
        pull = dot(e, here)
        tension = larger(pull * pull, tension)
        below, here = here, above
    store3(rates, links, mean_vector(velocity, links + 1))
    return tension
