"""Values of a periodic field on a grid of equal cells: between its nodes, and their derivatives at the nodes."""

import numpy as np
from numpy.typing import NDArray

from ..compiled import kernel, only_read, part, part_of
from ..threads import in_shares

LAGRANGE = {"cubic": 4, "quintic": 6}  # nodes in each direction
WORDS = ("trilinear", *LAGRANGE)
BOUNDED = ("trilinear", "cubic")  # those for a field that is not periodic
LEAST_BOUNDED = 4  # values in each direction of such a field
COST = {"trilinear": 0.3, "cubic": 3.0, "quintic": 10.0}  # of a point, in steps of a bead


@kernel
def trilinear(share, shares, nodes, points, out):
    """out (P, m) from nodes (nx, ny, nz, m) at points (P, 3) in units of cells. Error O(h^2), continuous."""
    nx, ny, nz, fields = nodes.shape
    first, last = part_of(share, shares, points.shape[0])
    for p in range(first, last):
        x, y, z = points[p, 0], points[p, 1], points[p, 2]
        i, j, k = int(np.floor(x)), int(np.floor(y)), int(np.floor(z))
        a, b, c = x - i, y - j, z - k
        i0, j0, k0 = i % nx, j % ny, k % nz
        i1, j1, k1 = (i0 + 1) % nx, (j0 + 1) % ny, (k0 + 1) % nz
        for m in range(fields):
            near = (nodes[i0, j0, k0, m] * (1 - c) + nodes[i0, j0, k1, m] * c) * (1 - b)
            near += (nodes[i0, j1, k0, m] * (1 - c) + nodes[i0, j1, k1, m] * c) * b
            far = (nodes[i1, j0, k0, m] * (1 - c) + nodes[i1, j0, k1, m] * c) * (1 - b)
            far += (nodes[i1, j1, k0, m] * (1 - c) + nodes[i1, j1, k1, m] * c) * b
            out[p, m] = near * (1 - a) + far * a


@part
def _nearest(x, count, scale, weights, places):
    """The nearest periodic nodes around x, and Lagrange's weights of their values; scale: `_scale` of their number."""
    width = scale.size
    below = width // 2 - 1
    i = int(np.floor(x))
    s = x - i + below
    left = right = 1.0
    for q in range(width):
        weights[q] = scale[q] * left
        left *= s - q
    for q in range(width - 1, -1, -1):
        weights[q] *= right
        right *= s - q
    place = (i - below) % count
    for q in range(width):
        places[q] = place
        place = place + 1 if place + 1 < count else 0


@part
def _slopes(x, slopes, scale):
    """Lagrange's weights of the slope at x, for the nodes of `_nearest`."""
    width = scale.size
    s = x - np.floor(x) + width // 2 - 1
    for q in range(width):
        weight, slope = 1.0, 0.0
        for r in range(width):
            if r != q:
                slope = slope * (s - r) + weight
                weight = weight * (s - r)
        slopes[q] = slope * scale[q]


@kernel
def lagrange(share, shares, nodes, points, scale, out):
    """As `trilinear`, for m = 3, 6, ..., with Lagrange polynomials through the nearest nodes in each direction, as
    many as `scale` has: error O(h^width)."""
    nx, ny, nz, fields = nodes.shape
    width = scale.size
    weights, places = np.empty((3, width)), np.empty((3, width), np.intp)
    first, last = part_of(share, shares, points.shape[0])
    for p in range(first, last):
        _nearest(points[p, 0], nx, scale, weights[0], places[0])
        _nearest(points[p, 1], ny, scale, weights[1], places[1])
        _nearest(points[p, 2], nz, scale, weights[2], places[2])
        for m in range(0, fields, 3):
            a = b = c = 0.0
            for i in range(width):
                for j in range(width):
                    row = nodes[places[0, i], places[1, j]]
                    x = y = z = 0.0
                    for k in range(width):
                        node, weight = row[places[2, k]], weights[2, k]
                        x += weight * node[m]
                        y += weight * node[m + 1]
                        z += weight * node[m + 2]
                    weight = weights[0, i] * weights[1, j]
                    a += weight * x
                    b += weight * y
                    c += weight * z
            out[p, m], out[p, m + 1], out[p, m + 2] = a, b, c


def nodes_of(word: str) -> int:
    """How many nodes in each direction a word takes."""
    return LAGRANGE.get(word, 2)


def _scale(word: str) -> NDArray:
    """1/prod_{r != q} (q - r) of the nodes q = 0, 1, ... of a word of `LAGRANGE`."""
    nodes = np.arange(LAGRANGE[word])
    return np.array([1 / np.prod([q - r for r in nodes if r != q]) for q in nodes])


def for_sampling(fields: NDArray) -> NDArray:
    """The fields (m, nx, ny, nz) with all values of a node side by side in memory, where `on_grid` finds them with
    least waiting; it takes others too, and then copies them in each call."""
    return np.moveaxis(np.ascontiguousarray(np.moveaxis(fields, 0, -1)), -1, 0)


def on_grid(word: str, fields: NDArray, points: NDArray, threads: int | None = None) -> NDArray:
    """Interpolate fields (m, nx, ny, nz), best in the order of `for_sampling`, nodes at 0, 1, 2, ..., at points (P, 3)
    in units of cells, which need not lie inside the box: (P, m). m is a multiple of 3, or the word is trilinear.
    threads: at most so many; None: all."""
    work = COST[word] * len(points)
    out, nodes = np.empty((len(points), len(fields))), only_read(np.moveaxis(fields, 0, -1))
    if word == "trilinear":
        in_shares(trilinear, work, nodes, only_read(points), out, most=threads)
    else:
        in_shares(lagrange, work, nodes, only_read(points), _scale(word), out, most=threads)
    return out


@kernel
def _spread_trilinear(share, shares, values, points, nodes):
    """The transpose of `trilinear`: nodes += values (P, m) by the weights of their points, in this share's layers of
    nodes. Each takes the points in their order: the sums do not depend on the number of shares."""
    nx, ny, nz, fields = nodes.shape
    first, last = part_of(share, shares, nx)
    for p in range(points.shape[0]):
        x, y, z = points[p, 0], points[p, 1], points[p, 2]
        i, j, k = int(np.floor(x)), int(np.floor(y)), int(np.floor(z))
        a, b, c = x - i, y - j, z - k
        i0, j0, k0 = i % nx, j % ny, k % nz
        i1, j1, k1 = (i0 + 1) % nx, (j0 + 1) % ny, (k0 + 1) % nz
        for ix, wx in ((i0, 1 - a), (i1, a)):
            if ix < first or ix >= last:
                continue
            for jy, wy in ((j0, 1 - b), (j1, b)):
                near, far = nodes[ix, jy, k0], nodes[ix, jy, k1]
                plane = wx * wy
                for m in range(0, fields, 3):  # a constant length, which the compiler unrolls
                    for q in range(3):
                        value = plane * values[p, m + q]
                        near[m + q] += value * (1 - c)
                        far[m + q] += value * c


@kernel
def _spread_lagrange(share, shares, values, points, scale, nodes):
    """The transpose of `lagrange`, as above."""
    nx, ny, nz, fields = nodes.shape
    first, last = part_of(share, shares, nx)
    width = scale.size
    weights, places = np.empty((3, width)), np.empty((3, width), np.intp)
    for p in range(points.shape[0]):
        _nearest(points[p, 0], nx, scale, weights[0], places[0])
        _nearest(points[p, 1], ny, scale, weights[1], places[1])
        _nearest(points[p, 2], nz, scale, weights[2], places[2])
        for i in range(width):
            if places[0, i] < first or places[0, i] >= last:
                continue
            for j in range(width):
                row, plane = nodes[places[0, i], places[1, j]], weights[0, i] * weights[1, j]
                for k in range(width):
                    node, weight = row[places[2, k]], plane * weights[2, k]
                    for m in range(0, fields, 3):
                        for q in range(3):
                            node[m + q] += weight * values[p, m + q]


def spread(
    word: str,
    values: NDArray,
    points: NDArray,
    cells: tuple[int, int, int],
    threads: int | None = None,
    out: NDArray | None = None,
) -> NDArray:
    """Fields (m, *cells) of values (P, m), m = 3, 6, ..., at points, by the transpose of `on_grid`: for all fields g,
    sum of (fields g) = sum of values times on_grid(word, g, points). In the order of `for_sampling`, as `out` must be,
    where it is given to be written; added up in the order of the points."""
    nodes = np.empty((*cells, values.shape[1])) if out is None else np.moveaxis(out, 0, -1)
    nodes[:] = 0
    work = COST[word] * len(points)
    if word == "trilinear":
        in_shares(_spread_trilinear, work, only_read(values), only_read(points), nodes, most=threads)
    else:
        own = (only_read(values), only_read(points), _scale(word))
        in_shares(_spread_lagrange, work, *own, nodes, most=threads)
    return np.moveaxis(nodes, -1, 0)


@kernel
def _lagrange_slopes(share, shares, nodes, points, scale, out):
    """out (P, m, 3): derivatives of the interpolant of `lagrange` in units of cells."""
    width = scale.size
    weights, slopes = np.empty((3, width)), np.empty((3, width))
    places = np.empty((3, width), np.intp)
    first, last = part_of(share, shares, points.shape[0])
    for p in range(first, last):
        for d in range(3):
            _nearest(points[p, d], nodes.shape[d], scale, weights[d], places[d])
            _slopes(points[p, d], slopes[d], scale)
        for m in range(nodes.shape[3]):
            dx = dy = dz = 0.0
            for i in range(width):
                for j in range(width):
                    row = nodes[places[0, i], places[1, j]]
                    line = slope = 0.0
                    for k in range(width):
                        value = row[places[2, k], m]
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
    nodes = only_read(np.moveaxis(velocity, 0, -1))
    in_shares(_lagrange_slopes, 2 * COST[word] * len(points), nodes, only_read(points), _scale(word), out)
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
