"""Values between nodes: observed orders, exact sums, and what is asked for."""

import numpy as np
import pytest

from gbm_plugin.spectral import SpectralSolver

from .fields import noise, taylor_green

BOX = 3.0


def smooth(n, interpolation, precision="double"):
    """The same band-limited random field (|k_i| <= 4) at any resolution."""
    solver = SpectralSolver(
        n, 0.01, box=BOX, time_step=0.01, interpolation=interpolation, precision=precision
    )
    coarse = SpectralSolver(14, 0.01, box=BOX, time_step=0.01)
    coarse.set_velocity(noise(14))
    cut = coarse.modes.cut
    place = np.ix_(range(3), coarse.modes.signed, coarse.modes.signed, range(cut + 1))
    modes = solver.operators.zeros()
    modes[place] = coarse.coefficients
    solver.set_velocity(solver.operators.to_physical(modes))
    return solver


def direct_sum(solver, points):
    """Velocity and gradient by summing Fourier modes, no FFT."""
    u, (kx, ky, kz) = solver.coefficients.astype(complex), solver.modes.k
    velocity, gradient = np.empty((len(points), 3)), np.empty((len(points), 3, 3))
    for p, (x, y, z) in enumerate(points):
        wave = solver.modes.weights * np.exp(1j * (kx * x + ky * y + kz * z))
        velocity[p] = (u * wave).sum(axis=(1, 2, 3)).real
        for j, k in enumerate((kx, ky, kz)):
            gradient[p, :, j] = (1j * k * u * wave).sum(axis=(1, 2, 3)).real
    return velocity, gradient


@pytest.fixture(scope="module")
def points():
    return np.random.default_rng(2).uniform(-2 * BOX, 3 * BOX, (200, 3))  # outside of the box too


def test_exact_is_the_fourier_sum(points):
    solver = smooth(16, "exact")
    velocity, gradient = direct_sum(solver, points)
    found, extra = solver.sample(points, 0.0, "gradient")
    assert np.abs(found - velocity).max() < 1e-12 * np.abs(velocity).max()
    assert np.abs(extra - gradient).max() < 1e-12 * np.abs(gradient).max()


@pytest.mark.parametrize("word, order", [("trilinear", 2), ("cubic", 4), ("quintic", 6)])
def test_order_of_interpolation(word, order, points):
    velocity, gradient = direct_sum(smooth(16, word), points)
    errors = []
    for n in (32, 64, 128):
        found, extra = smooth(n, word).sample(points, 0.0, "gradient")
        errors.append([(found - velocity).std(), (extra - gradient).std()])
    rates = np.log2(np.array(errors[1]) / errors[2])
    assert rates == pytest.approx(order, abs=0.1)


@pytest.mark.parametrize("word", ["trilinear", "cubic", "exact"])
def test_nodes_are_hit(word):
    solver = smooth(16, word)
    index = np.random.default_rng(0).integers(0, 16, (40, 3))
    found, _ = solver.sample(index * BOX / 16, 0.0, "velocity")
    assert found == pytest.approx(solver.velocity[:, *index.T].T, abs=1e-12)


@pytest.mark.parametrize("word", ["trilinear", "cubic", "exact"])
def test_rotation_is_half_the_vorticity(word, points):
    solver = smooth(16, word)
    velocity, gradient = solver.sample(points, 0.0, "gradient")
    again, rotation = solver.sample(points, 0.0, "rotation")
    antisymmetric = [gradient[:, 2, 1] - gradient[:, 1, 2], gradient[:, 0, 2] - gradient[:, 2, 0]]
    antisymmetric.append(gradient[:, 1, 0] - gradient[:, 0, 1])
    assert rotation == pytest.approx(np.array(antisymmetric).T / 2, abs=1e-11)
    assert np.array_equal(again, velocity)
    assert np.trace(gradient, axis1=1, axis2=2) == pytest.approx(0, abs=1e-11)


def test_simple_shear_has_its_gradient_where_it_belongs():
    """u_x = sin y: du_x/dy = cos y is [0, 1]; the rotation is -cos(y)/2 about z."""
    n = 12
    y = np.arange(n) * 2 * np.pi / n
    u = np.zeros((3, n, n, n))
    u[0] = np.sin(y)[None, :, None]
    solver = SpectralSolver(n, 0.1, time_step=0.1, interpolation="exact")
    solver.set_velocity(u)
    _, gradient = solver.sample([1.0, 0.3, 2.0], 0.0)
    expected = np.zeros((3, 3))
    expected[0, 1] = np.cos(0.3)
    assert gradient == pytest.approx(expected, abs=1e-13)
    _, rotation = solver.sample([1.0, 0.3, 2.0], 0.0, need="rotation")
    assert rotation == pytest.approx([0, 0, -np.cos(0.3) / 2], abs=1e-13)


@pytest.mark.parametrize("word", ["trilinear", "cubic", "exact"])
def test_shapes_and_periodicity(word):
    solver = smooth(16, word)
    points = np.random.default_rng(1).uniform(0, BOX, (2, 5, 3))
    velocity, gradient = solver.sample(points, 0.0)
    assert velocity.shape == (2, 5, 3) and gradient.shape == (2, 5, 3, 3)
    shifted, _ = solver.sample(points + BOX * np.array([1, -2, 5]), 0.0, "velocity")
    assert shifted == pytest.approx(velocity, abs=1e-12)


def test_only_what_is_needed_is_computed(monkeypatch):
    solver = smooth(16, "trilinear")
    transformed = []
    plain = solver.operators.to_physical
    monkeypatch.setattr(
        solver.operators, "to_physical", lambda m, out: transformed.append(len(m)) or plain(m, out)
    )
    points = np.ones((4, 3))
    assert solver.sample(points, 0.0, "velocity")[1] is None
    assert sum(transformed) == 3
    solver.sample(2 * points, 0.0, "rotation")
    assert sum(transformed) == 6
    solver.sample(3 * points, 0.0, "gradient")
    assert sum(transformed) == 15
    solver.sample(4 * points, 0.0, "gradient")
    assert sum(transformed) == 15


def test_a_later_time_advances_the_flow():
    solver, reference = (SpectralSolver(12, 0.05, time_step=0.02) for _ in range(2))
    for s in (solver, reference):
        s.set_velocity(taylor_green(12))
    reference.advance(5)
    points = np.random.default_rng(0).uniform(0, 6, (3, 3))
    found, _ = solver.sample(points, 0.1, "velocity")
    assert solver.step == 5
    assert np.array_equal(found, reference.sample(points, reference.time, "velocity")[0])
    with pytest.raises(ValueError, match=r"known at t = 0\.1, not at t = 0\.05"):
        solver.sample(points, 0.05)


def test_single_precision_samples_in_double(points):
    single, double = smooth(16, "exact", "single"), smooth(16, "exact")
    one, other = single.sample(points, 0.0, "velocity")[0], double.sample(points, 0.0, "velocity")[0]
    assert one.dtype == np.float64
    assert one == pytest.approx(other, abs=1e-5)


def test_refusals():
    solver = smooth(16, "trilinear")
    with pytest.raises(ValueError, match="allowed are velocity, rotation, gradient"):
        solver.sample(np.zeros((1, 3)), 0.0, need="vorticity")
    with pytest.raises(ValueError, match=r"shape \(\.\.\., 3\)"):
        solver.sample(np.zeros((4, 2)), 0.0)
    with pytest.raises(ValueError, match="finite"):
        solver.sample(np.full((1, 3), np.nan), 0.0)
