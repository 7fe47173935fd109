"""Shapes that are what their name says, and modes that lose nothing."""

import numpy as np
import pytest

from gbm_plugin.statistics.shapes import SHAPES, bend_angles, bending_modes, classify


def chain(angles, start=0.3):
    """A planar chain of unit links that turns by these angles."""
    direction = start + np.concatenate([[0.0], np.cumsum(angles)])
    links = np.stack([np.cos(direction), np.sin(direction)], axis=-1)
    return np.concatenate([np.zeros((1, 2)), np.cumsum(links, axis=0)])


def free_mode(number, beads):
    """Angles of a bending mode of a free-free beam: the curvature of the clamped-clamped shape of equal number."""
    beta = (4.730040745, 7.853204624, 10.995607838)[number - 1]
    s = np.arange(1, beads - 1) / (beads - 1)
    ratio = (np.cosh(beta) - np.cos(beta)) / (np.sinh(beta) - np.sin(beta))
    return np.cosh(beta * s) - np.cos(beta * s) - ratio * (np.sinh(beta * s) - np.sin(beta * s))


@pytest.mark.parametrize("beads", [6, 7, 20])
@pytest.mark.parametrize("sign", [1, -1])
def test_names(beads, sign):
    middle = (np.abs(np.arange(beads - 2) - (beads - 3) / 2) < 0.6).astype(float)  # one bead or two
    shapes = [0.3 * free_mode(1, beads), np.full(beads - 2, 0.2), 0.8 * middle, 0.3 * free_mode(2, beads)]
    shapes.append(0.3 * free_mode(3, beads))
    kinds, shares = classify(np.array([chain(sign * a) for a in shapes]))
    assert [SHAPES[k] for k in kinds] == ["U", "U", "V", "S", "W"]
    assert (shares[[0, 3, 4]] > 0.8).all()


def test_modes_are_an_orthogonal_transform():
    angles = np.random.default_rng(0).uniform(-1, 1, (50, 6))
    chains = np.array([chain(a) for a in angles])
    np.testing.assert_allclose(bend_angles(chains), angles, atol=1e-12)
    np.testing.assert_allclose((bending_modes(chains) ** 2).sum(axis=-1), (angles**2).sum(axis=-1))


def test_reversed_and_mirrored_fibers_are_of_the_same_kind():
    chains = np.array([chain(a) for a in np.random.default_rng(1).uniform(-1, 1, (200, 4))])
    kinds, _ = classify(chains)
    np.testing.assert_array_equal(kinds, classify(chains[:, ::-1])[0])
    np.testing.assert_array_equal(kinds, classify(chains * [1, -1])[0])
    assert len(set(kinds)) == len(SHAPES)


def test_wrong_shape():
    with pytest.raises(ValueError, match="allowed is"):
        bend_angles(np.zeros((4, 2, 2)))
