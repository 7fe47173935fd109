"""Compiles every kernel of the package, so that no run has to: `python -m gbm_plugin.prepare`, at set-up."""

from __future__ import annotations

import itertools

import numpy as np

from .fiber import Fibers, instant_rates
from .fiber import prepare as prepare_fibers
from .fiber.model import MOBILITIES
from .fleet.own import prepare as prepare_own
from .flow import TaylorGreen, grid
from .spectral import LinearForcing, SpectralSolver
from .spectral.interpolation import WORDS


def prepare() -> None:
    """Small runs with every word."""
    for integrator, mobility in itertools.product(("ab3", "implicit"), MOBILITIES):
        prepare_fibers(True, integrator=integrator, mobility=mobility)
    prepare_fibers(mobility="rpy", strain_coupling=True, repulsion=1.0)
    prepare_own()
    fibers = Fibers.straight(1, 3, 1.0, 1.0, 1.0)
    for mobility in MOBILITIES:
        instant_rates(fibers, 0.0, 0.0, mobility)
    fibers.self_contacts.sum()
    TaylorGreen(1.0, 1.0).sample(np.zeros((1, 3)), 0.0)
    _prepare_grid()
    _prepare_spectral()


def _prepare_grid() -> None:
    field, points, spacing = np.zeros((3, 4, 4, 4)), np.zeros((1, 3)), np.ones(3)
    for word in grid.WORDS:
        grid.on_grid(word, field, points)
        grid.spread(word, np.zeros((1, 6)), points, (4, 4, 4))
    grid.rotation(field, spacing)
    grid.gradient(field, spacing)


def _prepare_spectral() -> None:
    for precision, scheme, word in itertools.product(("double", "single"), ("ab3", "rk4"), WORDS):
        options = {"scheme": scheme, "precision": precision, "interpolation": word}
        solver = SpectralSolver(4, 1.0, forcing=LinearForcing(coefficient=1.0), cfl=0.1, **options)
        solver.set_velocity(np.random.default_rng(1).standard_normal((3, 4, 4, 4)))
        solver.advance(4)
        solver.sample(np.zeros((1, 3)), solver.time, "gradient")
        solver.statistics()


if __name__ == "__main__":
    prepare()
