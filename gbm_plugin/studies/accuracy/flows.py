"""The two flows that carry the fibers of the study, in units of their own: τ = (ν/ε)^(1/2)."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...fiber import Fibers
from ...flow import StoredFlow, TaylorGreen
from ...spectral import LinearForcing, SpectralSolver

BOX = 2 * np.pi
DENSITY = 1.0


@dataclass(frozen=True)
class Carrier:
    """A flow that can be sampled, the length of fibers worth moving in it [m], and its viscosity ν [m2/s] and
    Kolmogorov time τ [s]; it is known from time 0 to `end` [τ]."""

    name: str
    flow: Any
    length: float
    viscosity: float
    kolmogorov_time: float
    end: float

    def fibers(self, persistence: float, beads: int, count: int, seed: int = 1) -> Fibers:
        """Straight fibers of a persistence length l_p = (Kτ/μ)^(1/4) (eq. 15) given over their own."""
        stiffness = self.stiffness(persistence)
        return Fibers.straight(
            count, beads, self.length, stiffness, DENSITY * self.viscosity, box=BOX, seed=seed
        )

    def stiffness(self, persistence: float) -> float:
        """K^b [N m2] of l_p over the length."""
        return DENSITY * self.viscosity * (persistence * self.length) ** 4 / self.kolmogorov_time


def cellular() -> Carrier:
    """Eq. (12), cells as wide as fibers are long; steady, ε/ν = (πU₀/W)² on average."""
    return Carrier("Taylor-Green", TaylorGreen(np.pi, 1.0), np.pi, 0.01, 1.0, np.inf)


@cache
def turbulent(cells: int = 40, last: float = 5.0, every: float = 0.1) -> Carrier:
    """A recorded history of the default case's turbulence (ν = 0.01, P = 0.05 in a box of 2π), at Re_λ = 24 on 40³
    nodes, of `last` Kolmogorov times from when it is developed, a field every so many; quintic in space."""
    solver = SpectralSolver(cells, 0.01, BOX, LinearForcing(power=0.05), time_step=0.015)
    solver.set_velocity(large_scales(cells))
    solver.advance(400)
    tau = float(solver.statistics()["kolmogorov_time"])
    steps = max(1, round(every * tau / solver.time_step))
    fields = [solver.velocity]
    while (len(fields) - 1) * steps * solver.time_step < last * tau:
        solver.advance(steps)
        fields.append(solver.velocity)
    times = np.arange(len(fields)) * steps * solver.time_step
    flow = StoredFlow(times, fields.__getitem__, 3 * (BOX,), offset=0.0, interpolation="quintic")
    return Carrier("turbulence", flow, 2.0, 0.01, tau, last)


def large_scales(cells: int, waves: int = 2, seed: int = 1, energy: float = 0.2) -> NDArray:
    """(3, n, n, n) at the nodes: random solenoidal waves |m_i| <= waves of a kinetic energy [m2/s2]."""
    random = np.random.default_rng(seed)
    x = np.indices((cells,) * 3) * (BOX / cells)
    u = np.zeros(x.shape)
    for _ in range(12):
        m, amplitude = random.integers(-waves, waves + 1, 3), random.standard_normal(3)
        across = amplitude - m * (amplitude @ m) / max(m @ m, 1)
        u += across[:, None, None, None] * np.cos(np.tensordot(m, x, 1) + 2 * np.pi * random.random())
    return u * np.sqrt(2 * energy / (u**2).sum(axis=0).mean())
