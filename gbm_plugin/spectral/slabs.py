"""The operators on a CPU, plane by plane, so that physical space never leaves the cache.

A field is transformed along x first, for the stored (ky, kz) only. Then plane pairs (x, x + 1), as the real
and the imaginary part of one complex plane, go to physical space in y and z, are multiplied point by point,
and come back: three inverse and five forward transforms in a buffer of a few hundred kilobytes. Modes beyond
the truncation are neither transformed nor stored. Complex transforms of two real planes cost less than real
ones (FFTW's real codelets are not vectorised), and FFTW's estimated plans are as fast here as measured ones:
a plan does not depend on timings, so the same input gives the same bits in every run, with any number of
threads.
"""

from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pyfftw

from gbm_plugin.flow import grid
from gbm_plugin.spectral import kernels
from gbm_plugin.spectral.arrays import Arrays, Term
from gbm_plugin.spectral.modes import Modes

BLOCK = 1 << 20  # bytes of a buffer that one thread works on


class Slabs(Arrays):
    """`Arrays` with the costly operators replaced by threaded, fused, pruned ones."""

    def __init__(self, modes: Modes, viscosity: float, precision: str = "double", threads: int = 1):
        super().__init__(modes, viscosity, precision)
        if threads != int(threads) or threads < 1:
            raise ValueError(f"threads must be a positive number, got {threads}")
        self.threads = int(threads)
        self._pool = ThreadPoolExecutor(self.threads) if self.threads > 1 else None
        n, cut = modes.cells, modes.cut
        self._mixed = np.empty((5, n, 2 * cut + 1, cut + 1), self.complex)
        self._workers = [_Worker(modes, self.complex, self.real) for _ in range(self.threads)]
        self._k = [k.ravel().astype(self.real) for k in modes.k]
        self._rows = modes.rows

    def nonlinear(self, u, out, linear=0.0, want_speed=False):
        n, mixed, scale = self.modes.cells, self._mixed, self.real.type(0.5 / self.modes.cells**3)
        kx, ky, kz = self._k
        kz = np.repeat(kz, 2)  # real and imaginary part
        linear = self.real.type(linear)
        source, target = u.view(self.real), out.view(self.real)
        for worker in self._workers:
            worker.speed = 0.0

        def multiply(worker, first, planes):
            kernels.pack(mixed, first, planes, self._rows)
            worker.inverse(len(planes))
            view = planes.view(self.real)
            if want_speed:
                worker.speed = max(worker.speed, kernels.max_speed(view, 2 * n))
            kernels.products(view, 2 * n)
            worker.forward(len(planes))
            kernels.unpack(planes, mixed, first, self._rows)

        def finish(worker, first, last):
            worker.columns[:, :, : last - first, : mixed.shape[3]] = mixed[:, :, first:last]
            worker.forward_x.execute()
            products = worker.columns.view(self.real)
            operands = (products, source, target, first, last, self._rows, kx, ky, kz)
            kernels.project(*operands, scale, linear, worker.row)

        self._to_mixed(u)
        self._each_block(multiply)
        self._each_column_block(finish)
        self.max_speed = max(w.speed for w in self._workers) if want_speed else None

    def to_physical(self, modes, out=None):
        n = self.modes.cells
        if out is None:  # in the order of flow.grid.for_sampling
            out = np.moveaxis(np.empty((n, n, n, len(modes)), self.real), -1, 0)
        for first in range(0, len(modes), 3):
            part = out[first : first + 3]

            def split(worker, x, planes, part=part):
                kernels.pack(self._mixed, x, planes, self._rows)
                worker.inverse(len(planes))
                kernels.split(planes, x, part)

            self._to_mixed(modes[first : first + 3])
            self._each_block(split)
        return out

    def to_modes(self, fields):
        n, cut = self.modes.cells, self.modes.cut
        out = np.empty((len(fields), *self.modes.shape), self.complex)
        factor = self.complex.type(0.5j / n**3)
        for first in range(0, len(fields), 3):
            part = np.asarray(fields[first : first + 3])
            count = len(part)
            mixed, target = self._mixed[:count], out[first : first + count]

            def join(worker, x, planes, part=part, mixed=mixed):
                kernels.join(part, x, planes)
                worker.forward(len(planes), 3)
                kernels.unpack(planes, mixed, x, self._rows)

            def finish(worker, start, stop, mixed=mixed, target=target):
                buffer = worker.columns[: len(mixed), :, : stop - start, : cut + 1]
                buffer[:] = mixed[:, :, start:stop]
                worker.forward_fields.execute()
                np.multiply(buffer[:, : cut + 1], factor, out=target[:, : cut + 1, start:stop])
                np.multiply(buffer[:, -cut:], factor, out=target[:, cut + 1 :, start:stop])

            self._each_block(join)
            self._each_column_block(finish)
        return out

    def at(self, word, fields, points, threads=1):
        return grid.on_grid(word, fields, points, threads)

    def loads(self, modes):
        out = self.zeros()

        def part(worker, start, stop):
            kernels.loads(modes, out, *self._k, start, stop)

        self._share(part, len(out[0]))
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

        def part(worker, start, stop):
            row = np.empty(fz.shape[1], self.real)
            kernels.combine(out.view(self.real), arrays, fx, fy, fz, weights, row, energy, start, stop)

        self._share(part, len(energy))
        mean = out[:, 0, 0, 0].astype(complex)
        return 0.5 * float(energy.sum() - (mean * mean.conj()).real.sum())

    def memory(self) -> int:
        """Bytes of the velocity, three slopes of the AB3 scheme and all work space."""
        state = 4 * 3 * np.prod(self.modes.shape) * self.complex.itemsize
        return int(
            state + self._mixed.nbytes + sum(w.columns.nbytes + w.planes.nbytes for w in self._workers)
        )

    def _to_mixed(self, u: np.ndarray) -> None:
        """Points in x, modes in y and z, of up to three fields."""
        cut, mixed, count = self.modes.cut, self._mixed, len(u)

        def start(worker, first, last):
            buffer = worker.columns[:count, :, : last - first, : cut + 1]
            buffer[:, : cut + 1] = u[:, : cut + 1, first:last]
            buffer[:, cut + 1 : -cut] = 0
            buffer[:, -cut:] = u[:, cut + 1 :, first:last]
            worker.inverse_x.execute()
            mixed[:count, :, first:last] = buffer

        self._each_column_block(start)

    def _each_column_block(self, work: Callable) -> None:
        """work(worker, first, last) for all blocks of ky."""

        def blocks(worker, start, stop):
            step = worker.columns.shape[2]
            for first in range(start, stop, step):
                work(worker, first, min(first + step, stop))

        self._share(blocks, len(self._rows))

    def _each_block(self, work: Callable) -> None:
        """work(worker, first plane, its plane buffers) for all blocks of plane pairs."""
        pairs = self.modes.cells // 2

        def blocks(worker, start, stop):
            for pair in range(start, stop, len(worker.planes)):
                work(worker, 2 * pair, worker.planes[: min(len(worker.planes), stop - pair)])

        self._share(blocks, pairs)

    def _share(self, work: Callable, count: int) -> None:
        """work(worker, start, stop) over equal shares of range(count), one per thread."""
        bounds = np.linspace(0, count, self.threads + 1).astype(int).tolist()
        calls = list(zip(self._workers, bounds[:-1], bounds[1:], strict=True))
        if self._pool is None:
            work(*calls[0])
        else:
            for future in [self._pool.submit(work, *call) for call in calls]:
                future.result()


class _Worker:
    """Buffers and plans of one thread."""

    def __init__(self, modes: Modes, kind: np.dtype, real: np.dtype):
        n, cut = modes.cells, modes.cut
        width = _odd_lines(n, kind)
        pairs = min(n // 2, max(1, BLOCK // (5 * n * width * kind.itemsize)))
        kept = min(-(-(cut + 1) // 4) * 4, n // 2)  # kz = 0 ... K, and a few more for whole vector registers
        columns = min(2 * cut + 1, max(1, BLOCK // (5 * n * kept * kind.itemsize)))
        room = pyfftw.zeros_aligned((5, n, _odd_lines(columns * kept, kind)), kind)
        self.columns = room[..., : columns * kept].reshape(5, n, columns, kept)
        self.speed = 0.0
        self.row = np.empty((3, 2 * cut + 2), real)
        self.planes = pyfftw.zeros_aligned((pairs, 5, n, width), kind)
        self.inverse_x = _plan(self.columns[:3], 1, "FFTW_BACKWARD")
        self.forward_x = _plan(self.columns, 1, "FFTW_FORWARD")
        self.forward_fields = _plan(self.columns[:3], 1, "FFTW_FORWARD")
        self._plans: dict[tuple[int, int, str], list] = {}
        self._edges, self._n = (slice(0, kept), slice(n - kept, n)), n

    def _for(self, pairs: int, fields: int, direction: str) -> list:
        """Plans for so many plane pairs and fields: along y where modes are kept, and along z."""
        key = (pairs, fields, direction)
        if key not in self._plans:
            z = self.planes[:pairs, :fields, :, : self._n]
            along_y = [_plan(z[..., e], 2, direction) for e in self._edges]
            along_z = _plan(z, 3, direction)
            back = direction == "FFTW_BACKWARD"
            self._plans[key] = [*along_y, along_z] if back else [along_z, *along_y]
        return self._plans[key]

    def inverse(self, pairs: int) -> None:
        for plan in self._for(pairs, 3, "FFTW_BACKWARD"):
            plan.execute()

    def forward(self, pairs: int, fields: int = 5) -> None:
        for plan in self._for(pairs, fields, "FFTW_FORWARD"):
            plan.execute()


def _odd_lines(count: int, kind: np.dtype) -> int:
    """Room for so many numbers in an odd number of cache lines: rows a power of two apart would fight for the same."""
    line = 64 // kind.itemsize
    return (-(-count // line) | 1) * line


def _plan(array: np.ndarray, axis: int, direction: str) -> pyfftw.FFTW:
    """In-place complex transform along one axis, not normalised."""
    return pyfftw.FFTW(array, array, axes=(axis,), direction=direction, flags=("FFTW_ESTIMATE",))
