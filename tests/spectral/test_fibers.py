"""Fibers in the solver's flow, which is known at its own steps only and cannot go back."""

import numpy as np
import pytest

from gbm_plugin import Fibers, simulate
from gbm_plugin.flow import ABC
from gbm_plugin.spectral import SpectralSolver

from .fields import nodes


def steady(amplitude, time_step):
    """An ABC flow, which without viscosity stays as it is, in closed form and in a solver."""
    flow = ABC(amplitude, 0.8 * amplitude, 0.6 * amplitude)
    solver = SpectralSolver(8, 0.0, time_step=time_step, interpolation="exact")
    solver.set_velocity(np.moveaxis(flow.sample(np.moveaxis(nodes(8), 0, -1), 0, "velocity")[0], -1, 0))
    return flow, solver


@pytest.mark.parametrize("integrator", ["ab3", "implicit", "auto"])
def test_two_families_from_a_solvers_present_time(integrator):
    flow, solver = steady(1.0, 0.02)
    solver.advance(10)
    families = [Fibers.straight(4, n, 1.0, 1e-3, 1.0, box=6.28, seed=n) for n in (5, 8)]
    options = {"integrator": integrator, "start_time": 0.2}
    runs = simulate(families, solver, 0.1, 1.0, **options, record_every=4)
    for family, run in zip(families, runs, strict=True):
        assert run.times == pytest.approx([0.2, 0.6, 1.0])
        exact = simulate(family, flow, 0.02, 1.0, tolerance=1e-6, start_time=0.2).positions[-1]
        assert np.abs(run.positions[-1] - exact).max() < 1e-3
    assert solver.time == pytest.approx(1.0)


def test_steps_that_are_too_long_for_the_tolerance_raise():
    _, solver = steady(20.0, 0.05)
    fibers = Fibers.straight(4, 5, 1.0, 1e-3, 1.0, box=6.28)
    with pytest.raises(
        ValueError, match=r"known every 0\.05, changes too fast along the fibers at time 0\.\d+"
    ):
        simulate(fibers, solver, 0.05, 1.0)
