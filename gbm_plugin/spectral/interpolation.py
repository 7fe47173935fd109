"""Values of a periodic field between its nodes x_i = i box/n: trilinear, cubic, quintic, or the Fourier sum."""

import finufft
import numpy as np
from numpy.typing import NDArray

from ..flow import grid

WORDS = (*grid.WORDS, "exact")


def spread_on_grid(
    word: str,
    values: NDArray,
    positions: NDArray,
    box: float,
    cells: int,
    threads: int = 1,
    out: NDArray | None = None,
) -> NDArray:
    """Densities (m, n, n, n) of point values (P, m) by the transpose of `flow.grid.on_grid`; out as in its `spread`."""
    scale = cells / box
    return grid.spread(word, values * scale**3, positions * scale, (cells, cells, cells), threads, out)


def fourier_spread(values: NDArray, positions: NDArray, box: float, cut: int, threads: int = 1) -> NDArray:
    """Modes (m, 2K+1, 2K+1, K+1) of the densities of point values (P, m), the transpose of `fourier_sum`."""
    x, y, z = np.ascontiguousarray((positions % box).T) * (2 * np.pi / box)
    strengths = np.ascontiguousarray(values.T, dtype=complex)
    size = (2 * cut + 1,) * 3
    modes = finufft.nufft3d1(x, y, z, strengths, size, isign=-1, eps=1e-14, modeord=1, nthreads=threads)
    return modes.reshape(-1, *size)[..., : cut + 1] / box**3


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
