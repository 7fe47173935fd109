"""The worm-like chain's limits, its inverse and its fits."""

import numpy as np
import pytest

from gbm_plugin.statistics.wormlike import (
    fit,
    fit_transition,
    persistence_length,
    persistence_lengths,
    squared_ratio,
)


def test_limits_and_inverse():
    assert squared_ratio(0.0) == 1
    np.testing.assert_allclose(
        squared_ratio([1e-4, 1e-3, 2e-3]), 1 - np.array([1e-4, 1e-3, 2e-3]) / 3, rtol=1e-6
    )
    assert squared_ratio(1e4) == pytest.approx(2e-4, rel=2e-4)
    for x in (1e-2, 0.7, 5.0, 300.0):
        assert persistence_lengths(float(squared_ratio(x))) == pytest.approx(x, rel=1e-6)
    assert persistence_lengths(1.0) == 0


def test_persistence_length_of_the_paper():
    """K^b = 1e-6 in Flow I: 0.0316/(1.5e-6)^(1/8); twice the stiffness is 2^(1/4) as long."""
    one, two = persistence_length([1e-6, 2e-6], 1e-3, 1.0, 1.5e-3)
    assert one == pytest.approx(1e-6**0.25 / 1.5e-6**0.125)
    assert two / one == pytest.approx(2**0.25)


def test_fit_and_its_error():
    """The error is what γ scatters by, over many draws, and no point with a small error of its own decides."""
    random = np.random.default_rng(1)
    x = np.geomspace(2, 40, 12)
    noisy = [squared_ratio(x / 2.5) * np.exp(0.05 * random.normal(size=12)) for _ in range(40)]
    draws = [fit(x, y, 0.05 * y) for y in noisy]
    gammas = np.array([d.gamma for d in draws])
    assert gammas.mean() == pytest.approx(2.5, abs=3 * gammas.std() / np.sqrt(40))
    # the larger of two estimates, each of which scatters: on the safe side by a part of their scatter
    assert 0.8 < np.median([d.error for d in draws]) / gammas.std() < 1.6
    y, e = squared_ratio(x / 2.5), np.full(12, 0.02)
    y[0], e[0] = squared_ratio(x[0] / 5.0), 1e-9
    assert fit(x, y, e).gamma == pytest.approx(2.5, rel=0.05)
    assert fit(x, 0.3 * squared_ratio(x), e, prefactor=True).gamma == pytest.approx(0.3, rel=1e-4)


def test_transition():
    x = np.geomspace(1, 40, 20)
    found = fit_transition(x, 0.45 + 0.55 / (1 + (x / 5) ** 3.5))
    assert (found.plateau, found.middle, found.steepness) == pytest.approx((0.45, 5, 3.5), rel=1e-5)
    assert found.scatter < 1e-6 and found(1e9) == pytest.approx(0.45)


def test_bad_input():
    with pytest.raises(ValueError, match="must be positive"):
        persistence_lengths(0.0)
    with pytest.raises(ValueError, match="cannot be fitted"):
        fit([], [], [])
