"""Statistics gathered sample by sample, against the same computed from all samples at once."""

from __future__ import annotations

import numpy as np
import pytest

from gbm_plugin.statistics.ensemble import correlation, fiber_average
from gbm_plugin.statistics.fibers import end_to_end, gyration_radius, mean_curvature
from gbm_plugin.statistics.running import EDGES, Running, merged

TIMES, FIBERS, BEADS, RADIUS, LAGS = 150, 7, 6, 0.1, 12
LENGTH = 2 * RADIUS * (BEADS - 1)


@pytest.fixture(scope="module")
def positions():
    """Chains of links that turn at random from time to time: correlated, of the right link length."""
    random = np.random.default_rng(5)
    steps = np.cumsum(random.normal(scale=0.4, size=(TIMES, FIBERS, BEADS - 1, 3)), axis=0)
    links = steps + random.normal(size=(FIBERS, BEADS - 1, 3))
    links *= 2 * RADIUS / np.linalg.norm(links, axis=-1, keepdims=True)
    return np.concatenate([np.zeros((TIMES, FIBERS, 1, 3)), np.cumsum(links, axis=2)], axis=2)


def gathered(positions, fibers=slice(None)):
    part = positions[:, fibers]
    running = Running(part.shape[1], BEADS, RADIUS, LAGS)
    for x in part:
        running.observe(x)
    return running


def check(running, positions):
    """The same as from all positions (T, F, N, 3), to rounding."""
    vectors = end_to_end(positions) / LENGTH
    values = {
        "R2": (vectors**2).sum(axis=-1),
        "Rg": gyration_radius(positions) / LENGTH,
        "curvature": mean_curvature(positions, RADIUS) * LENGTH,
    }
    for name, v in values.items():
        average, expected = running.averages[name], fiber_average(v)
        found = average.estimate()
        assert found.value == pytest.approx(expected.value, rel=1e-13)
        assert found.error == pytest.approx(expected.error, rel=1e-9)
        assert found.correlation_time == pytest.approx(expected.correlation_time, rel=1e-9)
        np.testing.assert_allclose(average.moments(), [(v**p).mean() for p in (1, 2, 3, 4)], rtol=1e-13)
        np.testing.assert_array_equal(average.counts, np.histogram(v, EDGES[name])[0])
        assert (average.density() * np.diff(average.edges)).sum() == pytest.approx(1)
    for axis in range(3):
        seen = values["R2"] - vectors[..., axis] ** 2
        np.testing.assert_array_equal(running.projected[axis], np.histogram(seen, EDGES["projected"])[0])
    np.testing.assert_allclose(running.correlations["R"].value(), correlation(vectors, LAGS), rtol=1e-10)


def test_they_are_those_of_all_samples(positions):
    check(gathered(positions), positions)


def test_the_correlation_of_the_curvature_is_of_its_fluctuations(positions):
    """A constant added to all of it would change nothing: 1 at first, and what the definition says at a lag."""
    v = mean_curvature(positions, RADIUS) * LENGTH
    rho = gathered(positions).curvature_correlation()
    deviation = v - v.mean()
    direct = (deviation[3:] * deviation[:-3]).mean() / (deviation**2).mean()
    assert rho[0] == 1 and rho[3] == pytest.approx(direct, abs=0.02)


@pytest.mark.parametrize("cut", [1, 5, 80])
def test_they_go_on_to_the_same_bits(positions, cut):
    whole, first = gathered(positions), gathered(positions[:cut])
    second = Running(FIBERS, BEADS, RADIUS, LAGS)
    second.restore(first.state())
    for x in positions[cut:]:
        second.observe(x)
    assert first.samples == cut and second.samples == TIMES
    for name, value in whole.state().items():
        np.testing.assert_array_equal(second.state()[name], value, err_msg=name)


def test_parts_of_a_family_are_put_together_and_divided_again(positions):
    """Three shares, then two from the middle on, then one: counts to the last, sums to rounding."""
    shares = [slice(0, 2), slice(2, 5), slice(5, 7)]
    states = [gathered(positions[:60], s).state() for s in shares]
    again = []
    for number, fibers in enumerate((slice(0, 3), slice(3, 7))):
        running = Running(fibers.stop - fibers.start, BEADS, RADIUS, LAGS)
        running.restore(merged(states, fibers, pooled=number == 0))
        for x in positions[60:, fibers]:
            running.observe(x)
        again.append(running.state())
    whole = Running(FIBERS, BEADS, RADIUS, LAGS)
    whole.restore(merged(again, slice(None)))
    check(whole, positions)


def test_fibers_of_two_beads_have_no_curvature(positions):
    running = Running(FIBERS, 2, RADIUS, LAGS)
    running.observe(positions[0, :, :2])
    assert "curvature" not in running.averages
    assert running.averages["R2"].estimate().value == pytest.approx(1)
    assert running.averages["R2"].counts[-1] == FIBERS  # 1 but for rounding, on either side


def test_a_state_of_other_fibers_is_refused(positions):
    state = gathered(positions[:3]).state()
    for changed in (state | {"R2/of_fibers": np.zeros(3)}, state | {"R/recent": np.full((1, 7, 3), np.nan)}):
        with pytest.raises(ValueError):
            Running(FIBERS, BEADS, RADIUS, LAGS).restore(changed)
    with pytest.raises(ValueError, match="other bins"):
        Running(FIBERS, BEADS, RADIUS, LAGS).restore(state | {"R2/edges": 2 * state["R2/edges"]})
    with pytest.raises(ValueError, match="3 and 4 samples"):
        Running(FIBERS, BEADS, RADIUS, LAGS).restore(state | {"Rg/sums": np.zeros(4)})
