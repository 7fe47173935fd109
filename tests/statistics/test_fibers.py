import numpy as np
import pytest

from gbm_plugin.statistics import fibers

RADIUS = 0.05


def arc(beads, angle):
    """A plane chain whose neighbouring links enclose `angle`: beads on a circle."""
    directions = angle * np.arange(beads - 1)
    links = 2 * RADIUS * np.stack([np.cos(directions), np.sin(directions), 0 * directions], axis=-1)
    return np.concatenate([np.zeros((1, 3)), np.cumsum(links, axis=0)])


def test_straight_fiber():
    """R = 2a(N−1), no curvature, R_g² = (2a)²(N²−1)/12 (equally spaced points)."""
    direction = np.array([1.0, -2.0, 2.0]) / 3
    for beads in (2, 3, 6, 20):
        chain = 2 * RADIUS * np.arange(beads)[:, None] * direction + [10.0, -3.0, 7.0]
        np.testing.assert_allclose(fibers.end_to_end(chain), 2 * RADIUS * (beads - 1) * direction, atol=1e-14)
        assert fibers.end_to_end_squared_ratio(chain, RADIUS) == pytest.approx(1, abs=1e-13)
        assert fibers.contour_length(chain) == pytest.approx(2 * RADIUS * (beads - 1), rel=1e-13)
        radius = 2 * RADIUS * np.sqrt((beads**2 - 1) / 12)
        assert fibers.gyration_radius(chain) == pytest.approx(radius, rel=1e-12)
        assert fibers.link_length_error(chain, RADIUS) < 1e-13
        assert fibers.curvature(chain, RADIUS).shape == (beads - 2,)
        assert np.all(fibers.curvature(chain, RADIUS, "discreteRod") < 1e-12)


@pytest.mark.parametrize("angle", [1e-9, 1e-3, 0.3, np.pi / 2, 3.0, np.pi - 1e-9])
def test_curvature_of_an_arc(angle):
    chain = arc(7, angle)
    sine, rod = fibers.curvature(chain, RADIUS), fibers.curvature(chain, RADIUS, "discreteRod")
    np.testing.assert_allclose(sine, np.sin(angle) / (2 * RADIUS), rtol=1e-6)
    np.testing.assert_allclose(rod, 2 * np.tan(angle / 2) / (2 * RADIUS), rtol=1e-6)
    assert fibers.mean_curvature(chain, RADIUS) == pytest.approx(np.sin(angle) / (2 * RADIUS), rel=1e-6)


def test_curvature_converges_to_that_of_the_circle_at_second_order():
    errors = []
    for beads in (20, 40, 80):
        angle = 1.0 / (beads - 2)  # one circle, more beads: curvature = angle/(2a)
        for law in fibers.CURVATURE_LAWS:
            ratio = fibers.curvature(arc(beads, angle), RADIUS, law) * 2 * RADIUS / angle
            errors.append(np.abs(ratio - 1).max())
    orders = np.log(np.array(errors[:4]) / errors[2:]) / np.log([38 / 18] * 2 + [78 / 38] * 2)
    np.testing.assert_allclose(orders, 2, atol=0.02)


def test_fold_and_ring():
    fold = arc(3, np.pi)
    assert fibers.curvature(fold, RADIUS)[0] < 1e-13  # the sine law does not see it
    assert fibers.curvature(fold, RADIUS, "discreteRod")[0] > 1e13
    ring = arc(13, 2 * np.pi / 12)
    assert fibers.end_to_end_squared_ratio(ring, RADIUS) < 1e-25
    polygon = arc(12, 2 * np.pi / 12)  # corners of a regular polygon lie at its circumradius
    assert fibers.gyration_radius(polygon) == pytest.approx(RADIUS / np.sin(np.pi / 12), rel=1e-12)


def test_gyration_radius_is_the_mean_over_pairs():
    """R_g² = Σ_ij |x_i − x_j|²/2N² (Lagrange's theorem)."""
    chain = np.random.default_rng(3).normal(size=(9, 3))
    pairs = ((chain[:, None] - chain) ** 2).sum(axis=-1)
    assert fibers.gyration_radius(chain) ** 2 == pytest.approx(pairs.sum() / (2 * 81), rel=1e-12)


def test_leading_axes_and_rigid_motion():
    random = np.random.default_rng(5)
    chains = np.cumsum(random.normal(size=(4, 5, 8, 3)), axis=2)
    turn = np.linalg.qr(random.normal(size=(3, 3)))[0]
    moved = chains @ turn.T + [3.0, 4.0, 5.0]
    for function in (
        fibers.contour_length,
        fibers.gyration_radius,
        lambda x: fibers.curvature(x, RADIUS),
        lambda x: fibers.curvature(x, RADIUS, "discreteRod"),
        lambda x: fibers.end_to_end_squared_ratio(x, RADIUS),
    ):
        each = np.array([[function(chain) for chain in row] for row in chains])
        np.testing.assert_allclose(function(chains), each, rtol=1e-13)
        np.testing.assert_allclose(function(moved), each, rtol=1e-9)
        backwards = each[..., ::-1] if each.ndim == 3 else each
        np.testing.assert_allclose(function(chains[:, :, ::-1]), backwards, rtol=1e-9)


def test_worst_link_is_found():
    chains = np.stack([arc(6, 0.2)] * 3)
    chains[1, 4:] += 1e-7 * (chains[1, 4] - chains[1, 3])
    assert fibers.link_length_error(chains, RADIUS) == pytest.approx(1e-7, rel=1e-6)


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (
            lambda: fibers.end_to_end(np.zeros((1, 3))),
            r"shape \(1, 3\); allowed is \(..., N, 3\) with N >= 2",
        ),
        (lambda: fibers.contour_length(np.zeros((5, 2))), r"shape \(5, 2\)"),
        (lambda: fibers.mean_curvature(np.zeros((2, 3)), 1.0), "N >= 3"),
        (lambda: fibers.curvature(arc(4, 0.1), 0.0), "radius is 0.0"),
        (lambda: fibers.curvature(arc(4, 0.1), 1.0, "cosine"), "allowed are sine, discreteRod"),
    ],
)
def test_bad_input(call, message):
    with pytest.raises(ValueError, match=message):
        call()
