"""Values of a periodic field on a grid of equal cells: between its nodes, and their derivatives at the nodes."""

import numpy as np
from numba import njit
from numpy.typing import NDArray

WORDS = ("trilinear", "cubic")


@njit(nogil=True, cache=True)
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


@njit(nogil=True, cache=True)
def cubic(fields, points, out):
    """As `trilinear`, with Lagrange cubics through the four nearest nodes in each direction. Error O(h^4)."""
    weights = np.empty((3, 4))
    nodes = np.empty((3, 4), np.intp)
    for p in range(points.shape[0]):
        for d in range(3):
            x = points[p, d]
            i = int(np.floor(x))
            s = x - i
            weights[d, 0] = -s * (s - 1) * (s - 2) / 6
            weights[d, 1] = (s + 1) * (s - 1) * (s - 2) / 2
            weights[d, 2] = -(s + 1) * s * (s - 2) / 2
            weights[d, 3] = (s + 1) * s * (s - 1) / 6
            for q in range(4):
                nodes[d, q] = (i - 1 + q) % fields.shape[1 + d]
        for m in range(fields.shape[0]):
            total = 0.0
            for i in range(4):
                for j in range(4):
                    row = fields[m, nodes[0, i], nodes[1, j]]
                    line = 0.0
                    for k in range(4):
                        line += weights[2, k] * row[nodes[2, k]]
                    total += weights[0, i] * weights[1, j] * line
            out[p, m] = total


def on_grid(word: str, fields: NDArray, points: NDArray) -> NDArray:
    """Interpolate fields (m, nx, ny, nz), nodes at 0, 1, 2, ..., at points (P, 3) in units of cells, which
    need not lie inside the box: (P, m)."""
    out = np.empty((len(points), len(fields)))
    {"trilinear": trilinear, "cubic": cubic}[word](fields, points, out)
    return out


@njit(nogil=True, cache=True)
def _add_difference(f, near, far, out):
    """out += near (f[i+1] - f[i-1]) + far (f[i+2] - f[i-2]) in the middle one of three periodic directions."""
    before, n, after = f.shape
    for b in range(before):
        for i in range(n):
            for a in range(after):
                value = near * (f[b, (i + 1) % n, a] - f[b, (i - 1) % n, a])
                if far != 0:
                    value += far * (f[b, (i + 2) % n, a] - f[b, (i - 2) % n, a])
                out[b, i, a] += value


def add_derivative(word: str, f: NDArray, axis: int, spacing: float, factor: float, out: NDArray) -> None:
    """out += factor df/dx_axis at the nodes, f and out (nx, ny, nz), contiguous: by central differences of the
    order of the interpolation `word`, second (as OpenFOAM's `Gauss linear`) or fourth."""
    near, far = {"trilinear": (1 / 2, 0.0), "cubic": (8 / 12, -1 / 12)}[word]
    shape = (int(np.prod(f.shape[:axis])), f.shape[axis], int(np.prod(f.shape[axis + 1 :])))
    _add_difference(f.reshape(shape), near * factor / spacing, far * factor / spacing, out.reshape(shape))


def rotation(word: str, velocity: NDArray, spacing: NDArray) -> NDArray:
    """½∇×u (3, nx, ny, nz) at the nodes of a velocity (3, nx, ny, nz)."""
    out = np.zeros(velocity.shape)
    for c in range(3):
        d, e = (c + 1) % 3, (c + 2) % 3
        add_derivative(word, velocity[e], d, spacing[d], 0.5, out[c])
        add_derivative(word, velocity[d], e, spacing[e], -0.5, out[c])
    return out


def gradient(word: str, velocity: NDArray, spacing: NDArray) -> NDArray:
    """du_i/dx_j (9, nx, ny, nz), j fastest, at the nodes of a velocity (3, nx, ny, nz)."""
    out = np.zeros((3, 3, *velocity.shape[1:]))
    for i in range(3):
        for j in range(3):
            add_derivative(word, velocity[i], j, spacing[j], 1.0, out[i, j])
    return out.reshape(9, *velocity.shape[1:])
