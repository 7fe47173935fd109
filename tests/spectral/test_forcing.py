"""Forces: their energy budget, statistics and reproducibility."""

import numpy as np
import pytest
from scipy.stats import kstest

from gbm_plugin.spectral import EswaranPope, LinearForcing, SpectralSolver
from gbm_plugin.spectral.forcing import half_shell
from gbm_plugin.spectral.normals import logarithm, normals, turn

from .fields import abc, noise, taylor_green


def moving(forcing, n=16, **options):
    solver = SpectralSolver(n, 0.02, forcing=forcing, **({"time_step": 0.01} | options))
    solver.set_velocity(noise(n) + np.array([3.0, 1.0, -2.0])[:, None, None, None])
    return solver


def fluctuation_energy(u):
    return ((u - u.mean(axis=(1, 2, 3), keepdims=True)) ** 2).sum(axis=0).mean() / 2


def test_linear_forcing_budget_of_the_right_hand_side():
    """dk/dt = 2 A k - eps, k without the mean flow."""
    solver = moving(LinearForcing(coefficient=0.3))
    budget, k = solver.energy_budget(), fluctuation_energy(solver.velocity)
    eps = solver.statistics()["dissipation"]
    assert budget["power"] == pytest.approx(2 * 0.3 * k, rel=1e-13)
    assert budget["rate"] == pytest.approx(2 * 0.3 * k - eps, rel=1e-12)
    assert abs(budget["transfer"]) < 1e-13 * eps


def test_constant_power_budget():
    solver = moving(LinearForcing(power=0.7))
    budget = solver.energy_budget()
    assert budget["power"] == pytest.approx(0.7, rel=1e-13)
    assert budget["rate"] == pytest.approx(0.7 - solver.statistics()["dissipation"], rel=1e-12)


@pytest.mark.parametrize("forcing", [LinearForcing(coefficient=0.4), LinearForcing(power=0.5)])
@pytest.mark.parametrize("scheme, order", [("ab3", 3), ("rk4", 4)])
def test_beltrami_flow_under_linear_forcing(forcing, scheme, order):
    """k' = 2 A k - 2 nu q^2 k for an ABC flow of wavenumber q: solved by hand for both forces."""
    q, nu, end = 2.0, 0.05, 1.0
    u = abc(12, waves=2)
    k0 = (u**2).sum(axis=0).mean() / 2
    r = 2 * nu * q**2
    if forcing.power is None:
        exact = k0 * np.exp((2 * forcing.coefficient - r) * end)
    else:
        exact = forcing.power / r + (k0 - forcing.power / r) * np.exp(-r * end)
    errors = []
    for steps in (10, 20, 40):
        solver = SpectralSolver(12, nu, forcing=forcing, time_step=end / steps, scheme=scheme)
        solver.set_velocity(u)
        solver.advance(steps)
        errors.append(abs(solver.statistics()["kinetic_energy"] / exact - 1))
    assert np.log2(errors[0] / errors[1]) == pytest.approx(order, abs=0.4)
    assert np.log2(errors[1] / errors[2]) == pytest.approx(order, abs=0.25)


def test_mean_flow_feels_no_force():
    for forcing in (
        LinearForcing(coefficient=0.5),
        LinearForcing(power=0.5),
        EswaranPope(variance=0.01, time_scale=0.3, cutoff=2, seed=0),
    ):
        solver = moving(forcing, n=8)
        before = solver.velocity.mean(axis=(1, 2, 3))
        solver.advance(50)
        assert solver.velocity.mean(axis=(1, 2, 3)) == pytest.approx(before, rel=1e-13)


def test_energy_budget_over_time():
    """The integral of power - dissipation is the change of energy (Simpson's rule over the steps)."""
    solver = SpectralSolver(16, 0.02, forcing=LinearForcing(coefficient=0.3), time_step=0.005, scheme="rk4")
    solver.set_velocity(taylor_green(16))
    k, rates = [], []
    for _ in range(41):
        budget = solver.energy_budget()
        k.append(solver.statistics()["kinetic_energy"])
        rates.append(budget["power"] - budget["dissipation"])
        solver.advance()
    simpson = 0.005 / 3 * (rates[0] + 4 * sum(rates[1:-1:2]) + 2 * sum(rates[2:-1:2]) + rates[-1])
    assert k[-1] - k[0] == pytest.approx(simpson, rel=1e-8)


@pytest.mark.parametrize("square, count", [(2, 18), (6, 80), (8, 92)])
def test_number_of_forced_modes(square, count):
    """N_F of Eswaran & Pope 1988."""
    assert EswaranPope(variance=1, time_scale=1, cutoff=square**0.5, seed=0).mode_count == count
    k = half_shell(square**0.5)
    both = {tuple(v) for v in k} | {tuple(-v) for v in k}
    assert len(both) == count and (0, 0, 0) not in both


def test_normal_numbers():
    """Gaussian by Kolmogorov and Smirnov's test, and the functions in them to rounding."""
    z = np.concatenate([normals(seed, step, 1000) for seed in (0, 7) for step in range(200)])
    assert kstest(z, "norm").pvalue > 1e-3
    assert z.var() == pytest.approx(1, abs=4 * np.sqrt(2 / len(z)))
    # neighbours, steps and seeds know nothing of each other
    for other in (np.roll(z, 1), np.roll(z, 2), np.roll(z, 1000), np.roll(z, 200_000)):
        assert abs((z * other).mean()) < 4 / np.sqrt(len(z))
    u = np.concatenate([2.0 ** -np.arange(54), (np.arange(1, 10**4) / 1e4), 1 - 2.0 ** -np.arange(1, 54)])
    np.testing.assert_allclose(logarithm(u), np.log(u), rtol=1e-15, atol=1e-300)
    v = u[u < 1]
    np.testing.assert_allclose(turn(v), (np.cos(2 * np.pi * v), np.sin(2 * np.pi * v)), atol=1e-15)


def test_eswaran_pope_is_solenoidal_with_the_stated_variance_and_memory():
    """Each Cartesian part of b has the variance; the projection takes one of three components."""
    force = EswaranPope(variance=0.04, time_scale=0.5, cutoff=8**0.5, seed=3)
    k, h, steps = half_shell(8**0.5), 0.1, 4000
    series = np.empty((steps, len(k), 3), complex)
    for s in range(steps):
        series[s] = force.force()
        force.advance(h)
    assert np.abs((series * k).sum(axis=2)).max() < 1e-14
    power = (np.abs(series) ** 2).sum(axis=2).mean()
    independent = steps * h / (2 * 0.5) * len(k) * 2
    assert power == pytest.approx(4 * 0.04, rel=4 * np.sqrt(2 / independent))
    for lag in (1, 5, 10):
        product = (series[lag:] * series[:-lag].conj()).real.sum(axis=2).mean()
        assert product / power == pytest.approx(np.exp(-lag * h / 0.5), abs=0.02)


def test_eswaran_pope_white_noise_power():
    """From rest and without advection, dk/dt tends to 4 variance T_L N_F when T_L is short."""
    variance, memory, h, steps = 1e-6, 0.05, 0.01, 400
    gained = []
    for seed in range(12):
        force = EswaranPope(variance=variance, time_scale=memory, cutoff=8**0.5, seed=seed)
        solver = SpectralSolver(8 + 2, 1e-9, forcing=force, time_step=h)  # so slow that advection is nothing
        solver.advance(steps)
        gained.append(solver.statistics()["kinetic_energy"])
    # double integral of exp(-|t - s|/T) over the run: 2 T (t - T (1 - exp(-t/T))), and discretely held steps
    r = np.exp(-h / memory)
    lags = np.arange(1, steps)
    factor = h**2 * (steps + 2 * ((steps - lags) * r**lags).sum())
    expected = 0.5 * 4 * variance * 92 * factor
    assert factor == pytest.approx(2 * memory * steps * h, rel=0.05)
    assert np.mean(gained) == pytest.approx(expected, rel=4 / np.sqrt(12 * 92))


def test_same_seed_same_force_at_any_resolution():
    def run(n, seed):
        force = EswaranPope(variance=1e-3, time_scale=0.5, cutoff=2, seed=seed)
        solver = SpectralSolver(n, 0.5, forcing=force, time_step=0.02)
        solver.advance(10)
        return solver.coefficients[:, :3, :3, :3]

    assert np.array_equal(run(12, 1), run(12, 1))
    assert run(24, 1) == pytest.approx(
        run(12, 1), rel=1e-4, abs=1e-8
    )  # very viscous: small scales do nothing
    assert np.abs(run(12, 2) - run(12, 1)).max() > 1e-3


def test_eswaran_pope_power_is_the_mean_product():
    force = EswaranPope(variance=0.1, time_scale=0.5, cutoff=2, seed=5)
    solver = moving(force, n=12)
    rest = SpectralSolver(12, 0.02, time_step=0.01)
    with_force, without = solver.operators.zeros(), rest.operators.zeros()
    solver._evaluate(solver._u, with_force, 0.0)
    solver.operators.nonlinear(solver._u, without)
    f = solver.operators.to_physical(with_force - without)
    assert solver.statistics()["power"] == pytest.approx((f * solver.velocity).sum(axis=0).mean(), rel=1e-12)


@pytest.mark.parametrize(
    "make, message",
    [
        (lambda: LinearForcing(), "exactly one of coefficient and power"),
        (lambda: LinearForcing(coefficient=1, power=1), "exactly one of coefficient and power"),
        (lambda: LinearForcing(coefficient=-1), "coefficient of LinearForcing"),
        (lambda: LinearForcing(power=0), "power of LinearForcing"),
        (lambda: EswaranPope(variance=0, time_scale=1, cutoff=2, seed=0), "variance"),
        (lambda: EswaranPope(variance=1, time_scale=-1, cutoff=2, seed=0), "time_scale"),
        (lambda: EswaranPope(variance=1, time_scale=1, cutoff=0.5, seed=0), "cutoff"),
        (lambda: EswaranPope(variance=1, time_scale=1, cutoff=2, seed=-1), "seed"),
        (lambda: moving(EswaranPope(variance=1, time_scale=1, cutoff=9, seed=0), n=8), "must not exceed 2"),
        (lambda: SpectralSolver(8, 0.1, forcing=LinearForcing(power=1), time_step=0.1).advance(), "moves"),
    ],
)
def test_bad_values_are_refused(make, message):
    with pytest.raises(ValueError, match=message):
        make()


def test_linear_forcing_takes_keywords_only():
    with pytest.raises(TypeError):
        LinearForcing(0.1)
