"""Bending: curvature laws, their energies, and the torque coefficient.

The moment at an inner bead between links t and t' is m = (K/2a) f(t·t') t × t', f = 1 for the paper's law κ
= sin θ/2a (eqs. 3–5) and f = 2/(1 + cos θ) for the discrete elastic rod, κ = 2 tan(θ/2)/2a. Neither divides
by |t × t'|: collinear links feel no moment. Rolling makes the rotation rate of a link the mean of its
beads' rates, so the torque conjugate to the energy is γ_i = ½ (m_(i+1) − m_(i−1)); eq. (6) as printed lacks
the ½.
"""

import numpy as np

from ..compiled import inlined
from ..simd import arithmetic, cross, dot, larger, scale

TORQUES = {"consistent": 0.5, "asPrinted": 1.0}
FOLD = 1e-12  # smallest 1 + cos θ: keeps the moment of a folded discrete rod finite


def bending_energy(links: np.ndarray, stiffness: np.ndarray, radius: float, law: str) -> np.ndarray:
    """(F,) elastic energy of links (F, N−1, 3): Σ (K/2a)(1 − cos θ), or −Σ (K/a) ln((1 + cos θ)/2)."""
    # sin²(θ/2) = |t − t'|²/4 keeps its digits for small angles
    density = (np.diff(links, axis=1) ** 2).sum(axis=2) / 4
    if law == "discreteRod":
        density = -np.log1p(-np.minimum(density, 1 - FOLD / 2))
    return stiffness / radius * density.sum(axis=1)


def velocity_scale(fibers) -> np.ndarray:
    """(F,) β: the torque coefficient times a/(8πμa³), a velocity; a bead spins at β/a per unit |t × t'|."""
    stiffness = TORQUES[fibers.bending_torque] * fibers.bending_stiffness
    return stiffness / (16 * np.pi * fibers.viscosity * fibers.radius**3)


@arithmetic
def rod_factor(t, u):
    """2/(1 + cos θ) of the links t and u, finite at a fold."""
    return 2.0 / larger(1.0 + dot(t, u), FOLD)


@arithmetic
def sine_moment(t, u):
    """Moment between links t and u in units of K/2a, of the paper's law."""
    return cross(t, u)


@arithmetic
def rod_moment(t, u):
    """The same of a discrete rod."""
    return scale(rod_factor(t, u), cross(t, u))


@inlined
def moment(t, u, law):
    """Moment between links t and u in units of K/2a; law 0 is "sine", 1 is "discreteRod"."""
    if law == 1:
        return rod_moment(t, u)
    return sine_moment(t, u)
