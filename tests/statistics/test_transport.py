"""Dispersion of paths whose law is known."""

import numpy as np
import pytest

from gbm_plugin.statistics.transport import exponent, mean_square_displacement

LAGS = [1, 2, 4, 8, 16]


def test_random_walk_is_diffusive():
    steps = np.random.default_rng(0).normal(size=(400, 500, 2))
    found = mean_square_displacement(steps.cumsum(axis=0), LAGS)
    np.testing.assert_allclose(found, 2 * np.array(LAGS), rtol=0.05)
    assert exponent(LAGS, found) == pytest.approx(1, abs=0.03)


def test_straight_motion_and_closed_paths():
    time = np.arange(200.0)[:, None, None]
    velocity = np.array([[1.0, 0.5], [0.0, 2.0]])
    assert exponent(LAGS, mean_square_displacement(time * velocity, LAGS)) == pytest.approx(2)
    circle = np.concatenate([np.cos(2.5 * time), np.sin(2.5 * time)], axis=-1)
    assert mean_square_displacement(circle, [7]) == pytest.approx(2 - 2 * np.cos(2.5 * 7))


def test_lags_beyond_the_paths():
    with pytest.raises(ValueError, match="no lags"):
        mean_square_displacement(np.zeros((10, 2, 2)), [10])
