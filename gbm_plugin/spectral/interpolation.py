"""Values of a periodic field between its nodes x_i = i box/n: trilinear, cubic, quintic, or the Fourier sum."""

import finufft
import numpy as np
from numpy.typing import NDArray

from ..flow import grid

WORDS = (*grid.WORDS, "exact")


def on_grid(word: str, fields: NDArray, positions: NDArray, box: float) -> NDArray:
    """Interpolate fields (m, n, n, n) at positions (P, 3), which need not lie inside the box: (P, m)."""
    return grid.on_grid(word, fields, positions * (fields.shape[1] / box))


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
