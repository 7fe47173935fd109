"""The model at one instant: against a dense solution, and against theory."""

import numpy as np
import pytest

from gbm_plugin.fiber import Fibers, Stepper, instant_rates

from fiber_cases import bent, crooked, dense_solution, positions_of, straight_chain

BETA = np.array([4.730040745, 7.853204624, 10.995607838])  # free-free beam


@pytest.mark.parametrize("mobility", ["freeDrain", "rpy"])
@pytest.mark.parametrize("law", ["sine", "discreteRod"])
@pytest.mark.parametrize("torque", ["consistent", "asPrinted"])
@pytest.mark.parametrize("beads", [2, 3, 4, 9])
def test_rates_equal_the_dense_solution(mobility, law, torque, beads):
    random = np.random.default_rng(beads)
    # crooked chains: some beads overlap
    fibers = Fibers(crooked(5, beads, 0.2, beads), random.random(5), 0.7, torque, law)
    velocity, rotation = random.standard_normal((2, 5, beads, 3))
    turn, drift, forces = instant_rates(fibers, velocity, rotation, mobility)
    for f in range(5):
        v, _, expected = dense_solution(fibers, f, velocity[f], rotation[f], mobility)
        rate = np.cross(fibers.links[f], np.diff(v, axis=0)) / (2 * fibers.radius)
        size = np.abs(rate).max()
        assert np.abs(turn[f] - rate).max() < 1e-11 * size
        assert np.abs(drift[f] - v.mean(axis=0)).max() < 1e-12 * np.abs(v).max()
        assert np.abs(forces[f] - expected).max() < 1e-10 * np.abs(expected).max()


def growth_matrix(beads, stiffness=1.0, gradient=None, **options):
    """Linear response of link slopes in the plane x, y of a straight chain of length 1, μ = 1."""
    links, slope = beads - 1, 1e-6
    directions = np.zeros((links, links, 3))
    directions[..., 0] = 1
    directions[np.arange(links), np.arange(links), 1] = slope
    fibers = Fibers(positions_of(directions, 1 / beads), stiffness, 1.0, **options)
    velocity = np.zeros((links, beads, 3)) if gradient is None else fibers.positions @ gradient.T
    turn, _, _ = instant_rates(fibers, velocity, np.zeros_like(velocity))
    return np.cross(turn, fibers.links)[..., 1].T / slope


def rates_of(matrix):
    """Real growth rates, fastest growing first."""
    return np.sort(np.linalg.eigvals(matrix).real)[::-1]


def test_bending_modes_relax_as_a_free_beam_and_converge_at_second_order():
    expected = {20: [0.963, 0.909, 0.798], 40: [0.990, 0.976, 0.957], 80: [0.998, 0.994, 0.989]}
    theory = BETA**4 / (3 * np.pi)
    ratio = {beads: -rates_of(growth_matrix(beads))[1:4] / theory for beads in expected}
    for beads, values in expected.items():
        np.testing.assert_allclose(ratio[beads], values, rtol=0.005)
    order = np.log2((1 - ratio[40]) / (1 - ratio[80]))
    assert (order > 1.9).all() and (order < 2.1).all()


def test_torque_as_printed_is_exactly_twice_as_stiff():
    consistent, printed = growth_matrix(20), growth_matrix(20, bending_torque="asPrinted")
    np.testing.assert_allclose(printed, 2 * consistent, atol=1e-9 * np.abs(consistent).max())


def test_explicit_limit_of_the_operator():
    # λ_max μ d⁴/K = 0.206 at N = 80
    assert -rates_of(growth_matrix(80))[-1] / 80**4 == pytest.approx(0.206, rel=0.005)


@pytest.mark.parametrize(("threshold", "mode"), [(13.14, 1), (53.88, 0)])
def test_compression_buckles_at_the_thresholds_of_the_chain(threshold, mode):
    """The growth rate of one more bending mode changes sign there; rotation grows at S anyway."""
    gradient = np.diag([-1.0, 1.0, 0.0])

    def slowest(number):
        # the mode nearest to its threshold
        rates = rates_of(growth_matrix(20, 1 / number, gradient))
        return rates[1] if mode == 1 else rates[2]

    low, high = 0.995 * threshold, 1.005 * threshold
    assert slowest(low) < 0 < slowest(high)


@pytest.mark.parametrize("beads", [2, 7, 20])
@pytest.mark.parametrize("sign", [1, -1])
def test_tension_of_a_rigid_rod_is_the_discrete_sum(beads, sign):
    diameter, rate, viscosity = 0.1, sign * 2.0, 0.3
    fibers = Fibers(straight_chain(beads, diameter), 1.0, viscosity)
    _, _, forces = instant_rates(fibers, fibers.positions * [rate, -rate, 0], np.zeros(3))
    drag = 3 * np.pi * viscosity * diameter
    expected = -drag * rate * np.cumsum(fibers.positions[0, :, 0])[:-1]
    np.testing.assert_allclose(forces[0, :, 0], expected, rtol=1e-12)
    assert np.abs(forces[0, :, 1:]).max() < 1e-14


def test_tension_is_the_continuous_parabola_between_beads():
    """−(3πμS/2)(L²/4 − s²) in compression, which the sum of a uniform chain meets at the contact points."""
    fibers = Fibers(straight_chain(40, 1 / 40), 1.0, 1.0)
    _, _, forces = instant_rates(fibers, fibers.positions * [-1.0, 1.0, 0], np.zeros(3))
    s = fibers.positions[0, :-1, 0] + fibers.radius
    np.testing.assert_allclose(forces[0, :, 0], -1.5 * np.pi * (0.25 - s**2), rtol=1e-12)


def test_elastic_loss_equals_the_work_against_drag():
    """dE/dt of the energy of each law is minus the dissipation 6πμa Σv² + 8πμa³ Σω² of the dense solution."""
    for law in ("sine", "discreteRod"):
        fibers = Fibers(bent(3, 12, 0.1), 0.4, 0.7, curvature_law=law)
        still = np.zeros((3, 12, 3))
        turn, _, _ = instant_rates(fibers, still, still)
        for f in range(3):
            v, spin, _ = dense_solution(fibers, f, still[f], still[f])
            a = fibers.radius
            loss = 6 * np.pi * 0.7 * a * (v**2).sum() + 8 * np.pi * 0.7 * a**3 * (spin**2).sum()
            h = 1e-5
            energies = []
            for side in (h, -h):
                links = fibers.links + side * np.cross(turn, fibers.links)
                moved = Fibers(positions_of(links, 0.1), 0.4, 0.7, curvature_law=law)
                energies.append(moved.bending_energy[f])
            assert (energies[1] - energies[0]) / (2 * h) == pytest.approx(loss, rel=1e-6)


def test_straight_and_folded_links_feel_no_moment():
    for law in ("sine", "discreteRod"):
        links = np.zeros((2, 6, 3))
        links[..., 0] = 1
        links[1, 3:, 0] = -1
        fibers = Fibers(positions_of(links, 0.1), 1.0, 1.0, curvature_law=law)
        turn, drift, _ = instant_rates(fibers, np.zeros(3), np.zeros(3))
        assert np.abs(turn).max() == 0 and np.abs(drift).max() == 0
        assert (fibers.curvature == 0).all()


def at_rest(beads, gradient, drift=(0, 0, 0), **options):
    """Steppers' view of a rod along x, in a linear flow with a centre velocity, L = 2."""
    fibers = Fibers(straight_chain(beads, 2 / beads), 1e-3, 0.7)
    stepper = Stepper(fibers, **options)
    gradient = np.asarray(gradient, dtype=float)
    spin = gradient - gradient.T
    turn = 0.5 * np.array([spin[2, 1], spin[0, 2], spin[1, 0]])
    velocity = stepper.positions @ gradient.T + drift
    stepper.observe(0.0, velocity, np.broadcast_to(turn, velocity.shape))
    return stepper


@pytest.mark.parametrize("integrator", ["ab3", "implicit"])
@pytest.mark.parametrize("beads", [2, 3, 10])
def test_tension_of_a_rod_along_an_extension(beads, integrator):
    """In free drain the beads up to link i are pulled from the rest by their drag, T_i = 6πμa E Σ_{j≤i} (x_c − x_j)
    = 6πμa 2a E i (N − i)/2, i = 1 … N − 1 (a slender body has the same parabola, E (l² − s²)/2 times a drag per
    length); compressed, where the flow comes in."""
    for rate in (1.5, -1.5):
        stepper = at_rest(beads, np.diag([rate, -rate / 2, -rate / 2]), integrator=integrator)
        radius, link = stepper.fibers.radius, np.arange(1, beads)
        expected = 6 * np.pi * 0.7 * radius * 2 * radius * rate * link * (beads - link) / 2
        np.testing.assert_allclose(stepper.tension[0], expected, rtol=1e-12)
        np.testing.assert_allclose(stepper.bead_velocities, 0, atol=1e-13)


@pytest.mark.parametrize("mobility", ["freeDrain", "rpy"])
def test_no_tension_where_a_flow_moves_it_as_a_rigid_body(mobility):
    rotation = [[0, -1, 0.3], [1, 0, 0.2], [-0.3, -0.2, 0]]
    stepper = at_rest(6, rotation, (0.5, 2, 1), mobility=mobility)
    assert np.abs(stepper.tension).max() < 1e-13
    np.testing.assert_allclose(
        stepper.bead_velocities, stepper.positions @ np.transpose(rotation) + (0.5, 2, 1), atol=1e-13
    )


@pytest.mark.parametrize("mobility", ["freeDrain", "rpy"])
def test_tension_and_velocities_of_bent_fibers_equal_the_dense_solution(mobility):
    fibers = Fibers(crooked(3, 7, 0.2, 1), 0.3, 0.7)
    velocity, rotation = np.random.default_rng(2).standard_normal((2, 3, 7, 3))
    stepper = Stepper(fibers, mobility=mobility)
    stepper.observe(0.0, velocity, rotation)
    for f in range(3):
        v, _, forces = dense_solution(fibers, f, velocity[f], rotation[f], mobility)
        assert np.abs(stepper.bead_velocities[f] - v).max() < 1e-11 * np.abs(v).max()
        pull = (forces * fibers.links[f]).sum(axis=1)
        assert np.abs(stepper.tension[f] - pull).max() < 1e-10 * np.abs(forces).max()


def test_tension_needs_the_flow_of_now():
    stepper = at_rest(4, np.zeros((3, 3)))
    stepper.advance(0.1)
    with pytest.raises(ValueError, match="no sample of the flow at time"):
        _ = stepper.tension
