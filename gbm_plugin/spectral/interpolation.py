"""Values of a periodic field between its nodes x_i = i box/n: trilinear, cubic, or the Fourier sum."""

import finufft
import numpy as np
from numba import njit
from numpy.typing import NDArray

WORDS = ("trilinear", "cubic", "exact")


@njit(nogil=True, cache=True)
def trilinear(fields, positions, per_node, out):
    """out (P, m) from fields (m, n, n, n) at positions (P, 3); per_node = n/box. Error O(h^2), continuous."""
    n = fields.shape[1]
    for p in range(positions.shape[0]):
        x, y, z = positions[p, 0] * per_node, positions[p, 1] * per_node, positions[p, 2] * per_node
        i, j, k = int(np.floor(x)), int(np.floor(y)), int(np.floor(z))
        a, b, c = x - i, y - j, z - k
        i0, j0, k0 = i % n, j % n, k % n
        i1, j1, k1 = (i0 + 1) % n, (j0 + 1) % n, (k0 + 1) % n
        for m in range(fields.shape[0]):
            f = fields[m]
            near = (f[i0, j0, k0] * (1 - c) + f[i0, j0, k1] * c) * (1 - b)
            near += (f[i0, j1, k0] * (1 - c) + f[i0, j1, k1] * c) * b
            far = (f[i1, j0, k0] * (1 - c) + f[i1, j0, k1] * c) * (1 - b)
            far += (f[i1, j1, k0] * (1 - c) + f[i1, j1, k1] * c) * b
            out[p, m] = near * (1 - a) + far * a


@njit(nogil=True, cache=True)
def cubic(fields, positions, per_node, out):
    """As `trilinear`, with Lagrange cubics through the four nearest nodes in each direction. Error O(h^4)."""
    n = fields.shape[1]
    weights = np.empty((3, 4))
    nodes = np.empty((3, 4), np.intp)
    for p in range(positions.shape[0]):
        for d in range(3):
            x = positions[p, d] * per_node
            i = int(np.floor(x))
            s = x - i
            weights[d, 0] = -s * (s - 1) * (s - 2) / 6
            weights[d, 1] = (s + 1) * (s - 1) * (s - 2) / 2
            weights[d, 2] = -(s + 1) * s * (s - 2) / 2
            weights[d, 3] = (s + 1) * s * (s - 1) / 6
            for q in range(4):
                nodes[d, q] = (i - 1 + q) % n
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


def on_grid(word: str, fields: NDArray, positions: NDArray, box: float) -> NDArray:
    """Interpolate fields (m, n, n, n) at positions (P, 3), which need not lie inside the box: (P, m)."""
    out = np.empty((len(positions), len(fields)))
    kernel = {"trilinear": trilinear, "cubic": cubic}[word]
    kernel(fields, positions, fields.shape[1] / box, out)
    return out


def fourier_sum(modes: NDArray, positions: NDArray, box: float, threads: int = 1) -> NDArray:
    """The fields with modes (m, 2K+1, 2K+1, K+1) at positions (P, 3), (P, m), by non-uniform FFT to 1e-14."""
    half = modes.shape[3]
    # a real field is the real part of its modes kz = 0 and twice those above
    full = np.zeros((*modes.shape[:3], 2 * half - 1), complex)
    full[..., :half] = modes
    full[..., 1:half] *= 2
    x, y, z = np.ascontiguousarray((positions % box).T) * (2 * np.pi / box)
    values = finufft.nufft3d2(x, y, z, full, isign=1, eps=1e-14, modeord=1, nthreads=threads)
    return np.ascontiguousarray(np.atleast_2d(values).real.T)
