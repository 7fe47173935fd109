"""Rotne–Prager–Yamakawa mobility: beads move and spin each other, overlapping ones too; dense solves per
fiber.

Tensors of Wajnryb, Mizerski, Zuk & Szymczak (2013) and Zuk et al. (2014) for equal spheres. Forces F are
scaled by 1/6πμa and torques T by 1/6πμa², so that all are velocities, and spins are times a. With r in
units of a and n from bead j to bead i,

    v_i = V F_j + T_j × Q,      V = A I + B n nᵀ,        Q = q n,
    a ω_i = F_j × Q + R T_j,    R = ¾ (C I + D n nᵀ).

All are continuous at contact, and the whole mobility is symmetric positive definite for any positions.

A contact force f of link k pushes bead k with f, bead k + 1 with −f, and turns both with e_k × f. The slip of link i,
v_i − v_(i+1) − e_i × a(ω_i + ω_(i+1)), is then

    [V" + (e_k·Q' − e_i·Q*) I − e_k Q'ᵀ + Q* e_iᵀ − [e_i]× R" [e_k]×] f,

V" the second difference of V over the beads of both links, R" the sum of R, Q' the difference of Q over the beads of
i summed over those of k, and Q* its sum over the beads of i, of the difference over those of k.
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
    larger,
    load3,
    load6,
    scale,
    select_less,
    splat,
    sqrt,
    store3,
    store6,
    subtract,
    zero3,
)
from .bending import moment, rod_factor
from .blocks import take
from .layout import difference, mean_vector
from .matrix3 import (
    apply,
    apply_symmetric,
    apply_transposed,
    by_columns,
    cross_symmetric,
    identity_plus,
    minus,
    minus_product,
    minus_product_transposed,
    minus_transposed_product,
    plus,
    plus_outer,
    scaled,
    times_cross,
    transposed,
)


@arithmetic
def _isotropic_plus(alpha, b, n):
    """α I + b n nᵀ, symmetric."""
    p = scale(b, n)
    return (
        alpha + p[0] * n[0],
        p[0] * n[1],
        p[0] * n[2],
        alpha + p[1] * n[1],
        p[1] * n[2],
        alpha + p[2] * n[2],
    )


@arithmetic
def pair(x):
    """V, R and Q of two spheres a distance x apart, in units of a."""
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
    n = scale(i, x)
    return _isotropic_plus(a, b, n), _isotropic_plus(0.75 * c, 0.75 * d, n), scale(q, n)


class Pairs(NamedTuple):
    """V, R and Q of all beads i ≥ j, and per bead the sums of V and Q over all i."""

    translation: Any
    rotation: Any
    coupling: Any
    all_translation: Any
    all_coupling: Any


@inlined
def _place(i, j):
    high, low = max(i, j), min(i, j)
    return high * (high + 1) // 2 + low


@inlined
def _coupling(coupling, i, j):
    """Q, from bead j to bead i."""
    return scale(1.0 if i > j else -1.0, load3(coupling, _place(i, j)))


@inlined
def response(pairs, i, j, force, torque):
    """Velocity and spin of bead i from force and torque on bead j."""
    place, q = _place(i, j), _coupling(pairs.coupling, i, j)
    velocity = add(apply_symmetric(load6(pairs.translation, place), force), cross(torque, q))
    return velocity, add(apply_symmetric(load6(pairs.rotation, place), torque), cross(force, q))


@inlined
def torque_response(rotation, coupling, i, j, torque):
    """Velocity and spin of bead i from a torque on bead j."""
    spin = apply_symmetric(load6(rotation, _place(i, j)), torque)
    return cross(torque, _coupling(coupling, i, j)), spin


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
    bending, gaps ahead; slips of three columns at once."""

    bending: Any
    matrix: Any
    moments: Any
    free: Any
    ahead: Any
    slips: Any


@register_jitable
def layout(work, beads):
    """The parts of scratch for the rates of fibers of so many beads."""
    n, count = 3 * (beads - 1), beads * (beads + 1) // 2
    translation, at = take(work, 0, 6 * count)
    rotation, at = take(work, at, 6 * count)
    coupling, at = take(work, at, 3 * count)
    all_translation, at = take(work, at, 6 * beads)
    all_coupling, at = take(work, at, 3 * beads)
    factor, at = take(work, at, n * n)
    gaps, at = take(work, at, (n + 3) * n)
    v, at = take(work, at, n + 3)
    s, at = take(work, at, n + 3)
    torques, at = take(work, at, n + 3)
    pairs = Pairs(translation, rotation, coupling, all_translation, all_coupling)
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
    slips, at = take(work, at, 3 * n)
    return (parts, _StageParts(bending, matrix, moments, free, ahead, slips)), at


@inlined
def _slip(state, v, s, i):
    """v_i − v_(i+1) − e_i × (s_i + s_(i+1)): what rolling contact forbids."""
    return subtract(scale(-1.0, difference(v, i)), cross(load3(state, i), add(load3(s, i), load3(s, i + 1))))


# matrices of scratch, row by row, in blocks of 3 × 3; `blocks`: of which each row has so many


@inlined
def _block(matrix, blocks, i, k):
    a = load3(matrix, 3 * i * blocks + k)
    b = load3(matrix, (3 * i + 1) * blocks + k)
    c = load3(matrix, (3 * i + 2) * blocks + k)
    return a[0], a[1], a[2], b[0], b[1], b[2], c[0], c[1], c[2]


@inlined
def _store_block(matrix, blocks, i, k, m):
    store3(matrix, 3 * i * blocks + k, (m[0], m[1], m[2]))
    store3(matrix, (3 * i + 1) * blocks + k, (m[3], m[4], m[5]))
    store3(matrix, (3 * i + 2) * blocks + k, (m[6], m[7], m[8]))


@arithmetic
def _gap(v, alpha, e, q):
    """−(V + α I − e qᵀ), V symmetric: of v_(i+1) − v_i where v_i − v_(i+1) = V f + (e × f) × q, α = e·q."""
    m = identity_plus(alpha, scale(-1.0, e), q)
    full = v[0], v[1], v[2], v[1], v[3], v[4], v[2], v[4], v[5]
    return tuple(-1.0 * a - b for a, b in zip(full, m, strict=True))


@arithmetic
def _turned(q):
    """The matrix of T × q, of a torque T."""
    return 0.0, q[2], -1.0 * q[1], -1.0 * q[2], 0.0, q[0], q[1], -1.0 * q[0], 0.0


@inlined
def _differences(v, r, q, i, k):
    """V", R", Q' and Q* of links i ≥ k, of V, R and Q of all pairs."""
    a, b = _place(i, k), _place(i, k + 1)
    c, d = _place(i + 1, k), _place(i + 1, k + 1)
    translation = minus(plus(load6(v, a), load6(v, d)), plus(load6(v, b), load6(v, c)))
    rotation = plus(plus(load6(r, a), load6(r, d)), plus(load6(r, b), load6(r, c)))
    straight = subtract(_coupling(q, i, k), _coupling(q, i + 1, k + 1))
    across = subtract(_coupling(q, i + 1, k), _coupling(q, i, k + 1))
    return translation, rotation, subtract(straight, across), add(straight, across)


@part
def _fill(state, pairs):
    """V, R and Q of all pairs, and their sums."""
    beads = state.shape[0] // 3
    translation, rotation, coupling, all_translation, all_coupling = pairs
    one, none, spin = splat(1.0), splat(0.0), splat(0.75)
    for i in range(beads):
        first = i * (i + 1) // 2
        store6(translation, first + i, (one, none, none, one, none, one))
        store6(rotation, first + i, (spin, none, none, spin, none, spin))
        store3(coupling, first + i, zero3())
        total, sums, x = (one, none, none, one, none, one), zero3(), zero3()
        for j in range(i - 1, -1, -1):  # from the nearest bead on: x = r_i − r_j
            x = add_scaled(x, 2.0, load3(state, j))
            v, r, q = pair(x)
            store6(translation, first + j, v)
            store6(rotation, first + j, r)
            store3(coupling, first + j, q)
            store6(all_translation, j, plus(load6(all_translation, j), v))
            store3(all_coupling, j, add(load3(all_coupling, j), q))
            total, sums = plus(total, v), subtract(sums, q)
        store6(all_translation, i, total)
        store3(all_coupling, i, sums)


@arithmetic
def _cholesky(m):
    """L of m = L Lᵀ, its diagonal inverted."""
    d0 = 1.0 / sqrt(m[0])
    l10, l20 = m[3] * d0, m[6] * d0
    d1 = 1.0 / sqrt(m[4] - l10 * l10)
    l21 = (m[7] - l20 * l10) * d1
    d2 = 1.0 / sqrt(m[8] - l20 * l20 - l21 * l21)
    return d0, 0.0, 0.0, l10, d1, 0.0, l20, l21, d2


@arithmetic
def _divided(m, corner):
    """m L⁻ᵀ, L as _cholesky gives it."""
    rows: tuple = ()
    for r in (0, 3, 6):
        x = m[r] * corner[0]
        y = (m[r + 1] - x * corner[3]) * corner[4]
        rows += (x, y, (m[r + 2] - x * corner[6] - y * corner[7]) * corner[8])
    return rows


@arithmetic
def _forth(corner, v):
    """L⁻¹ v."""
    x = corner[0] * v[0]
    y = corner[4] * (v[1] - corner[3] * x)
    return x, y, corner[8] * (v[2] - corner[6] * x - corner[7] * y)


@arithmetic
def _back(corner, v):
    """L⁻ᵀ v."""
    z = corner[8] * v[2]
    y = corner[4] * (v[1] - corner[7] * z)
    return corner[0] * (v[0] - corner[3] * y - corner[6] * z), y, z


@arithmetic
def _forward(corner, m):
    """L⁻¹ m."""
    return by_columns(_forth, corner, m)


@arithmetic
def _backward(corner, m):
    """L⁻ᵀ m."""
    return by_columns(_back, corner, m)


@arithmetic
def _eliminated(m):
    """L and Uᵀ of m = L U in one, L with ones on its diagonal; that of U inverted. Transposed, _divided and _back
    take it for m U⁻¹ and U⁻¹ v."""
    r0 = 1.0 / m[0]
    l10, l20 = m[3] * r0, m[6] * r0
    r1, u12 = 1.0 / (m[4] - l10 * m[1]), m[5] - l10 * m[2]
    l21 = (m[7] - l20 * m[1]) * r1
    return r0, m[1], m[2], l10, r1, u12, l20, l21, 1.0 / (m[8] - l20 * m[2] - l21 * u12)


@arithmetic
def _reduced(lower, v):
    """L⁻¹ v, L as _eliminated gives it."""
    y = v[1] - lower[3] * v[0]
    return v[0], y, v[2] - lower[6] * v[0] - lower[7] * y


@arithmetic
def _reduced_block(lower, m):
    """L⁻¹ m, as _reduced."""
    return by_columns(_reduced, lower, m)


@part
def assemble(state, pairs, factor, gaps):
    """Cholesky factor (lower, its diagonal inverted) of the constraint matrix, and gaps from multipliers.

    Column 3k + c of gaps (3N, 3(N−1)) holds, for a unit multiplier of link k, all v_(i+1) − v_i and the
    mean v.
    """
    links = state.shape[0] // 3 - 1
    share = 1.0 / (links + 1)
    translation, rotation, coupling, all_translation, all_coupling = pairs
    _fill(state, pairs)
    for k in range(links):
        e = load3(state, k)
        for i in range(k, links):
            own = load3(state, i)
            v, r, before, after = _differences(translation, rotation, coupling, i, k)
            alpha, beta = dot(e, before), dot(own, after)
            gap = _gap(v, alpha, e, before)
            _store_block(gaps, links, k, i, _gap(v, -1.0 * beta, own, scale(-1.0, after)))
            _store_block(gaps, links, i, k, gap)
            turned = times_cross(cross_symmetric(own, r), e)
            _store_block(factor, links, i, k, _slip_block(gap, beta, after, own, turned))
        force = minus(load6(all_translation, k + 1), load6(all_translation, k))
        torque = scale(-1.0, add(load3(all_coupling, k), load3(all_coupling, k + 1)))
        mean = _gap(force, dot(e, torque), e, torque)
        _store_block(gaps, links, links, k, scaled(share, mean))
    for k in range(links):
        for i in range(k, links):
            m = _block(factor, links, i, k)
            for j in range(k):
                m = minus_product_transposed(m, _block(factor, links, i, j), _block(factor, links, k, j))
            if i == k:
                _store_block(factor, links, k, k, _cholesky(m))
            else:
                _store_block(factor, links, i, k, _divided(m, _block(factor, links, k, k)))


@arithmetic
def _slip_block(gap, beta, after, e, turned):
    """−gap − β I + Q* e_iᵀ − [e_i]× R" [e_k]×."""
    m = identity_plus(-1.0 * beta, after, e)
    return tuple(a - b - c for a, b, c in zip(m, gap, turned, strict=True))


@part
def roll(state, factor, gaps, v, s, multipliers, out):
    """Multipliers that stop the slip of velocities v and spins s; out: resulting gaps and mean velocity."""
    links = state.shape[0] // 3 - 1
    for i in range(links):
        x = scale(-1.0, _slip(state, v, s, i))
        for k in range(i):
            x = subtract(x, apply(_block(factor, links, i, k), load3(multipliers, k)))
        store3(multipliers, i, _forth(_block(factor, links, i, i), x))
    for back in range(links):
        i = links - 1 - back
        x = load3(multipliers, i)
        for k in range(i + 1, links):
            x = subtract(x, apply_transposed(_block(factor, links, k, i), load3(multipliers, k)))
        store3(multipliers, i, _back(_block(factor, links, i, i), x))
    for i in range(links + 1):
        x = difference(v, i) if i < links else mean_vector(v, links + 1)
        for k in range(links):
            x = add(x, apply(_block(gaps, links, i, k), load3(multipliers, k)))
        store3(out, i, x)


@part
def _roll_columns(factor, gaps, links, x, out, joint):
    """As roll for three columns at once: x, their slips, is overwritten; their gaps, in the place of the joint in out,
    are completed."""
    for i in range(links):
        m = _block(x, 1, i, 0)
        for k in range(i):
            m = minus_product(m, _block(factor, links, i, k), _block(x, 1, k, 0))
        _store_block(x, 1, i, 0, _forward(_block(factor, links, i, i), m))
    for back in range(links):
        i = links - 1 - back
        m = _block(x, 1, i, 0)
        for k in range(i + 1, links):
            m = minus_transposed_product(m, _block(factor, links, k, i), _block(x, 1, k, 0))
        _store_block(x, 1, i, 0, _backward(_block(factor, links, i, i), m))
    for i in range(links + 1):
        m = _block(out, links - 1, i, joint)
        for k in range(links):
            m = minus_product(m, _block(gaps, links, i, k), _block(x, 1, k, 0))
        _store_block(out, links - 1, i, joint, m)


@part
def torques_to_motion(pairs, torques, v, s):
    """Add to v and s what torques on all beads cause."""
    beads = v.shape[0] // 3
    rotation, coupling = pairs.rotation, pairs.coupling
    for i in range(beads):
        velocity, spin = load3(v, i), load3(s, i)
        for j in range(beads):
            dv, ds = torque_response(rotation, coupling, i, j, load3(torques, j))
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
    assemble(state, pairs, factor, gaps)
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


@arithmetic
def _spun(t, here, u, before, factor):
    """factor ([t]× here − [u]× before), matrices."""
    rows = []
    for a, b in ((1, 2), (2, 0), (0, 1)):
        for c in range(3):
            change = t[a] * here[3 * b + c] - t[b] * here[3 * a + c]
            rows.append(factor * (change - (u[a] * before[3 * b + c] - u[b] * before[3 * a + c])))
    return tuple(rows)


@arithmetic
def _along(t, here, u, before):
    """tᵀ here + uᵀ before."""
    return tuple(
        t[0] * here[c]
        + t[1] * here[3 + c]
        + t[2] * here[6 + c]
        + u[0] * before[c]
        + u[1] * before[3 + c]
        + u[2] * before[6 + c]
        for c in range(3)
    )


@inlined
def _moment_columns(state, g, joint, j, law):
    """Change of the moment at bead j under the changes g of the links in the columns of a joint."""
    joints = state.shape[0] // 3 - 2
    t, u = load3(state, j - 1), load3(state, j)
    before, here = _block(g, joints, j - 1, joint), _block(g, joints, j, joint)
    f = splat(1.0)
    if law == 1:
        f = rod_factor(t, u)
    change = _spun(t, here, u, before, f)
    if law == 1:
        change = plus_outer(change, scale(-0.5 * f * f, cross(t, u)), _along(t, here, u, before))
    return change


@arithmetic
def _identity_less(own, factor, m):
    """own I − factor m."""
    return tuple((own if i % 4 == 0 else 0.0) - factor * m[i] for i in range(9))


@inlined
def _joint_columns(state, pairs, j, slips, out):
    """Slips and gaps, and in the last place the mean velocity, from unit moments at bead j: they turn the bead before
    it forth and the bead behind it back. out: in the place of joint j − 1."""
    links = state.shape[0] // 3 - 1
    _, r, coupling, _, all_coupling = pairs
    for i in range(links):
        a, b, c, d = _place(i, j - 1), _place(i, j + 1), _place(i + 1, j - 1), _place(i + 1, j + 1)
        q = subtract(_coupling(coupling, i, j - 1), _coupling(coupling, i + 1, j - 1))
        q = subtract(q, subtract(_coupling(coupling, i, j + 1), _coupling(coupling, i + 1, j + 1)))
        spin = minus(plus(load6(r, a), load6(r, c)), plus(load6(r, b), load6(r, d)))
        gap = _turned(scale(-4.0 / 3.0, q))
        _store_block(out, links - 1, i, j - 1, gap)
        _store_block(slips, 1, i, 0, _joint_slip(gap, cross_symmetric(load3(state, i), spin)))
    q = subtract(load3(all_coupling, j - 1), load3(all_coupling, j + 1))
    _store_block(out, links - 1, links, j - 1, _turned(scale(4.0 / 3.0 / (links + 1), q)))


@arithmetic
def _joint_slip(gap, turned):
    """−gap − 4/3 [e]× R."""
    return tuple(-1.0 * a - 4.0 / 3.0 * b for a, b in zip(gap, turned, strict=True))


@part
def _solve(matrix, blocks, x):
    """x = matrix⁻¹ x, by elimination in blocks; the matrix is overwritten."""
    for k in range(blocks):
        lower = _eliminated(_block(matrix, blocks, k, k))
        upper = transposed(lower)
        _store_block(matrix, blocks, k, k, upper)
        own = _reduced(lower, load3(x, k))
        store3(x, k, own)
        for j in range(k + 1, blocks):
            _store_block(matrix, blocks, k, j, _reduced_block(lower, _block(matrix, blocks, k, j)))
        for i in range(k + 1, blocks):
            ratio = _divided(_block(matrix, blocks, i, k), upper)
            for j in range(k + 1, blocks):
                m = minus_product(_block(matrix, blocks, i, j), ratio, _block(matrix, blocks, k, j))
                _store_block(matrix, blocks, i, j, m)
            store3(x, i, subtract(load3(x, i), apply(ratio, own)))
    for back in range(blocks):
        k = blocks - 1 - back
        rest = load3(x, k)
        for j in range(k + 1, blocks):
            rest = subtract(rest, apply(_block(matrix, blocks, k, j), load3(x, j)))
        store3(x, k, _back(_block(matrix, blocks, k, k), rest))


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
    joints = links - 1
    (common, own), _ = stage_layout(work, links + 1)
    pairs, factor, gaps, v, s, _ = common
    bending, matrix, moments, free, g, slips = own
    assemble(state, pairs, factor, gaps)
    for j in range(joints):
        _joint_columns(state, pairs, j + 1, slips, bending)
        _roll_columns(factor, gaps, links, slips, bending, j)
        for i in range(joints):
            change = _moment_columns(state, bending, j, i + 1, law)
            unit = splat(1.0) if i == j else splat(0.0)
            _store_block(matrix, joints, i, j, _identity_less(unit, beta * sigma, change))
    ambient(flow, radius, v, s)
    roll(state, factor, gaps, v, s, multipliers, free)
    for i in range(links):
        turned = cross(load3(history, i), load3(state, i))
        store3(g, i, add_scaled(load3(free, i), 2.0 * radius, turned))
    for j in range(joints):
        bend, change = _moment_change(state, g, j + 1, law)
        store3(moments, j, scale(beta, add_scaled(bend, sigma, change)))
    _solve(matrix, joints, moments)
    for i in range(links + 1):
        x = load3(free, i)
        for j in range(joints):
            x = add(x, apply(_block(bending, joints, i, j), load3(moments, j)))
        if i < links:
            x = scale(0.5 / radius, cross(load3(state, i), x))
        store3(rates, i, x)
