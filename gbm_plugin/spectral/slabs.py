"""The operators on a CPU, plane by plane, so that physical space never leaves the cache.

A field is transformed along x first, for the stored (ky, kz) only. Then each plane goes to physical space in y and z,
is multiplied point by point, and comes back: three inverse and five forward transforms in a buffer that the
second-level cache holds. Modes beyond the truncation are neither transformed nor stored (`kernels.py`). The transforms
are our own (`transform.py`): they need no plan that depends on timings, so the same input gives the same bits in every
run, with any number of threads.
"""

from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor

import numpy as np

from gbm_plugin.flow import grid
from gbm_plugin.simd import blank
from gbm_plugin.spectral import kernels
from gbm_plugin.spectral.arrays import Arrays, Term
from gbm_plugin.spectral.kernels import FIELDS
from gbm_plugin.spectral.modes import Modes


class Slabs(Arrays):
    """`Arrays` with the costly operators replaced by threaded, fused, pruned ones."""

    def __init__(self, modes: Modes, viscosity: float, precision: str = "double", threads: int = 1):
        super().__init__(modes, viscosity, precision)
        if threads != int(threads) or threads < 1:
            raise ValueError(f"threads must be a positive number, got {threads}")
        self.threads = int(threads)
        self._pool = ThreadPoolExecutor(self.threads) if self.threads > 1 else None
        self._works = [kernels.work_space(modes, self.real) for _ in range(self.threads)]
        blocks = len(self._works[0].x)
        self._mixed = blank(modes.cells, FIELDS, len(modes.rows), blocks, 2, kind=self.real)
        self._k = [k.ravel().astype(self.real) for k in modes.k]

    def nonlinear(self, u, out, linear=0.0, want_speed=False):
        operands = (u, out, *self._k[:2], self.real.type(0.5 / self.modes.cells**3), self.real.type(linear))
        for work in self._works:
            work.speed[:] = 0
        self._columns(kernels.to_mixed, u, self._mixed)
        self._planes(kernels.multiply, self._mixed, want_speed)
        self._columns(kernels.slope, self._mixed, *operands)
        self.max_speed = max(float(w.speed.max()) for w in self._works) if want_speed else None

    def to_physical(self, modes, out=None):
        n, modes = self.modes.cells, np.ascontiguousarray(modes, self.complex)
        if out is None:  # in the order of flow.grid.for_sampling
            out = np.moveaxis(np.empty((n, n, n, len(modes)), self.real), -1, 0)
        for first in range(0, len(modes), FIELDS):
            self._columns(kernels.to_mixed, modes[first : first + FIELDS], self._mixed)
            self._planes(kernels.to_points, self._mixed, out[first : first + FIELDS])
        return out

    def to_modes(self, fields):
        out = np.empty((len(fields), *self.modes.shape), self.complex)
        factor = self.real.type(0.5 / self.modes.cells**3)
        for first in range(0, len(fields), FIELDS):
            self._planes(kernels.from_points, np.asarray(fields[first : first + FIELDS]), self._mixed)
            self._columns(kernels.from_mixed, self._mixed, out[first : first + FIELDS], factor)
        return out

    def at(self, word, fields, points, threads=1):
        return grid.on_grid(word, fields, points, threads)

    def loads(self, modes):
        out = self.zeros()
        self._share(len(out[0]), lambda _, *part: kernels.loads(modes, out, *self._k, *part))
        return out

    def combine(self, out: np.ndarray, terms: list[Term]) -> float:
        axes = [k.astype(float) ** 2 for k in self._k]
        axes[2] = np.repeat(axes[2], 2)  # real and imaginary part
        factors = [
            np.array(
                [(c if axis == 0 else 1) * np.exp(-self.viscosity * k2 * delay) for c, delay, _ in terms]
            )
            for axis, k2 in enumerate(axes)
        ]
        fx, fy, fz = (f.astype(self.real) for f in factors)
        arrays = tuple(array.view(self.real) for *_, array in terms)
        weights = np.repeat(self.modes.weights, 2)
        energy = np.empty(len(axes[0]))

        def part(_, start, stop):
            row = np.empty(fz.shape[1], self.real)
            kernels.combine(out.view(self.real), arrays, fx, fy, fz, weights, row, energy, start, stop)

        self._share(len(energy), part)
        mean = out[:, 0, 0, 0].astype(complex)
        return 0.5 * float(energy.sum() - (mean * mean.conj()).real.sum())

    def memory(self) -> int:
        """Bytes of the velocity, three slopes of the AB3 scheme and all work space."""
        state = 4 * 3 * np.prod(self.modes.shape) * self.complex.itemsize
        return int(
            state + self._mixed.nbytes + sum(w.x.nbytes + w.y.nbytes + w.lines.nbytes for w in self._works)
        )

    def _columns(self, kernel: Callable, *arguments) -> None:
        """The kernel for all ky."""
        self._share(len(self._k[1]), lambda *part: kernel(*arguments, *part))

    def _planes(self, kernel: Callable, *arguments) -> None:
        """The kernel for all planes."""
        self._share(self.modes.cells, lambda *part: kernel(*arguments, *part))

    def _share(self, count: int, step: Callable) -> None:
        """step(work, start, stop) over equal shares of range(count), one per thread."""
        bounds = np.linspace(0, count, self.threads + 1).astype(int).tolist()
        calls = list(zip(self._works, bounds[:-1], bounds[1:], strict=True))
        if self._pool is None:
            step(*calls[0])
        else:
            for future in [self._pool.submit(step, *call) for call in calls]:
                future.result()
