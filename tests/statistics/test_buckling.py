"""Tracks and events counted on paths whose counts are known, and the error of their ratio."""

import numpy as np
import pytest

from gbm_plugin.statistics.buckling import OUTSIDE, REGIONS, Tracks, compression, probability, square, strain

A, B = 7, 8  # two regions
OUT = OUTSIDE


def count(regions, ratios):
    """Tracks and events of one fiber."""
    tracks = Tracks(1)
    for region, ratio in zip(regions, ratios, strict=True):
        tracks.observe(np.array([region]), np.array([ratio]))
    return int(tracks.tracks[0]), int(tracks.events[0])


@pytest.mark.parametrize(
    "regions, ratios, expected",
    [
        ([OUT, A, A, OUT], [1, 1, 1, 1], (1, 0)),
        ([OUT, A, A, OUT], [1, 1, 0.7, 1], (1, 1)),
        ([OUT, A, A, A, A, OUT], [1, 1, 0.7, 0.9, 0.7, 0.7], (1, 1)),  # at most one event a track
        ([OUT, A, A, OUT], [1, 0.79, 0.7, 0.7], (0, 0)),  # enters bent: no track, whatever follows
        ([OUT, A, A, A], [1, 0.7, 0.9, 0.7], (0, 0)),
        ([OUT, A, OUT, OUT], [1, 1, 0.7, 0.7], (1, 0)),  # buckles after it has left
        ([A, A, OUT, A, OUT], [1, 0.5, 0.9, 1, 1], (1, 0)),  # inside at the start: counts once it has left
        ([OUT, A, B, B], [1, 1, 1, 0.7], (2, 1)),  # regions that touch are two
        ([OUT, A, OUT, A, OUT], [0.8, 0.8, 1, 0.8, 0.8], (2, 0)),  # exactly at the criterion is straight
    ],
)
def test_counts(regions, ratios, expected):
    assert count(regions, ratios) == expected


def test_a_restart_changes_nothing():
    random = np.random.default_rng(3)
    regions = random.choice([OUT, A, B], (60, 50), p=[0.4, 0.3, 0.3])
    ratios = random.uniform(0.6, 1.0, (60, 50))
    whole, first, second = Tracks(50), Tracks(50), Tracks(50)
    for n, sample in enumerate(zip(regions, ratios, strict=True)):
        whole.observe(*sample)
        (first if n < 31 else second).observe(*sample)
        if n == 30:
            second.restore(first.state())
    np.testing.assert_array_equal(whole.tracks, second.tracks)
    np.testing.assert_array_equal(whole.events, second.events)
    assert 0 < whole.events.sum() < whole.tracks.sum()


def test_strain_is_where_strain_dominates_rotation():
    """S² cos² x̃ cos² ỹ against S² sin² x̃ sin² ỹ, from the gradient itself."""
    x, y = np.random.default_rng(1).uniform(-9, 9, (2, 5000))
    stronger = (np.cos(x) * np.cos(y)) ** 2 > (np.sin(x) * np.sin(y)) ** 2
    np.testing.assert_array_equal(strain(x, y, 1.0, 0.0) != OUTSIDE, stronger)


@pytest.mark.parametrize("region", REGIONS.values())
def test_every_stagnation_point_has_a_region_of_its_own(region):
    m, n = (i.ravel() for i in np.meshgrid(np.arange(-3, 4), np.arange(-3, 4)))
    along_y = (m + n) % 2 == 0  # compressed
    numbers = region(np.pi * m + 0.1, np.pi * n - 0.05, ~along_y, along_y)
    assert OUTSIDE not in numbers
    assert len(set(numbers)) == 49


def test_square_lies_within_strain_and_compression_follows_the_direction():
    x, y = np.random.default_rng(2).uniform(0, 4 * np.pi, (2, 5000))
    inner, outer = square(x, y, 0.0, 1.0) != OUTSIDE, strain(x, y, 0.0, 1.0) != OUTSIDE
    assert outer[inner].all()
    assert inner.mean() == pytest.approx(0.25, abs=0.02) and outer.mean() == pytest.approx(0.5, abs=0.02)
    # −cos x̃ cos ỹ is the rate of strain along y
    np.testing.assert_array_equal(compression(x, y, 0.0, 1.0) != OUTSIDE, np.cos(x) * np.cos(y) > 0)


def test_error_is_that_of_the_spread_between_fibers():
    """Each fiber with its own probability: the estimate of the error against the spread of many repeats."""
    random = np.random.default_rng(5)
    own = random.beta(2, 2, (2000, 60))
    tracks = random.poisson(20, (2000, 60))
    found = [probability(e, t) for e, t in zip(random.binomial(tracks, own), tracks, strict=True)]
    spread = np.std([f.value for f in found])
    assert np.mean([f.error for f in found]) == pytest.approx(spread, rel=0.05)
    assert (
        np.mean([f.binomial_error for f in found]) < 0.6 * spread
    )  # tracks of one fiber are not independent


def test_independent_tracks_have_the_binomial_error():
    random = np.random.default_rng(6)
    tracks = np.full(3000, 10)
    found = probability(random.binomial(tracks, 0.3), tracks)
    assert found.error == pytest.approx(found.binomial_error, rel=0.05)


def test_no_tracks_and_wrong_counts():
    assert np.isnan(probability([0, 0], [0, 0]).value)
    with pytest.raises(ValueError, match="at most as many"):
        probability([2], [1])
