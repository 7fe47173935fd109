"""Values of a periodic field on a grid of equal cells: between its nodes, and their derivatives at the nodes."""

import numpy as np
from numpy.typing import NDArray

from ..compiled import kernel, only_read, part, part_of
from ..simd import LANES, blank, load, load_part, splat, store
from ..threads import in_shares

NODES = {"trilinear": 2, "cubic": 4, "quintic": 6}  # in each direction, of Lagrange's polynomials
WORDS = tuple(NODES)
BOUNDED = ("trilinear", "cubic")  # those for a field that is not periodic
LEAST_BOUNDED = 4  # values in each direction of such a field
COST = {"trilinear": 0.8, "cubic": 1.6, "quintic": 3.5}  # of a point, in steps of a bead


@part
def _around(x, count, polynomials, weights, places):
    """The nearest periodic nodes around x, as many as there are `_polynomials`, and the weights of their values in
    the value, weights[0], and in the slope, weights[1]."""
    width = polynomials.shape[0]
    node = np.floor(x)
    value, slope = load(polynomials, width - 1), splat(0.0)
    for power in range(width - 2, -1, -1):
        slope = value + (x - node) * slope
        value = load(polynomials, power) + (x - node) * value
    store(weights, 0, value)
    store(weights, 1, slope)
    place = (int(node) - (width // 2 - 1)) % count
    for q in range(width):
        places[q] = place
        place = place + 1 if place + 1 < count else 0


@part
def _row(nodes, at, count, end, line):
    """The first count numbers from a place on, in a line of so many that ends and begins again `end` numbers later."""
    row = load_part(nodes, at, 0, min(count, end))
    while end < count:
        at -= line
        row = row + load_part(nodes, at, max(end, 0), min(count, end + line))
        end += line
    return row


@kernel(fastmath={"contract"})
def _interpolate(share, shares, nodes, points, first, spacing, polynomials, weight, out, extra):
    """Of `add_on_grid`, nodes (nx, ny, nz, m). All that the nodes side by side along z hold is one row of lanes: the
    sums over x and y are taken first, for all of it at once."""
    nx, ny, nz, fields = nodes.shape
    width, others = polynomials.shape[0], min(fields - 3, extra.shape[1])
    columns = 0 if others else extra.shape[1]
    length, line = width * fields, nz * fields
    places, weights = np.empty((3, width), np.intp), np.empty((3, 2, LANES))
    px, py, pz = places[0], places[1], places[2]
    wx, wy, wz = weights[0], weights[1], weights[2]
    rows = np.empty((3, -(-length // LANES), LANES))  # values, and slopes along x and y
    values, slopes_x, slopes_y = rows[0], rows[1], rows[2]
    value, slope_x, slope_y = values.reshape(-1), slopes_x.reshape(-1), slopes_y.reshape(-1)
    of_x, of_y, of_z = weight / spacing[0], weight / spacing[1], weight / spacing[2]
    begin, end = part_of(share, shares, points.shape[0])
    for p in range(begin, end):
        _around((points[p, 0] - first[0]) / spacing[0], nx, polynomials, wx, px)
        _around((points[p, 1] - first[1]) / spacing[1], ny, polynomials, wy, py)
        _around((points[p, 2] - first[2]) / spacing[2], nz, polynomials, wz, pz)
        for n in range(values.shape[0]):
            start = pz[0] * fields + n * LANES
            v = dx = dy = splat(0.0)
            for i in range(width):
                plane = slope = splat(0.0)
                for j in range(width):
                    at = (px[i] * ny + py[j]) * line + start
                    row = _row(nodes, at, length - n * LANES, line - start, line)
                    plane = plane + wy[0, j] * row
                    if columns:
                        slope = slope + wy[1, j] * row
                v = v + wx[0, i] * plane
                if columns:
                    dx = dx + wx[1, i] * plane
                    dy = dy + wx[0, i] * slope
            store(values, n, v)
            if columns:
                store(slopes_x, n, dx)
                store(slopes_y, n, dy)
        x = y = z = 0.0
        for k in range(width):
            w, m = wz[0, k], k * fields
            x, y, z = x + w * value[m], y + w * value[m + 1], z + w * value[m + 2]
        out[p, 0] += weight * x
        out[p, 1] += weight * y
        out[p, 2] += weight * z
        for c in range(others):
            x = 0.0
            for k in range(width):
                x += wz[0, k] * value[k * fields + 3 + c]
            extra[p, c] += weight * x
        if columns:
            xx = xy = xz = yx = yy = yz = zx = zy = zz = 0.0
            for k in range(width):
                w, s, m = wz[0, k], wz[1, k], 3 * k
                xx, yx, zx = xx + w * slope_x[m], yx + w * slope_x[m + 1], zx + w * slope_x[m + 2]
                xy, yy, zy = xy + w * slope_y[m], yy + w * slope_y[m + 1], zy + w * slope_y[m + 2]
                xz, yz, zz = xz + s * value[m], yz + s * value[m + 1], zz + s * value[m + 2]
            g = (
                of_x * xx,
                of_y * xy,
                of_z * xz,
                of_x * yx,
                of_y * yy,
                of_z * yz,
                of_x * zx,
                of_y * zy,
                of_z * zz,
            )
            if columns == 3:
                extra[p, 0] += 0.5 * (g[7] - g[5])
                extra[p, 1] += 0.5 * (g[2] - g[6])
                extra[p, 2] += 0.5 * (g[3] - g[1])
            else:
                for c in range(9):
                    extra[p, c] += g[c]


def nodes_of(word: str) -> int:
    """How many nodes in each direction a word takes."""
    return NODES[word]


def _polynomials(word: str) -> NDArray:
    """Lagrange's polynomials of the nodes of a word, in the distance from the one before the point: (power, node)."""
    nodes = np.arange(NODES[word]) - (NODES[word] // 2 - 1)
    table = blank(len(nodes))
    for q, node in enumerate(nodes):
        others = nodes[nodes != node]
        table[:, q] = np.poly(others)[::-1] / np.prod(node - others)
    return table


def for_sampling(fields: NDArray) -> NDArray:
    """The fields (m, nx, ny, nz) with all values of a node side by side in memory, where `on_grid` finds them with
    least waiting; it takes others too, and then copies them in each call."""
    return np.moveaxis(np.ascontiguousarray(np.moveaxis(fields, 0, -1)), -1, 0)


def add_on_grid(
    word: str,
    weight: float,
    fields: NDArray,
    points: NDArray,
    lattice: tuple[NDArray, NDArray],
    out: NDArray,
    extra: NDArray | None = None,
    threads: int | None = None,
) -> None:
    """out (P, 3) += weight times the interpolants of the first three fields (m, nx, ny, nz), best in the order of
    `for_sampling`, at points (P, 3), which need not lie inside the box; with an error O(h^n) of n nodes in each
    direction. extra += weight times those of the other fields, (P, m - 3), or where there are none times rotation
    (P, 3) or gradient (P, 9), du_i/dx_j, of the interpolant of the three, one order below its own; (P, 0): neither.

    lattice: where the first node sits, and the distances of nodes, (3,) each. threads: at most so many; None: all.
    """
    nodes = only_read(np.moveaxis(fields, 0, -1))
    extra = np.empty((len(points), 0)) if extra is None else extra
    own = (nodes, only_read(points), *lattice, _polynomials(word), float(weight), out, extra)
    in_shares(_interpolate, COST[word] * len(points), *own, most=threads)


def on_grid(word: str, fields: NDArray, points: NDArray, threads: int | None = None) -> NDArray:
    """Three fields as by add_on_grid, at points in units of cells from the first node: (P, 3)."""
    out = np.zeros((len(points), 3))
    add_on_grid(word, 1.0, fields, points, (np.zeros(3), np.ones(3)), out, threads=threads)
    return out


@kernel
def _spread(share, shares, values, points, polynomials, nodes):
    """The transpose of `_interpolate`: nodes += values (P, m) by the weights of their points, in this share's layers
    of nodes. Each takes the points in their order: the sums do not depend on the number of shares."""
    nx, ny, nz, fields = nodes.shape
    first, last = part_of(share, shares, nx)
    width = polynomials.shape[0]
    places, weights = np.empty((3, width), np.intp), np.empty((3, 2, LANES))
    px, py, pz = places[0], places[1], places[2]
    wx, wy, wz = weights[0], weights[1], weights[2]
    for p in range(points.shape[0]):
        _around(points[p, 0], nx, polynomials, wx, px)
        _around(points[p, 1], ny, polynomials, wy, py)
        _around(points[p, 2], nz, polynomials, wz, pz)
        for i in range(width):
            if px[i] < first or px[i] >= last:
                continue
            for j in range(width):
                row, plane = nodes[px[i], py[j]], wx[0, i] * wy[0, j]
                for k in range(width):
                    node, weight = row[pz[k]], plane * wz[0, k]
                    for m in range(0, fields, 3):
                        for q in range(3):  # a constant length, which the compiler unrolls
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
    own = (only_read(values), only_read(points), _polynomials(word), nodes)
    in_shares(_spread, COST[word] * len(points), *own, most=threads)
    return np.moveaxis(nodes, -1, 0)


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
