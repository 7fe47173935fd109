"""What fibers do to the fluid: the force and torque of every bead on it, at the instant of a sample.

Bead i puts F_i = f_i − f_(i−1) and T_i = γ_i + a (e_i × f_i + e_(i−1) × f_(i−1)) on the fluid, f_i the contact force of
link i, γ_i the bending torque: what the mobility acts on, and in free drain 6πμa (v_i − u_i) and 8πμa³ (ω_i − Ω_i).
They sum to zero over a fiber, and with rolling contact doing no work

    Σ F_i·u_i + T_i·Ω_i = −Φ − dE_b/dt,    Φ = Σ F_i·(v_i − u_i) + T_i·(ω_i − Ω_i),

whatever the moments. Fibers moved by ab3 have those of their shape. The others hold stiff modes, which would drown the
force in what is left of them: theirs are the moments at links e + hd(k₂ − k₁) × e of two linearly implicit stages at
the same links, k₁ with κ = 0 and k₂ with κ = −k₁ (implicit.py). A mode that relaxes at the rate Λ then counts
(1 + 2z)/(1 + z)² = 1 + O(z²) times, z = hdΛ: all of a slow one, nothing of one that is gone within the step.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numba.extending import register_jitable
from numpy.typing import NDArray

from ..compiled import inlined, kernel, part, part_of, woven
from ..simd import (
    LANES,
    add,
    add_scaled,
    cross,
    dot,
    load,
    load3,
    scale,
    smaller,
    splat,
    store3,
    subtract,
    zero3,
)
from . import free_drain, implicit_drain, rpy
from .bending import moment, rod_factor
from .blocks import Ahead, Chain, Flow, Motion, rows_of, take
from .implicit import D
from .mobility import work_rows

RIGID = 2e6  # largest σβ: stiffer fibers exert the same, but for the rounding of their moments


class Reaction(NamedTuple):
    """On the fluid: force [N] and torque [N m] of each bead, (..., 3). bending, friction: the powers dE_b/dt and Φ of
    all fibers [W]."""

    force: NDArray
    torque: NDArray
    bending: float
    friction: float

    def exchange(self, velocity: NDArray, rotation: NDArray) -> float:
        """Σ F·u + T·Ω of the sampled flow, (..., 3) each: the power that the fluid gets [W]."""
        return float(np.vdot(self.force, velocity) + np.vdot(self.torque, rotation))


class _Parts(NamedTuple):
    """Scratch: k₁, k₂, κ; no multipliers, and those of the contacts; moments; forces and torques."""

    first: Any
    rates: Any
    history: Any
    none: Any
    multipliers: Any
    moments: Any
    force: Any
    torque: Any


@register_jitable
def layout(work, beads):
    """The parts of scratch for fibers of so many beads; what follows is that of the mobility."""
    rows = 3 * beads
    first, at = take(work, 0, rows)
    rates, at = take(work, at, rows)
    history, at = take(work, at, rows)
    none, at = take(work, at, rows - 3)
    multipliers, at = take(work, at, rows - 3)
    moments, at = take(work, at, rows + 6)
    force, at = take(work, at, rows)
    torque, at = take(work, at, rows)
    return _Parts(first, rates, history, none, multipliers, moments, force, torque), at


def scratch_rows(mobility: str, beads: int) -> int:
    """Scratch rows per thread for fibers of so many beads."""
    mobile = max(work_rows(mobility, beads, implicit) for implicit in (False, True))
    return rows_of(layout, beads) + mobile


@inlined
def _moment_ahead(e, turn, j, law):
    """Moment at bead j, linearised, when the links around it turn by `turn`."""
    t, u = load3(e, j - 1), load3(e, j)
    dt, du = cross(load3(turn, j - 1), t), cross(load3(turn, j), u)
    bend, change = cross(t, u), add(cross(dt, u), cross(t, du))
    if law == 1:
        f = rod_factor(t, u)
        change = add_scaled(scale(f, change), -0.5 * f * f * (dot(dt, u) + dot(t, du)), bend)
        bend = scale(f, bend)
    return add(bend, change)


@part
def _loads(state, beta, multipliers, moments, force, torque):
    """Forces over 6πμa and torques over 6πμa² of all beads; moments (N + 2 vectors) begin one before bead 0."""
    links = state.shape[0] // 3 - 1
    below, twist = zero3(), zero3()
    for i in range(links + 1):
        above, turned = zero3(), zero3()
        if i < links:
            above = load3(multipliers, i)
            turned = cross(load3(state, i), above)
        bend = scale(4.0 / 3.0 * beta, subtract(load3(moments, i + 2), load3(moments, i)))
        store3(force, i, subtract(above, below))
        store3(torque, i, add(bend, add(turned, twist)))
        below, twist = above, turned


@inlined
def _spin_power(stiff, moments, i, spin):
    """Power over 6πμa of the bending torque on bead i, which spins (times a) so."""
    return 4.0 / 3.0 * stiff * dot(subtract(load3(moments, i + 2), load3(moments, i)), spin)


@inlined
def _drain_powers(work, stiff, parts, spins, radius):
    """−dE_b/dt and Φ, over 6πμa, of beads each alone; spins: ambient rotation."""
    bend, lost = splat(0.0), splat(0.0)
    for i in range(parts.force.shape[0] // 3):
        f, t = load3(parts.force, i), load3(parts.torque, i)
        lost = lost + dot(f, f) + 0.75 * dot(t, t)
        spin = add_scaled(scale(0.75, t), radius, load3(spins, i))
        bend = bend + _spin_power(stiff, parts.moments, i, spin)
    return bend, lost


@part
def _rpy_powers(work, stiff, parts, spins, radius):
    """The same of beads that move each other."""
    beads = parts.force.shape[0] // 3
    pairs = rpy.layout(work, beads)[0].pairs
    bend, lost = splat(0.0), splat(0.0)
    for i in range(beads):
        velocity, spin = zero3(), zero3()
        for j in range(beads):
            dv, ds = rpy.response(pairs, i, j, load3(parts.force, j), load3(parts.torque, j))
            velocity, spin = add(velocity, dv), add(spin, ds)
        lost = lost + dot(load3(parts.force, i), velocity) + dot(load3(parts.torque, i), spin)
        bend = bend + _spin_power(stiff, parts.moments, i, add_scaled(spin, radius, load3(spins, i)))
    return bend, lost


@woven
def _exert(
    solve, balance, share, shares, material, sigma, state, velocity, rotation, scratch, sizes, powers, out
):
    """Forces and torques (F, 2, N, 3) of this share's blocks, times sizes; powers (B, 3, LANES): −dE_b/dt, Φ over 6πμa.

    solve(chain, flow, sigma, parts, work): rates, multipliers and moments of a block, and β of these.
    """
    law, radius, beta = material
    beads = out.shape[2]
    parts, used = layout(scratch[share], beads)
    work, _ = take(scratch[share], used, scratch.shape[1] - used)
    begin, end = part_of(share, shares, state.shape[0])
    for b in range(begin, end):
        chain = Chain(state[b], load(beta, b), radius, law)
        stiff = solve(chain, Flow(velocity[b], rotation[b]), sigma, parts, work)
        _loads(state[b], stiff, parts.multipliers, parts.moments, parts.force, parts.torque)
        bend, lost = balance(work, stiff, parts, rotation[b], radius)
        store3(powers[b], 0, (bend, lost, splat(0.0)))
        for lane in range(min(LANES, out.shape[0] - b * LANES)):
            fiber = b * LANES + lane
            for i in range(beads):
                for c in range(3):
                    out[fiber, 0, i, c] = sizes[0] * parts.force[3 * i + c, lane]
                    out[fiber, 1, i, c] = sizes[1] * parts.torque[3 * i + c, lane]


@inlined
def _without_ends(moments, beads):
    """No moments at the ends, and beyond them."""
    for end in (0, 1, beads, beads + 1):
        store3(moments, end, zero3())


@woven
def _now(link_rates, chain, flow, sigma, parts, work):
    """The moments of the shape."""
    beads = parts.rates.shape[0] // 3
    link_rates(chain, flow, work, Motion(parts.rates, parts.multipliers))
    _without_ends(parts.moments, beads)
    for j in range(1, beads - 1):
        store3(parts.moments, j + 1, moment(load3(chain.links, j - 1), load3(chain.links, j), chain.law))
    return chain.beta


@woven
def _ahead(stage, chain, flow, sigma, parts, work):
    """Those of two implicit stages."""
    beads = parts.rates.shape[0] // 3
    e, beta, radius, law = chain
    stiff = smaller(beta, splat(RIGID / sigma))
    own = Chain(e, stiff, radius, law)
    step = splat(sigma)
    for i in range(beads - 1):
        store3(parts.none, i, zero3())
    for i in range(beads):
        store3(parts.history, i, zero3())
    stage(own, flow, Ahead(parts.history, parts.none, step), work, Motion(parts.first, parts.multipliers))
    for i in range(beads):
        store3(parts.history, i, scale(-1.0, load3(parts.first, i)))
    stage(own, flow, Ahead(parts.history, parts.none, step), work, Motion(parts.rates, parts.multipliers))
    for i in range(beads):
        turn = subtract(load3(parts.rates, i), load3(parts.first, i))
        store3(parts.first, i, scale(2.0 * radius * sigma, turn))
    _without_ends(parts.moments, beads)
    for j in range(1, beads - 1):
        store3(parts.moments, j + 1, _moment_ahead(e, parts.first, j, law))
    return stiff


@part
def _drain_now(chain, flow, sigma, parts, work):
    drain = free_drain.link_rates
    return _now(drain, chain, flow, sigma, parts, work)


@part
def _drain_ahead(chain, flow, sigma, parts, work):
    drain = implicit_drain.stage
    stiff = _ahead(drain, chain, flow, sigma, parts, work)
    # the contacts under these very moments, which spin a bead of its own drag as an ambient rotation does
    e, _, radius, law = chain
    for i in range(parts.rates.shape[0] // 3):
        bend = subtract(load3(parts.moments, i + 2), load3(parts.moments, i))
        store3(parts.torque, i, add_scaled(load3(flow.rotation, i), (1.0 / radius) * stiff, bend))
    limp = Chain(e, splat(0.0), radius, law)
    free_drain.link_rates(
        limp, Flow(flow.velocity, parts.torque), work, Motion(parts.rates, parts.multipliers)
    )
    return stiff


@part
def _rpy_now(chain, flow, sigma, parts, work):
    hydro = rpy.link_rates
    return _now(hydro, chain, flow, sigma, parts, work)


@part
def _rpy_ahead(chain, flow, sigma, parts, work):
    hydro = rpy.stage
    stiff = _ahead(hydro, chain, flow, sigma, parts, work)
    # the contacts under these very moments
    beads = parts.rates.shape[0] // 3
    for i in range(beads):
        bend = subtract(load3(parts.moments, i + 2), load3(parts.moments, i))
        store3(parts.torque, i, scale(4.0 / 3.0 * stiff, bend))
    rpy.contacts(chain, flow, parts.torque, work, parts.multipliers, parts.force)
    return stiff


@kernel
def _exert_drain_now(share, shares, material, sigma, state, velocity, rotation, scratch, sizes, powers, out):
    solve, balance = _drain_now, _drain_powers
    _exert(
        solve, balance, share, shares, material, sigma, state, velocity, rotation, scratch, sizes, powers, out
    )


@kernel
def _exert_drain_ahead(
    share, shares, material, sigma, state, velocity, rotation, scratch, sizes, powers, out
):
    solve, balance = _drain_ahead, _drain_powers
    _exert(
        solve, balance, share, shares, material, sigma, state, velocity, rotation, scratch, sizes, powers, out
    )


@kernel
def _exert_rpy_now(share, shares, material, sigma, state, velocity, rotation, scratch, sizes, powers, out):
    solve, balance = _rpy_now, _rpy_powers
    _exert(
        solve, balance, share, shares, material, sigma, state, velocity, rotation, scratch, sizes, powers, out
    )


@kernel
def _exert_rpy_ahead(share, shares, material, sigma, state, velocity, rotation, scratch, sizes, powers, out):
    solve, balance = _rpy_ahead, _rpy_powers
    _exert(
        solve, balance, share, shares, material, sigma, state, velocity, rotation, scratch, sizes, powers, out
    )


# by mobility, and whether the moments are those of implicit stages
EXERT = {
    ("freeDrain", False): _exert_drain_now,
    ("freeDrain", True): _exert_drain_ahead,
    ("rpy", False): _exert_rpy_now,
    ("rpy", True): _exert_rpy_ahead,
}


def implicit_sigma(time_step: float, radius: float) -> float:
    """h d/2a of an implicit stage for a step of this length."""
    return float(0.5 * D * time_step / radius)


def powers_of(powers: NDArray, count: int, viscosity: float, radius: float) -> tuple[float, float]:
    """dE_b/dt and Φ of all fibers, of what EXERT's kernels give."""
    bend, lost = np.moveaxis(powers, 1, 0).reshape(3, -1)[:2, :count].sum(axis=1)
    drag = 6 * np.pi * viscosity * radius
    return -drag * float(bend), drag * float(lost)
