"""What fibers do to the fluid: against a dense solution, sums that must vanish, and the balance of energy."""

import numpy as np
import pytest

from gbm_plugin.fiber import Fibers, Group, Stepper

from fiber_cases import WavyFlow, bent, crooked, dense_solution, run_once_per_step, straight_chain

WORDS = [
    (i, m, law) for i in ("ab3", "implicit") for m in ("freeDrain", "rpy") for law in ("sine", "discreteRod")
]


def observed(fibers, velocity, rotation, **words):
    stepper = Stepper(fibers, 0.0, **words)
    shape = (fibers.count, fibers.beads, 3)
    stepper.observe(0.0, np.broadcast_to(velocity, shape), np.broadcast_to(rotation, shape))
    return stepper


@pytest.mark.parametrize("mobility", ["freeDrain", "rpy"])
@pytest.mark.parametrize("law", ["sine", "discreteRod"])
def test_forces_and_torques_are_those_of_the_dense_solution(mobility, law):
    """In free drain 6πμa (v − u) and 8πμa³ (ω − Ω) of its motion; with rpy the differences of its contact forces."""
    fibers = Fibers(crooked(10, 7, 0.2), np.linspace(0.1, 1, 10), 0.7, curvature_law=law)
    velocity, rotation = np.random.default_rng(1).standard_normal((2, 10, 7, 3))
    found = observed(fibers, velocity, rotation, integrator="ab3", mobility=mobility).reaction(0.1)
    a = fibers.radius
    for f in range(10):
        v, spin, contacts = dense_solution(fibers, f, velocity[f], rotation[f], mobility)
        expected = np.diff(np.pad(contacts, ((1, 1), (0, 0))), axis=0)
        size = np.abs(expected).max()
        assert np.abs(found.force[f] - expected).max() < 1e-10 * size
        if mobility == "freeDrain":
            assert np.abs(found.force[f] - 6 * np.pi * 0.7 * a * (v - velocity[f])).max() < 1e-10 * size
            torque = 8 * np.pi * 0.7 * a**3 * (spin - rotation[f])
            assert np.abs(found.torque[f] - torque).max() < 1e-10 * a * size


@pytest.mark.parametrize(("integrator", "mobility", "law"), WORDS)
@pytest.mark.parametrize("stiffness", [0.3, 1e9])
def test_momentum_and_energy_balance(integrator, mobility, law, stiffness):
    """No force and no moment of a whole fiber; Σ F·u + T·Ω = −Φ − dE_b/dt."""
    fibers = Fibers(bent(10, 9, 0.1), stiffness, 0.7, curvature_law=law)
    velocity, rotation = np.random.default_rng(2).standard_normal((2, 10, 9, 3))
    stepper = observed(fibers, velocity, rotation, integrator=integrator, mobility=mobility)
    r = stepper.reaction(0.1)
    assert np.abs(r.force.sum(axis=1)).max() < 1e-13 * np.abs(r.force).max()
    moment = r.torque + np.cross(stepper.positions, r.force)
    size = max(np.abs(r.force).max(), np.abs(r.torque).max())
    assert np.abs(moment.sum(axis=1)).max() < 1e-13 * size
    assert r.friction > 0
    left = r.exchange(velocity, rotation) + r.friction + r.bending
    assert abs(left) < 1e-12 * max(r.friction, abs(r.bending))


@pytest.mark.parametrize("mobility", ["freeDrain", "rpy"])
@pytest.mark.parametrize("torque", ["consistent", "asPrinted"])
def test_bending_power_is_the_rate_of_the_bending_energy(mobility, torque):
    """Of a shape that is moved a little each way; eq. (6) as printed is that of twice the stiffness."""
    still, h = np.zeros(3), 1e-7
    fibers = Fibers(bent(3, 9, 0.1), 0.4, 0.7, bending_torque=torque)
    energy = []
    for step in (h, 2 * h):
        moved = run_once_per_step(fibers, Still(), step, 1, integrator="ab3", mobility=mobility)
        energy.append(Fibers(moved.positions, 0.4, 0.7).bending_energy.sum())
    start = fibers.bending_energy.sum()
    rate = (4 * energy[0] - energy[1] - 3 * start) / (2 * h)
    found = observed(fibers, still, still, integrator="ab3", mobility=mobility).reaction(h).bending
    assert found == pytest.approx(rate * (2 if torque == "asPrinted" else 1), rel=1e-4)


class Still:
    def sample(self, x, t, need):
        return np.zeros_like(x), np.zeros_like(x)


@pytest.mark.parametrize("integrator", ["ab3", "implicit"])
def test_what_is_carried_passively_exerts_nothing(integrator):
    fibers = Fibers(crooked(9, 12, 0.1), 0.0, 1.0)
    found = observed(fibers, [0.3, -0.7, 1.1], 0.0, integrator=integrator).reaction(0.1)
    assert np.abs(found.force).max() < 1e-14 and np.abs(found.torque).max() < 1e-15


@pytest.mark.parametrize("integrator", ["ab3", "implicit"])
@pytest.mark.parametrize("beads", [2, 20])
def test_a_stiff_rod_in_extension_exerts_the_discrete_sum(integrator, beads):
    """F_i = −6πμa S s_i along itself: its own beads hold it still, and the fluid passes by."""
    fibers = Fibers(straight_chain(beads, 0.1), 1.0, 0.3)
    flow = fibers.positions * [2.0, -1.0, -1.0]
    found = observed(fibers, flow, 0.0, integrator=integrator).reaction(0.1)
    np.testing.assert_allclose(found.force, -6 * np.pi * 0.3 * fibers.radius * flow, atol=1e-13)
    assert np.abs(found.torque).max() < 1e-15


def test_implicit_forces_are_those_of_the_shape_to_second_order():
    """Two implicit stages know where a shape goes within the step, which changes what it exerts as h²."""
    fibers = Fibers(bent(3, 9, 0.1), 0.01, 1.0)
    velocity, rotation = np.random.default_rng(4).standard_normal((2, 3, 9, 3))
    now = observed(fibers, velocity, rotation, integrator="ab3").reaction(1.0).force
    ahead = observed(fibers, velocity, rotation, integrator="implicit")
    errors = [np.abs(ahead.reaction(h).force - now).max() / np.abs(now).max() for h in (4e-4, 2e-4, 1e-4)]
    assert errors[-1] < 1e-3
    np.testing.assert_allclose(np.log2(np.divide(errors[:-1], errors[1:])), 2.0, atol=0.2)


@pytest.mark.parametrize("mobility", ["freeDrain", "rpy"])
def test_stiff_fibers_exert_the_force_of_rods(mobility):
    """After implicit steps a shape has stiff modes in it that would exert anything; what is sent does not see them."""
    straight = Fibers(bent(4, 12, 1 / 12, 0.0), 1.0, 1.0).positions
    forces = []
    for stiffness in (1e3, 1e8):
        fibers = Fibers(straight, stiffness, 1.0)
        moved = run_once_per_step(
            fibers, WavyFlow(), 0.02, 20, integrator="implicit", mobility=mobility, tolerance=1e-5
        )
        forces.append(moved.reaction(0.02).force)
    assert np.abs(forces[1] - forces[0]).max() < 2e-3 * np.abs(forces[0]).max()


def test_families_exert_theirs_one_after_the_other():
    fibers = [Fibers(bent(3, 5, 0.1), 1.0, 1.0), Fibers(bent(2, 8, 0.2), 0.1, 1.0)]
    group = Group(
        [Stepper(own, 0.0, integrator=i) for own, i in zip(fibers, ("ab3", "implicit"), strict=True)]
    )
    velocity, rotation = np.random.default_rng(3).standard_normal((2, group.beads, 3))
    group.observe(0.0, velocity, rotation)
    whole, parts = group.reaction(0.1), [s.reaction(0.1) for s in group.steppers]
    for own, part in zip(group.split(whole.force), parts, strict=True):
        np.testing.assert_array_equal(own, part.force)
    assert whole.friction == pytest.approx(parts[0].friction + parts[1].friction, rel=1e-15)


def test_repulsion_acts_on_the_fluid():
    """Beads that are pushed apart push the fluid: 6πμa times their velocity, with no sum."""
    fibers = Fibers(crooked(20, 12, 0.1), 0.0, 1.0)
    still = np.zeros((20, 12, 3))
    pushed = observed(fibers, still, still, integrator="ab3", repulsion=1.0)
    assert fibers.self_contacts.sum() > 0
    force = pushed.reaction(0.1).force
    assert np.abs(force).max() > 0
    assert np.abs(force.sum(axis=1)).max() < 1e-14
