"""Orders of convergence, energy, and what the tolerance promises."""

import numpy as np
import pytest

from gbm_plugin import Fibers, simulate
from gbm_plugin.fiber import Stepper
from gbm_plugin.flow import LinearFlow, TaylorGreen

from fiber_cases import WavyFlow, bent, crooked, positions_of, run_once_per_step, straight_chain

STILL = LinearFlow(np.zeros((3, 3)))


@pytest.mark.parametrize("mobility", ["freeDrain", "rpy"])
@pytest.mark.parametrize(("integrator", "order"), [("ab3", 3), ("implicit", 2)])
def test_order_with_one_flow_sample_per_step(integrator, order, mobility):
    fibers = Fibers(bent(3, 6, 0.2), 0.01, 1.0)
    end, steps = 1.0, [40, 80, 160, 320]
    tight = run_once_per_step(
        fibers, WavyFlow(), end / 4000, 4000, integrator="ab3", mobility=mobility
    ).positions
    errors = []
    for count in steps:
        last = run_once_per_step(
            fibers, WavyFlow(), end / count, count, integrator=integrator, mobility=mobility, tolerance=1e9
        ).positions
        errors.append(np.abs(last - tight).max())
    orders = np.log2(np.array(errors[:-1]) / errors[1:])
    assert orders[-1] == pytest.approx(order, abs=0.25), orders
    assert (orders > order - 0.25).all(), orders


def test_implicit_at_a_tenth_of_the_vortex_time():
    """Stiff fibers (200 and 20000 × eq. 10) in Taylor–Green flow: below 1e-3 L after one vortex time."""
    width, speed, beads = np.pi, 1.0, 12
    length, step = 0.4 * width, 0.1 * width / speed
    flow = TaylorGreen(width, speed)
    for multiple in (200, 20_000):
        stiffness = multiple * (length / beads) ** 4 / step
        fibers = Fibers.straight(24, beads, length, stiffness, 1.0, box=2 * width, seed=3)
        last = simulate(fibers, flow, step, width / speed).positions[-1]
        # ab3 at half of eq. (10); for the stiffest, implicit steps of that size
        fine = {"integrator": "ab3"} if multiple == 200 else {"integrator": "implicit", "tolerance": 1e-4}
        tight = run_once_per_step(fibers, flow, step / 400, 4000, **fine).positions
        error = np.linalg.norm(last - tight, axis=2).max() / length
        assert error < 1e-3


def shapes(beads, diameter):
    """Smoothly bent, kinked in 3D, and one hairpin."""
    turn = np.linspace(0, np.pi, beads - 1)
    hairpin = np.stack([np.cos(turn), np.sin(turn), 0.01 * turn], axis=1)[None]
    parts = [bent(3, beads, diameter), crooked(3, beads, diameter), positions_of(hairpin, diameter)]
    return np.concatenate(parts)


@pytest.mark.parametrize("law", ["sine", "discreteRod"])
@pytest.mark.parametrize("mobility", ["freeDrain", "rpy"])
@pytest.mark.parametrize("multiple", [1, 100, 1e4, 1e6])
def test_energy_never_grows_and_the_shape_is_right(law, mobility, multiple):
    beads, stiffness, viscosity = (16 if mobility == "freeDrain" else 8), 1e-3, 1e-3
    diameter = 2.0 / beads
    limit = viscosity * diameter**4 / stiffness
    options = {"curvature_law": law}
    fibers = Fibers(shapes(beads, diameter), stiffness, viscosity, **options)
    step = multiple * limit
    run = simulate(fibers, STILL, step, 8 * step, mobility=mobility, record_every=1)
    energy = [fibers.bending_energy]
    energy += [Fibers(x, stiffness, viscosity, **options).bending_energy for x in run.positions]
    growth = np.diff(energy, axis=0) / energy[0]
    assert growth.max() < 1e-12
    if multiple > 1:
        assert (energy[-1] < 0.9 * energy[0]).all()  # nothing is frozen
    fine = simulate(fibers, STILL, step, 8 * step, mobility=mobility, tolerance=1e-6).positions[-1]
    # rms over the beads; the sharpest kinks of a random walk amplify errors of their unstable start
    error = np.sqrt(((run.positions[-1] - fine) ** 2).sum(axis=2).mean(axis=1)) / fibers.contour_length
    assert error.max() < 1e-3  # the default tolerance


def test_only_the_fibers_that_need_it_are_refined():
    straight, kinked = bent(15, 10, 0.1, bend=0.0), crooked(1, 10, 0.1)
    run = run_once_per_step(
        Fibers(np.concatenate([straight, kinked]), 1e-3, 1e-3), STILL, 1e-2, 3, integrator="implicit"
    )
    # the kinked fiber, in the three steps and the two corrections of the start
    assert 1 <= run.report()["refined_fibers"] <= 5
    assert run.report()["refinements"] > 5


def test_tolerance_is_kept_in_a_flow():
    fibers = Fibers(bent(8, 10, 0.1), 1e-3, 1e-2)
    tight = simulate(fibers, WavyFlow(), 0.001, 2.0, integrator="ab3").positions[-1]
    errors = []
    for tolerance in (1e-2, 1e-3, 1e-4):
        last = simulate(fibers, WavyFlow(), 0.2, 2.0, tolerance=tolerance).positions[-1]
        errors.append(np.linalg.norm(last - tight, axis=2).max() / fibers.contour_length)
    assert errors[0] > errors[1] > errors[2]
    assert errors[2] < 1e-3


def test_auto_takes_ab3_where_it_may_and_agrees():
    fibers = Fibers(bent(5, 8, 0.1), 1e-4, 1.0)  # eq. (10) allows a step of 1
    tight = run_once_per_step(fibers, WavyFlow(), 0.001, 1000).positions
    for step in (0.01, 0.1):
        run = run_once_per_step(fibers, WavyFlow(), step, round(1 / step), integrator="auto")
        assert np.abs(run.positions - tight).max() < 0.02 * fibers.contour_length * (step / 0.1) ** 2 + 1e-4
    assert run.report()["ab3_steps"] > 0
    stiff = Fibers(bent(5, 8, 0.1), 1.0, 1.0)
    run = run_once_per_step(stiff, WavyFlow(), 0.1, 10, integrator="auto")
    assert run.report()["ab3_steps"] == 0


@pytest.mark.parametrize("mobility", ["freeDrain", "rpy"])
def test_auto_returns_to_ab3_when_the_tension_is_over(mobility):
    """Slender-body theory: a rate γ pulls a chain of N beads with γdN²/8 over 6πμa, for which ab3 needs many steps."""
    beads, diameter, step = 20, 0.1, 0.1
    fibers = Fibers(straight_chain(beads, diameter), 1e-6, 1.0)
    stepper = Stepper(fibers, integrator="auto", mobility=mobility)

    def steps(rate, count):
        """So many steps of extension at this rate; those of ab3 among them."""
        flow = LinearFlow(rate * np.diag([1.0, -0.5, -0.5]))
        before = stepper.report()["ab3_steps"]
        stepper.observe(stepper.time, *flow.sample(stepper.positions, stepper.time, "rotation"))
        for _ in range(count):
            stepper.advance(step)
            stepper.observe(stepper.time, *flow.sample(stepper.positions, stepper.time, "rotation"))
        return stepper.report()["ab3_steps"] - before

    assert steps(10.0, 6) <= 1  # the first knows of no tension yet
    assert steps(1e-3, 6) == 3  # those whose three samples are all of the weak flow
