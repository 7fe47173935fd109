"""Values of a periodic field on a grid of equal cells: between its nodes, and their derivatives at the nodes."""

import numpy as np
from numpy.typing import NDArray

from ..compiled import kernel, only_read, part

LAGRANGE = {"cubic": 4, "quintic": 6}  # nodes in each direction
WORDS = ("trilinear", *LAGRANGE)
BOUNDED = ("trilinear", "cubic")  # those for a field that is not periodic
LEAST_BOUNDED = 4  # values in each direction of such a field


@kernel
def trilinear(fields, points, out):
    """out (P, m) from fields (m, nx, ny, nz) at points (P, 3) in units of cells. Error O(h^2), continuous."""
    _, nx, ny, nz = fields.shape
    for p in range(points.shape[0]):
        x, y, z = points[p, 0], points[p, 1], points[p, 2]
        i, j, k = int(np.floor(x)), int(np.floor(y)), int(np.floor(z))
        a, b, c = x - i, y - j, z - k
        i0, j0, k0 = i % nx, j % ny, k % nz
        i1, j1, k1 = (i0 + 1) % nx, (j0 + 1) % ny, (k0 + 1) % nz
        for m in range(fields.shape[0]):
            f = fields[m]
            near = (f[i0, j0, k0] * (1 - c) + f[i0, j0, k1] * c) * (1 - b)
            near += (f[i0, j1, k0] * (1 - c) + f[i0, j1, k1] * c) * b
            far = (f[i1, j0, k0] * (1 - c) + f[i1, j0, k1] * c) * (1 - b)
            far += (f[i1, j1, k0] * (1 - c) + f[i1, j1, k1] * c) * b
            out[p, m] = near * (1 - a) + far * a


@part
def _nearest(x, count, weights, slopes, nodes):
    """The nearest of `count` periodic nodes around x, and Lagrange's weights of their values and slopes."""
    width = weights.shape[0]
    i = int(np.floor(x))
    below = width // 2 - 1
    s = x - i + below
    for q in range(width):
        weight, slope = 1.0, 0.0
        for r in range(width):
            if r != q:
                slope = (slope * (s - r) + weight) / (q - r)
                weight = weight * (s - r) / (q - r)
        weights[q], slopes[q] = weight, slope
        nodes[q] = (i - below + q) % count


@kernel
def lagrange(fields, points, width, out):
    """As `trilinear`, with Lagrange polynomials through the `width` nearest nodes in each direction: error
    O(h^width)."""
    weights, slopes = np.empty((3, width)), np.empty((3, width))
    nodes = np.empty((3, width), np.intp)
    for p in range(points.shape[0]):
        for d in range(3):
            _nearest(points[p, d], fields.shape[1 + d], weights[d], slopes[d], nodes[d])
        for m in range(fields.shape[0]):
            total = 0.0
            for i in range(width):
                for j in range(width):
                    row = fields[m, nodes[0, i], nodes[1, j]]
                    line = 0.0
                    for k in range(width):
                        line += weights[2, k] * row[nodes[2, k]]
                    total += weights[0, i] * weights[1, j] * line
            out[p, m] = total


def on_grid(word: str, fields: NDArray, points: NDArray) -> NDArray:
    """Interpolate fields (m, nx, ny, nz), nodes at 0, 1, 2, ..., at points (P, 3) in units of cells, which
    need not lie inside the box: (P, m)."""
    out = np.empty((len(points), len(fields)))
    if word == "trilinear":
        trilinear(only_read(fields), only_read(points), out)
    else:
        lagrange(only_read(fields), only_read(points), LAGRANGE[word], out)
    return out


@kernel
def _lagrange_slopes(fields, points, width, out):
    """out (P, m, 3): derivatives of the interpolant of `lagrange` in units of cells."""
    weights, slopes = np.empty((3, width)), np.empty((3, width))
    nodes = np.empty((3, width), np.intp)
    for p in range(points.shape[0]):
        for d in range(3):
            _nearest(points[p, d], fields.shape[1 + d], weights[d], slopes[d], nodes[d])
        for m in range(fields.shape[0]):
            dx = dy = dz = 0.0
            for i in range(width):
                for j in range(width):
                    row = fields[m, nodes[0, i], nodes[1, j]]
                    line = slope = 0.0
                    for k in range(width):
                        value = row[nodes[2, k]]
                        line += weights[2, k] * value
                        slope += slopes[2, k] * value
                    dx += slopes[0, i] * weights[1, j] * line
                    dy += weights[0, i] * slopes[1, j] * line
                    dz += weights[0, i] * weights[1, j] * slope
            out[p, m, 0], out[p, m, 1], out[p, m, 2] = dx, dy, dz


def lagrange_gradient(word: str, velocity: NDArray, points: NDArray, spacing: NDArray) -> NDArray:
    """du_i/dx_j (P, 3, 3) of the interpolant of a velocity (3, nx, ny, nz), points as in `on_grid`, by a word of
    `LAGRANGE`. One order below that of the velocity."""
    out = np.empty((len(points), 3, 3))
    _lagrange_slopes(only_read(velocity), only_read(points), LAGRANGE[word], out)
    return out / spacing


@kernel
def _add_difference(f, factor, out):
    """out += factor (f[i+1] - f[i-1]) in the middle one of three periodic directions."""
    before, n, after = f.shape
    for b in range(before):
        for i in range(n):
            for a in range(after):
                out[b, i, a] += factor * (f[b, (i + 1) % n, a] - f[b, (i - 1) % n, a])


def add_derivative(f: NDArray, axis: int, spacing: float, factor: float, out: NDArray) -> None:
    """out += factor df/dx_axis at the nodes, f and out (nx, ny, nz), contiguous, by central differences (as
    OpenFOAM's `Gauss linear`)."""
    shape = (int(np.prod(f.shape[:axis])), f.shape[axis], int(np.prod(f.shape[axis + 1 :])))
    _add_difference(only_read(f).reshape(shape), factor / (2 * spacing), out.reshape(shape))


def rotation(velocity: NDArray, spacing: NDArray) -> NDArray:
    """½∇×u (3, nx, ny, nz) at the nodes of a velocity (3, nx, ny, nz), by central differences."""
    out = np.zeros(velocity.shape)
    for c in range(3):
        d, e = (c + 1) % 3, (c + 2) % 3
        add_derivative(velocity[e], d, spacing[d], 0.5, out[c])
        add_derivative(velocity[d], e, spacing[e], -0.5, out[c])
    return out


def gradient(velocity: NDArray, spacing: NDArray) -> NDArray:
    """du_i/dx_j (9, nx, ny, nz), j fastest, at the nodes of a velocity (3, nx, ny, nz), by central differences."""
    out = np.zeros((3, 3, *velocity.shape[1:]))
    for i in range(3):
        for j in range(3):
            add_derivative(velocity[i], j, spacing[j], 1.0, out[i, j])
    return out.reshape(9, *velocity.shape[1:])


def extended(field: NDArray) -> NDArray:
    """A bounded field (m, nx, ny, nz) with one more value at each end, from the cubic through the four there: between
    its own values the periodic functions of this module then interpolate it, at the ends from one side."""
    for axis in (1, 2, 3):
        f = np.moveaxis(field, axis, 0)
        low = 4 * f[0] - 6 * f[1] + 4 * f[2] - f[3]
        high = 4 * f[-1] - 6 * f[-2] + 4 * f[-3] - f[-4]
        field = np.moveaxis(np.concatenate([low[None], f, high[None]]), 0, axis)
    return np.ascontiguousarray(field)
