"""Interpolation on a grid, against the definition of Lagrange's polynomials in NumPy."""

import numpy as np
import pytest

from gbm_plugin.flow import grid

RNG = np.random.default_rng(3)
CELLS = (5, 3, 4)  # fewer than quintic takes: its nodes go round the box more than once
FIRST, SPACING = np.array([0.3, -1.0, 2.0]), np.array([0.5, 0.25, 2.0])


def lagrange(nodes, x):
    """Values and slopes at x of the polynomials that are 1 at their own node and 0 at the others."""
    others = [nodes[nodes != own] for own in nodes]
    scales = [np.prod(own - rest) for own, rest in zip(nodes, others, strict=True)]
    values = [np.prod(x - rest) / scale for rest, scale in zip(others, scales, strict=True)]
    slopes = [
        sum(np.prod(x - rest[rest != one]) for one in rest) / scale
        for rest, scale in zip(others, scales, strict=True)
    ]
    return np.array(values), np.array(slopes)


def interpolated(word, fields, point):
    """Fields (m,) and their gradient (m, 3) at a point."""
    count, around = grid.NODES[word], []
    for x, first, spacing, cells in zip(point, FIRST, SPACING, CELLS, strict=True):
        s = (x - first) / spacing
        nodes = np.floor(s) + np.arange(count) - (count // 2 - 1)
        values, slopes = lagrange(nodes, s)
        around.append((nodes.astype(int) % cells, values, slopes / spacing))
    (i, x, dx), (j, y, dy), (k, z, dz) = around
    near = fields[:, i][:, :, j][:, :, :, k].astype(float)
    sums = [np.einsum("mijk,i,j,k->m", near, *w) for w in ((x, y, z), (dx, y, z), (x, dy, z), (x, y, dz))]
    return sums[0], np.stack(sums[1:], axis=-1)


@pytest.mark.parametrize("precision", [float, np.float32])
@pytest.mark.parametrize("word", grid.WORDS)
def test_against_the_definition(word, precision):
    fields = grid.for_sampling(RNG.standard_normal((3, *CELLS)).astype(precision))
    points = np.concatenate(
        [8 * RNG.standard_normal((200, 3)), FIRST + SPACING * RNG.integers(-9, 9, (20, 3))]
    )
    out, gradient, turned, rotation = (
        np.zeros((220, 3)),
        np.zeros((220, 9)),
        np.zeros((220, 3)),
        np.zeros((220, 3)),
    )
    for weight in (0.25, 0.75):
        grid.add_on_grid(word, weight, fields, points, (FIRST, SPACING), out, gradient)
        grid.add_on_grid(word, weight, fields, points, (FIRST, SPACING), turned, rotation)
    values, g = zip(*(interpolated(word, fields, point) for point in points), strict=True)
    np.testing.assert_allclose(out, values, rtol=0, atol=1e-12)
    np.testing.assert_allclose(turned, out, rtol=0, atol=0)
    np.testing.assert_allclose(gradient.reshape(-1, 3, 3), g, rtol=0, atol=1e-11)
    x, y, z = (np.array(g)[:, a, b] - np.array(g)[:, b, a] for a, b in ((2, 1), (0, 2), (1, 0)))
    np.testing.assert_allclose(rotation, 0.5 * np.stack([x, y, z], axis=-1), rtol=0, atol=1e-11)


def test_more_fields_than_three_go_beside_them():
    fields = grid.for_sampling(RNG.standard_normal((12, *CELLS)))
    points = 8 * RNG.standard_normal((50, 3))
    for columns in (0, 3, 9):
        out, extra = np.zeros((50, 3)), np.zeros((50, columns))
        grid.add_on_grid("trilinear", 1.0, fields, points, (FIRST, SPACING), out, extra)
        values = np.array([interpolated("trilinear", fields, point)[0] for point in points])
        np.testing.assert_allclose(out, values[:, :3], rtol=0, atol=1e-12)
        np.testing.assert_allclose(extra, values[:, 3 : 3 + columns], rtol=0, atol=1e-12)


@pytest.mark.parametrize("word", grid.WORDS)
def test_spreading_is_the_transpose(word):
    fields = grid.for_sampling(RNG.standard_normal((3, *CELLS)))
    points, values = 8 * RNG.standard_normal((100, 3)), RNG.standard_normal((100, 3))
    spread = grid.spread(word, values, points, CELLS)
    there, back = (fields * spread).sum(), (values * grid.on_grid(word, fields, points)).sum()
    assert there == pytest.approx(back, rel=1e-12)


def test_only_nodes_that_are_taken_count():
    """A value that is not finite spoils its own neighbourhood, and nothing beside it in memory."""
    fields = grid.for_sampling(np.ones((3, 16, 16, 16)))
    fields[:, :, :, 8] = np.nan
    points = np.stack(np.broadcast_arrays(3.5, 3.5, np.arange(0.5, 16)), axis=-1)
    for word, count in grid.NODES.items():
        bad = np.isnan(grid.on_grid(word, fields, points)).all(axis=1)
        assert list(np.flatnonzero(bad)) == list(range(8 - count // 2, 8 + count // 2))
