"""Fibers in simple flows, against exact motions."""

import numpy as np
import pytest

from gbm_plugin import Fibers, simulate
from gbm_plugin.flow import ABC, LinearFlow

from fiber_cases import WavyFlow, bent, crooked, positions_of, run_once_per_step, straight_chain

SHEAR = LinearFlow([[0, 1, 0], [0, 0, 0], [0, 0, 0]])
METHODS = [("ab3", "freeDrain"), ("implicit", "freeDrain"), ("ab3", "rpy"), ("implicit", "rpy")]


def aspect_ratio(beads, mobility="freeDrain", strain_coupling=False):
    """r_e of Jeffery's period 2π(r_e + 1/r_e)/S of a nearly rigid chain, from half a turn in shear."""
    fibers = Fibers(straight_chain(beads, 0.1, (0, 1, 0)), 1e6 * 1e-4, 1.0)
    end = 1.1 * np.pi * beads / (1.35 if mobility == "freeDrain" else 1.25)
    trajectory = simulate(
        fibers, SHEAR, 0.2, end, mobility=mobility, strain_coupling=strain_coupling,
        tolerance=1e-4 if mobility == "freeDrain" else 1e-3, record_every=1,
    )  # fmt: skip
    ends = trajectory.positions[:, 0, -1] - trajectory.positions[:, 0, 0]
    angle = np.unwrap(np.arctan2(ends[:, 0], ends[:, 1]))
    half = np.interp(np.pi, angle, trajectory.times)
    return (half + np.sqrt(half**2 - 4 * np.pi**2)) / (2 * np.pi)


@pytest.mark.parametrize("beads", [9, 10, 20])
def test_jeffery_period_in_free_drain(beads):
    exact = np.sqrt((beads**2 + 1) / 2) if beads % 2 == 0 else np.sqrt(1 + beads**2 / 2)
    assert aspect_ratio(beads) == pytest.approx(exact, rel=1e-3)


@pytest.mark.parametrize(("strain", "ratio"), [(False, 14.705), (True, 15.370)])
def test_jeffery_period_with_hydrodynamic_interactions(strain, ratio):
    assert aspect_ratio(20, "rpy", strain) == pytest.approx(ratio, rel=5e-3)


@pytest.mark.parametrize(("integrator", "mobility"), METHODS)
def test_uniform_flow_carries_any_shape(integrator, mobility):
    fibers = Fibers(crooked(3, 8, 0.1), 0.0, 1.0)
    flow = LinearFlow(np.zeros((3, 3)), (0.3, -0.2, 0.5))
    last = simulate(fibers, flow, 0.1, 2.0, integrator, mobility).positions[-1]
    assert np.abs(last - fibers.positions - [0.6, -0.4, 1.0]).max() < 1e-13


def solid_rotation(rate):
    """Flow that turns about an oblique axis, and the matrix of its rotation in time t."""
    axis = np.array([1.0, 2.0, -2.0]) / 3
    spin = np.array([[0, -axis[2], axis[1]], [axis[2], 0, -axis[0]], [-axis[1], axis[0], 0]])

    def turn(t):
        return np.eye(3) + np.sin(rate * t) * spin + (1 - np.cos(rate * t)) * spin @ spin

    return LinearFlow(rate * spin), turn


@pytest.mark.parametrize(("integrator", "mobility"), METHODS)
def test_limp_chains_keep_their_shape_in_solid_rotation(integrator, mobility):
    flow, turn = solid_rotation(0.7)
    fibers = Fibers(crooked(3, 8, 0.1), 0.0, 1.0)
    last = simulate(fibers, flow, 0.01, 2.0, integrator, mobility, tolerance=1e-5).positions[-1]
    assert np.abs(last - fibers.positions @ turn(2.0).T).max() < 2e-5 * fibers.contour_length


@pytest.mark.parametrize(("integrator", "mobility"), METHODS)
def test_elastic_fiber_in_solid_rotation_is_the_resting_one_seen_turning(integrator, mobility):
    flow, turn = solid_rotation(0.7)
    fibers = Fibers(bent(3, 8, 0.1), 0.005, 1.0)
    options = {"integrator": integrator, "mobility": mobility, "tolerance": 1e-5}
    turning = simulate(fibers, flow, 0.01, 2.0, **options).positions[-1]
    resting = simulate(fibers, LinearFlow(np.zeros((3, 3))), 0.01, 2.0, **options).positions[-1]
    assert np.abs(resting - fibers.positions).max() > 0.03  # it did relax
    assert np.abs(turning - resting @ turn(2.0).T).max() < 3e-5 * fibers.contour_length


class Turned:
    """A flow seen from a frame turned by Q."""

    def __init__(self, flow, matrix):
        self.flow, self.matrix = flow, matrix

    def sample(self, positions, time, need):
        velocity, rotation = self.flow.sample(positions @ self.matrix, time, need)
        return velocity @ self.matrix.T, rotation @ self.matrix.T


@pytest.mark.parametrize(("integrator", "mobility"), METHODS)
def test_results_turn_with_the_frame_and_do_not_depend_on_bead_order(integrator, mobility):
    _, turn = solid_rotation(1.0)
    matrix = turn(1.1)
    positions = bent(3, 9, 0.1)
    options = {"step": 0.05, "steps": 20, "integrator": integrator, "mobility": mobility}
    plain = run_once_per_step(Fibers(positions, 0.002, 1.0), WavyFlow(), **options).positions
    turned = run_once_per_step(
        Fibers(positions @ matrix.T, 0.002, 1.0), Turned(WavyFlow(), matrix), **options
    )
    back = run_once_per_step(Fibers(positions[:, ::-1], 0.002, 1.0), WavyFlow(), **options)
    assert np.abs(turned.positions - plain @ matrix.T).max() < 1e-10
    assert np.abs(back.positions[:, ::-1] - plain).max() < 1e-10


def test_a_fiber_does_not_depend_on_its_batch():
    positions = bent(19, 9, 0.1)
    options = {"step": 0.1, "steps": 10, "integrator": "implicit", "tolerance": 1e-5}
    together = run_once_per_step(Fibers(positions, 0.002, 1.0), WavyFlow(), **options).positions
    for one in (0, 7, 8, 18):
        alone = run_once_per_step(Fibers(positions[one : one + 1], 0.002, 1.0), WavyFlow(), **options)
        # the radius of a family is the mean of its spacings: equal to rounding
        assert np.abs(alone.positions[0] - together[one]).max() < 1e-12


class Counted:
    """A flow, and how often it was sampled."""

    def __init__(self, flow):
        self.flow, self.times = flow, []

    def sample(self, positions, time, need):
        self.times.append(time)
        return self.flow.sample(positions, time, need)


def test_families_ride_in_one_flow():
    """Sampled once for all; with ab3, whose steps do not depend on each other, as each would alone."""
    families = [Fibers(bent(2, beads, 0.1), 1e-3, 1.0) for beads in (5, 9)]
    flow = Counted(WavyFlow())
    both = simulate(families, flow, 0.1, 0.5, "ab3", record_every=2)
    assert flow.times == pytest.approx([0, 0.1, 0.1, 0.2, 0.2, 0.3, 0.4, 0.5])  # the first two steps twice
    for family, trajectory in zip(families, both, strict=True):
        alone = simulate(family, WavyFlow(), 0.1, 0.5, "ab3", record_every=2)
        assert (alone.positions == trajectory.positions).all()
        assert trajectory.times == pytest.approx([0, 0.2, 0.4, 0.5])
        assert trajectory.positions.shape == (4, 2, family.beads, 3)
        assert trajectory.positions[0] == pytest.approx(family.positions, abs=1e-15)
    for family, trajectory in zip(families, simulate(families, WavyFlow(), 0.1, 0.5), strict=True):
        alone = simulate(family, WavyFlow(), 0.1, 0.5)
        assert np.abs(alone.positions - trajectory.positions).max() < 1e-3 * family.contour_length


def test_a_run_may_start_at_any_time():
    """Halves that follow each other make the whole, within the tolerance."""
    fibers = Fibers(bent(2, 6, 0.1), 1e-3, 1.0)
    whole = simulate(fibers, WavyFlow(), 0.1, 2.0, tolerance=1e-6)
    half = simulate(fibers, WavyFlow(), 0.1, 1.0, tolerance=1e-6)
    rest = Fibers(half.positions[-1], 1e-3, 1.0)
    rest = simulate(rest, WavyFlow(), 0.1, 2.0, tolerance=1e-6, start_time=1.0)
    assert rest.times[0] == 1.0 and rest.times[-1] == 2.0
    assert np.abs(rest.positions[-1] - whole.positions[-1]).max() < 1e-5 * fibers.contour_length


@pytest.fixture(scope="module")
def fast():
    """Fibers that a flow carries over three times the box until t = 2, the flow, and where they are then."""
    fibers = Fibers.straight(20, 16, 1.5, 1e-2, 0.02, box=6.28, seed=3)
    return fibers, ABC(5, 4, 3), simulate(fibers, ABC(5, 4, 3), 0.05, 2.0, tolerance=1e-7).positions[-1]


@pytest.mark.parametrize(("step", "tolerance"), [(0.5, 1e-5), (2.0, 1e-6), (2.0, 1e-3)])
def test_long_steps_keep_the_tolerance(fast, step, tolerance):
    """Steps in which the extrapolation of the flow fails are redone."""
    fibers, flow, exact = fast
    run = simulate(fibers, flow, step, 2.0, tolerance=tolerance)
    error = np.sqrt(((run.positions[-1] - exact) ** 2).sum(axis=2).mean(axis=1)) / fibers.contour_length
    # chaos: what a step adds grows by e^(λt), λ about 1 there
    assert error.max() < 100 * tolerance
    assert run.report["redone"] > 0
    assert run.report["worst_flow_error"] <= 0.1 * tolerance


def test_length_is_exact_after_many_steps():
    fibers = Fibers(bent(8, 6, 0.1), 1e-4, 1.0)
    stepper = run_once_per_step(fibers, WavyFlow(), 0.05, 10_000, integrator="ab3")
    links = np.diff(stepper.positions - stepper.positions.mean(axis=1, keepdims=True), axis=1)
    state = stepper.state()["links_and_centres"].reshape(-1, 6, 3)[:, :5]
    assert np.abs(np.sqrt((state**2).sum(axis=2)) - 1).max() < 1e-13
    assert np.abs(np.linalg.norm(links, axis=2) / (2 * fibers.radius) - 1).max() < 1e-13


def test_repulsion_parts_overlapping_beads():
    angle = np.linspace(0, 1.9 * np.pi, 11)
    links = np.stack([np.cos(angle), np.sin(angle), 0 * angle], axis=1)[None]
    links = np.concatenate([links, links[:, :4] + [0, 0, 0.01]], axis=1)
    fibers = Fibers(positions_of(links, 0.1), 0.0, 1.0)
    assert fibers.self_contacts[0] > 0
    still = LinearFlow(np.zeros((3, 3)))
    kept = simulate(fibers, still, 0.05, 10.0).positions[-1]
    parted = simulate(fibers, still, 0.05, 10.0, repulsion=2.0).positions[-1]
    assert Fibers(kept, 0.0, 1.0).self_contacts[0] == fibers.self_contacts[0]

    def overlap(x):
        i, j = np.triu_indices(len(x), 2)
        return np.maximum(0.1 - np.linalg.norm(x[i] - x[j], axis=1), 0).max()

    assert overlap(parted[0]) < 0.05 * overlap(fibers.positions[0])
