"""Analytic flows: conventions of gradient and rotation, and agreement with finite differences."""

import numpy as np
import pytest

from gbm_plugin.case.fields import abc
from gbm_plugin.flow import ABC, LinearFlow, TaylorGreen
from gbm_plugin.flow.trigonometry import sine_cosine

POINTS = np.random.default_rng(0).uniform(-3, 3, (4, 5, 3))


def test_simple_shear_fixes_the_convention():
    """u = (2y, 0, 0): du_x/dy is [0, 1], and the rotation ½∇×u is −1 about z."""
    shear = LinearFlow([[0, 2, 0], [0, 0, 0], [0, 0, 0]], velocity=(0, 0, 5))
    velocity, gradient = shear.sample(POINTS, 0.0)
    np.testing.assert_allclose(
        velocity, np.stack([2 * POINTS[..., 1], 0 * POINTS[..., 1], 5 + 0 * POINTS[..., 1]], -1)
    )
    assert gradient.shape == (4, 5, 3, 3) and (gradient[..., 0, 1] == 2).all()
    _, rotation = shear.sample(POINTS, 0.0, "rotation")
    assert (rotation == [0, 0, -1]).all()
    assert shear.sample(POINTS, 0.0, "velocity")[1] is None


@pytest.mark.parametrize(
    "flow",
    [
        TaylorGreen(1.7, 0.6),
        LinearFlow([[0.1, 0.2, 0.3], [-0.4, 0.5, 0.6], [0.7, 0.8, -0.6]], (1, 2, 3)),
        ABC(1.0, 0.7, -0.4, box=5.0),
    ],
)
def test_gradient_and_rotation_are_those_of_the_velocity(flow):
    _, gradient = flow.sample(POINTS, 0.0, "gradient")
    _, rotation = flow.sample(POINTS, 0.0, "rotation")
    for j in range(3):
        h = 1e-6 * np.eye(3)[j]
        change = flow.sample(POINTS + h, 0.0)[0] - flow.sample(POINTS - h, 0.0)[0]
        np.testing.assert_allclose(gradient[..., j], change / 2e-6, atol=1e-8)
    curl = [gradient[..., 2, 1] - gradient[..., 1, 2], gradient[..., 0, 2] - gradient[..., 2, 0]]
    curl.append(gradient[..., 1, 0] - gradient[..., 0, 1])
    np.testing.assert_allclose(rotation, 0.5 * np.stack(curl, -1), atol=1e-14)


def test_taylor_green_is_equation_12():
    flow = TaylorGreen(2.0, 3.0)
    velocity, _ = flow.sample(np.array([0.5, 1.5, 9.0]), 0.0)
    x, y = np.pi * 0.25, np.pi * 0.75
    np.testing.assert_allclose(velocity, [3 * np.sin(x) * np.cos(y), -3 * np.cos(x) * np.sin(y), 0])


def test_abc_is_a_beltrami_flow():
    """Free of divergence, and its vorticity, by finite differences of the velocity, is 2π/box times itself."""
    flow, h = ABC(1.0, 0.7, -0.4, box=5.0), 1e-4
    difference = np.stack(
        [
            (flow.sample(POINTS + e, 0.0)[0] - flow.sample(POINTS - e, 0.0)[0]) / (2 * h)
            for e in h * np.eye(3)
        ],
        axis=-1,
    )
    np.testing.assert_allclose(np.trace(difference, axis1=-2, axis2=-1), 0, atol=1e-10)
    curl = np.stack([difference[..., (i + 2) % 3, (i + 1) % 3] for i in range(3)], -1) - np.stack(
        [difference[..., (i + 1) % 3, (i + 2) % 3] for i in range(3)], -1
    )
    np.testing.assert_allclose(curl, 2 * np.pi / 5 * flow.sample(POINTS, 0.0)[0], atol=1e-8)


def test_abc_is_the_initial_field_of_that_name():
    x = np.stack(np.meshgrid(*3 * [2 * np.pi * np.arange(8) / 8], indexing="ij"), -1)
    velocity, _ = ABC(1.0, 0.7, -0.4).sample(x, 0.0)
    np.testing.assert_allclose(
        abc(1.0, 0.7, -0.4).on_lattice((8, 8, 8)), np.moveaxis(velocity, -1, 0), atol=1e-14
    )


def test_bad_input_is_refused():
    with pytest.raises(ValueError, match="box must be positive"):
        ABC(box=-1.0)
    with pytest.raises(ValueError, match="allowed are velocity, rotation, gradient"):
        TaylorGreen(1.0, 1.0).sample(POINTS, 0.0, "strain")
    with pytest.raises(ValueError, match="width must be positive"):
        TaylorGreen(0.0, 1.0)
    with pytest.raises(ValueError, match="must be \\(3, 3\\) and \\(3,\\)"):
        LinearFlow(np.eye(2))


def test_sine_and_cosine():
    """Against the C library's, by NumPy: everywhere in a turn, at its quarters, far from zero."""
    random = np.random.default_rng(0)
    x = np.concatenate(
        [random.uniform(-1e6, 1e6, 20000), random.uniform(-9, 9, 20000), np.arange(-40, 41) * np.pi / 4]
    )
    sine, cosine = np.empty_like(x), np.empty_like(x)
    sine_cosine(x, sine, cosine)
    np.testing.assert_allclose(sine, np.sin(x), rtol=0, atol=2.5e-16)
    np.testing.assert_allclose(cosine, np.cos(x), rtol=0, atol=2.5e-16)
