"""Error bars of correlated series, against processes whose error is known in closed form."""

import numpy as np
import pytest
from scipy.signal import lfilter

from gbm_plugin.statistics import series


def ar1(phi: float, samples: int, seed: int) -> np.ndarray:
    """Stationary x_n = phi x_{n-1} + noise with unit variance: rho(l) = phi^l, tau = (1+phi)/(2 (1-phi))."""
    noise = np.random.default_rng(seed).standard_normal(samples)
    noise[1:] *= np.sqrt(1 - phi**2)
    return lfilter([1.0], [1.0, -phi], noise)


@pytest.mark.parametrize("phi", [0.0, 0.5, 0.9, 0.98])
def test_integral_time_of_ar1(phi):
    expected = (1 + phi) / (2 * (1 - phi))
    found = [series.integral_time(ar1(phi, 40_000, seed)) for seed in range(10)]
    assert np.mean(found) == pytest.approx(expected, rel=0.06)


@pytest.mark.parametrize("phi", [0.0, 0.9, 0.97])
def test_error_is_the_scatter_of_repeated_means(phi):
    """Exact variance of the mean of AR(1): (1/N)[(1+phi)/(1-phi) - 2 phi (1-phi^N)/(N (1-phi)^2)]."""
    n = 4000
    exact = np.sqrt(((1 + phi) / (1 - phi) - 2 * phi * (1 - phi**n) / (n * (1 - phi) ** 2)) / n)
    runs = [series.mean(ar1(phi, n, seed)) for seed in range(200)]
    assert np.mean([r.error for r in runs]) == pytest.approx(exact, rel=0.06)
    pulls = np.array([r.value / r.error for r in runs])
    assert pulls.std() == pytest.approx(1.0, abs=0.15)  # 3 sigma of 200 draws


def test_batch_means_agree():
    x = 3.0 + ar1(0.9, 400_000, seed=1)
    value, error = series.batch_means(x, batches=100)
    found = series.mean(x)
    assert value == pytest.approx(found.value, rel=1e-12)
    assert error == pytest.approx(found.error, rel=0.25)


def test_spacing_scales_times_only():
    x = ar1(0.8, 5000, seed=2)
    coarse, fine = series.mean(x), series.mean(x, spacing=0.1)
    assert fine.correlation_time == pytest.approx(0.1 * coarse.correlation_time)
    assert fine.duration == pytest.approx(500.0)
    assert (fine.value, fine.error) == (coarse.value, coarse.error)


def test_constant_series_has_no_error():
    assert series.mean(np.full(50, 0.1)).error == pytest.approx(0.0, abs=1e-15)


@pytest.mark.parametrize(
    "value, error, text",
    [
        (0.00149487, 1.43e-5, "0.001495 ± 0.000014"),
        (52.2041, 0.234, "52.20 ± 0.23"),
        (1234.5, 33.3, "1234 ± 33"),
        (2.0, 0.0, "2.000000 ± 0.000000"),
    ],
)
def test_text_shows_two_digits_of_the_error(value, error, text):
    assert str(series.Mean(value, error, 1.0, 10.0)) == text


def test_refusals():
    with pytest.raises(ValueError, match="too short"):
        series.mean(np.linspace(0, 1, 100))
    with pytest.raises(ValueError, match="not finite at sample 3"):
        series.mean([1, 2, 3, np.nan, 5])
    with pytest.raises(ValueError, match="one-dimensional"):
        series.mean(np.zeros((3, 3)))
    with pytest.raises(ValueError, match="batches"):
        series.batch_means([1.0, 2.0], batches=3)


def test_time_series_round_trip(tmp_path):
    record = series.TimeSeries()
    values = 2 + ar1(0.9, 3000, seed=4)
    for n, value in enumerate(values):
        record.record(0.5 * n, {"k": value, "eps": 2 * value})
    record.write(tmp_path / "series.csv")
    again = series.TimeSeries.read(tmp_path / "series.csv")
    assert list(again.columns) == ["time", "k", "eps"]
    assert again["k"] == pytest.approx(values, rel=1e-6)
    assert len(again.until(100.0)) == 201
    since = again.mean("eps", since=500.0)
    assert since.value == pytest.approx(2 * values[1000:].mean())
    assert since.correlation_time == pytest.approx(0.5 * 9.5, rel=0.4)
    assert since.duration == pytest.approx(1000.0)
    with pytest.raises(ValueError, match="recorded are time, k, eps"):
        record.record(1500.0, {"k": 1.0})
    with pytest.raises(ValueError, match="fewer than two"):
        record.mean("k", since=1e9)
