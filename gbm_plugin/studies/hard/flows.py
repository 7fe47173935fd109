"""Hard cases of the spectral flow: steps that are too long, eddies that are not resolved, nothing to force."""

from __future__ import annotations

import warnings

import numpy as np
from numpy.typing import NDArray

from ...spectral import EswaranPope, LinearForcing, SpectralSolver
from .case import Case, Found

CELLS = 16
BLOWS_UP = r"blows up in step \d+"


def eddies(cells: int = CELLS) -> NDArray:
    """Random waves of up to three in the box, of energy near 1."""
    random = np.random.default_rng(1)
    x = np.indices((cells,) * 3) * 2 * np.pi / cells
    u = np.zeros(x.shape)
    for k in ((1, 0, 1), (0, 2, 1), (2, 1, 0), (1, 1, 1), (0, 1, 3), (3, 0, 1)):
        phase = np.tensordot(k, x, axes=1) + random.uniform(0, 2 * np.pi)
        u += np.cross(k, random.standard_normal(3))[:, None, None, None] * np.cos(phase) / np.linalg.norm(k)
    return u / np.sqrt(0.5 * (u**2).sum(axis=0).mean())


def carried(courant: float, scheme: str = "ab3", forcing=None, viscosity: float = 1e-3) -> Found:
    """200 steps at a Courant number of the start."""
    probe = SpectralSolver(CELLS, viscosity, time_step=1.0)
    probe.set_velocity(eddies())
    step = courant * probe.box / CELLS / float(np.abs(probe.velocity).sum(axis=0).max())
    solver = SpectralSolver(CELLS, viscosity, time_step=step, scheme=scheme, forcing=forcing)
    solver.set_velocity(eddies())
    before = solver.energetics()["kinetic_energy"]
    with np.errstate(all="ignore"):
        solver.advance(200)
    after = solver.energetics()["kinetic_energy"]
    return {"finite": bool(np.isfinite(after)), "energy": after / before, "courant": courant}


def largest_courant(scheme: str) -> Found:
    """By bisection, of decaying eddies with little viscosity. off: the documented limit over it."""
    low, high = 0.2, 4.0
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", UserWarning)
        for _ in range(6):
            middle = 0.5 * (low + high)
            try:
                stable = carried(middle, scheme, viscosity=1e-5)["energy"] < 1.0
            except FloatingPointError:
                stable = False
            low, high = (middle, high) if stable else (low, middle)
    return {"largest_step": low, "off": {"ab3": 0.34, "rk4": 1.35}[scheme] / low}


def unresolved(cells: int = CELLS) -> Found:
    """k_max η = 0.5: energy piles up at the smallest scales, and stays. off: of the budget, over rounding."""
    power, highest = 1.0, cells / 3
    viscosity = ((0.5 / highest) ** 4 * power) ** (1 / 3)
    solver = SpectralSolver(cells, viscosity, cfl=0.3, forcing=LinearForcing(power=power))
    solver.set_velocity(eddies(cells))
    solver.advance(400)
    found, budget = solver.statistics(), solver.energy_budget()
    return {
        "finite": bool(np.isfinite(found["kinetic_energy"])),
        "kmax_eta": highest * found["kolmogorov_length"],
        "energy": found["kinetic_energy"],
        "off": abs(budget["transfer"]) / 1e-12,
    }


FORCES = {
    "constant power": lambda: LinearForcing(power=1.0),
    "constant coefficient": lambda: LinearForcing(coefficient=1.0),
    "eswaranPope": lambda: EswaranPope(variance=1.0, time_scale=0.1, cutoff=2, seed=1),
}


def forced(force: str, velocity: float) -> Found:
    """A fluid at rest or in uniform motion, whose mean must stay. off: its change, over rounding."""
    solver = SpectralSolver(CELLS, 0.01, time_step=0.01, forcing=FORCES[force]())
    solver.set_velocity(np.full((3, CELLS, CELLS, CELLS), velocity))
    solver.advance(50)
    energy, mean = solver.energetics()["kinetic_energy"], solver.coefficients[:, 0, 0, 0].real
    return {
        "finite": bool(np.isfinite(energy)),
        "energy": energy,
        "off": float(abs(mean - velocity).max() / 1e-12),
    }


def _cases() -> list[Case]:
    cases = [
        Case("spectral flow", "Courant number 0.25, ab3", lambda: carried(0.25)),
        Case("spectral flow", "Courant number 1, ab3, forced",
             lambda: carried(1.0, forcing=LinearForcing(power=1.0)), BLOWS_UP),
        Case("spectral flow", "Courant number 50, ab3", lambda: carried(50.0), BLOWS_UP),
        Case("spectral flow", "Courant number 0.9, rk4", lambda: carried(0.9, "rk4")),
        Case("spectral flow", "Courant number 3, rk4", lambda: carried(3.0, "rk4"),
             note="rk4 damps it within its limits: a warning says so"),
        Case("spectral flow", "Courant number 50, rk4", lambda: carried(50.0, "rk4"), BLOWS_UP),
        Case("spectral flow", "largest Courant number, ab3", lambda: largest_courant("ab3"), slow=True),
        Case("spectral flow", "largest Courant number, rk4", lambda: largest_courant("rk4"), slow=True),
        Case("spectral flow", "k_max η = 0.5", unresolved,
             note="energy stays bounded, gradients are wrong: gbm info says Δx/η"),
    ]  # fmt: skip
    for force in FORCES:
        for velocity, state in ((0.0, "at rest"), (1.0, "in uniform motion")):
            cases.append(Case(
                "forcing", f"{force}, fluid {state}, spectral", lambda f=force, v=velocity: forced(f, v),
                "needs a fluid that moves" if force == "constant power" else None,
                "stirs it" if force == "eswaranPope" else "",
            ))  # fmt: skip
    return cases


CASES = _cases()
