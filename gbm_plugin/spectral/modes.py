"""The Fourier modes that a 2/3-truncated real field keeps, and where they lie.

A field of n points per edge keeps |k_i| <= K = (n - 1)//3 in units of k0 = 2 pi/box: 3 K < n, so a product
of two such fields, transformed on n points, is free of aliasing in every mode that is kept. Only these modes
are stored, 8/27 of all of them: coefficients c(kx, ky, kz), shape (2K+1, 2K+1, K+1), kx and ky in the order
0 ... K, -K ... -1 and kz from 0 to K; the rest follows from c(-k) = conj c(k).
"""

from functools import cached_property

import numpy as np
from numpy.typing import NDArray


class Modes:
    """Truncated mode set of a periodic cube with `cells` points per edge (even, at least 4)."""

    def __init__(self, cells: int, box: float):
        if cells != int(cells) or cells < 4 or cells % 2:
            raise ValueError(f"cells must be an even number of at least 4, got {cells}")
        if not 0 < box < np.inf:
            raise ValueError(f"box must be a positive length, got {box}")
        self.cells = int(cells)
        self.box = float(box)
        self.cut = (self.cells - 1) // 3
        self.k0 = 2 * np.pi / self.box
        self.signed = np.concatenate([np.arange(self.cut + 1), np.arange(-self.cut, 0)])
        self.shape = (2 * self.cut + 1, 2 * self.cut + 1, self.cut + 1)

    @cached_property
    def k(self) -> list[NDArray]:
        """Wavenumbers, shaped to broadcast against a coefficient array."""
        counts = (self.signed, self.signed, np.arange(self.cut + 1))
        return [self.k0 * c.reshape(np.roll((-1, 1, 1), axis)) for axis, c in enumerate(counts)]

    @cached_property
    def k_squared(self) -> NDArray:
        """|k|^2, shape `shape`."""
        return self.k[0] ** 2 + self.k[1] ** 2 + self.k[2] ** 2

    @cached_property
    def weights(self) -> NDArray:
        """How often each kz counts in a sum over all modes: once for kz = 0, twice above."""
        return np.where(np.arange(self.cut + 1) == 0, 1.0, 2.0)

    @property
    def rows(self) -> NDArray:
        """Where the stored kx (or ky) lie among the n frequencies of a full transform."""
        return self.signed % self.cells

    def blocks(self) -> list[tuple[tuple[slice, slice], tuple[slice, slice]]]:
        """Pairs (stored, full) of index pairs along kx, ky: the four corners that truncation leaves."""
        stored = (slice(0, self.cut + 1), slice(self.cut + 1, None))
        full = (slice(0, self.cut + 1), slice(self.cells - self.cut, None))
        return [((stored[i], stored[j]), (full[i], full[j])) for i in (0, 1) for j in (0, 1)]
