r"""The Navier-Stokes operators on whole arrays: the equations as they are written, over NumPy or CuPy.

With u in Fourier space, T_ij = u_i u_j - delta_ij u_z^2 (the trace goes into the pressure, five products
remain) and P_ij = delta_ij - k_i k_j/k^2,

    du_i/dt = P_ij [-i k_l T_jl + A u_j] - nu k^2 u_i.

`Arrays` serves a GPU, and checks the slab-wise CPU operators that inherit from it (`slabs.py`).
"""

from functools import cached_property
from types import ModuleType
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gbm_plugin.flow import grid
from gbm_plugin.spectral.modes import Modes

Array = Any  # numpy.ndarray or cupy.ndarray
Term = tuple[float, float, Array]  # coefficient, delay, modes
POINTS = 1 << 17  # that are interpolated at once


class Arrays:
    """Operators on the Fourier-series coefficients of a vector field, complex (3, 2K+1, 2K+1, K+1)."""

    def __init__(self, modes: Modes, viscosity: float, precision: str = "double", xp: ModuleType = np):
        if precision not in ("double", "single"):
            raise ValueError(f'precision must be "double" or "single", got "{precision}"')
        if not 0 <= viscosity < np.inf:
            raise ValueError(f"viscosity must be zero or positive, got {viscosity}")
        self.modes, self.viscosity, self.xp = modes, float(viscosity), xp
        self.real = np.dtype(np.float64 if precision == "double" else np.float32)
        self.complex = np.dtype(np.complex128 if precision == "double" else np.complex64)
        self.max_speed = None

    def zeros(self) -> Array:
        """Modes of a fluid at rest."""
        return self.xp.zeros((3, *self.modes.shape), self.complex)

    @cached_property
    def k(self) -> list[Array]:
        """kx, ky, kz in the working precision, shaped to broadcast."""
        return [self.xp.asarray(k, self.real) for k in self.modes.k]

    @cached_property
    def k_squared(self) -> Array:
        """|k|^2 in double precision."""
        return self.xp.asarray(self.modes.k_squared)

    def to_modes(self, fields: Array) -> Array:
        """Truncated Fourier coefficients (m, 2K+1, 2K+1, K+1) of real fields (m, n, n, n)."""
        cut, out = self.modes.cut, self.xp.empty((len(fields), *self.modes.shape), self.complex)
        for field, target in zip(fields, out, strict=True):
            full = self.xp.fft.rfftn(self.xp.asarray(field, self.real), norm="forward")
            for stored, place in self.modes.blocks():
                target[stored] = full[place][..., : cut + 1]
        return out

    def to_physical(self, modes: Array, out: Array | None = None) -> Array:
        """Real fields (m, n, n, n) at the nodes, written to `out` if given; modes (m, 2K+1, 2K+1, K+1)."""
        n, cut = self.modes.cells, self.modes.cut
        out = self.xp.empty((len(modes), n, n, n), self.real) if out is None else out
        for source, target in zip(modes, out, strict=True):
            full = self.xp.zeros((n, n, n // 2 + 1), self.complex)
            for stored, place in self.modes.blocks():
                full[place][..., : cut + 1] = source[stored]
            target[:] = self.xp.fft.irfftn(full, s=(n, n, n), axes=(0, 1, 2), norm="forward")
        return out

    def project(self, f: Array) -> Array:
        """The solenoidal part of f without its mean: P f."""
        kx, ky, kz = self.k
        k_squared = kx**2 + ky**2 + kz**2
        k_squared[0, 0, 0] = 1
        q = (kx * f[0] + ky * f[1] + kz * f[2]) / k_squared
        out = self.xp.stack([f[0] - kx * q, f[1] - ky * q, f[2] - kz * q])
        out[:, 0, 0, 0] = 0
        return out

    def loads(self, modes: Array) -> Array:
        """P [F + curl T/2] without its mean, of the modes of forces F (3, ...), or of F and torques T (6, ...)."""
        return self.project(modes if len(modes) == 3 else modes[:3] + self.curl(modes[3:]) / 2)

    def nonlinear(self, u: Array, out: Array, linear: float = 0.0, want_speed: bool = False) -> None:
        """out = P [-div(u u) + linear u]; on request also max_speed = max(|u_x| + |u_y| + |u_z|)."""
        x, y, z = self.to_physical(u)
        if want_speed:
            self.max_speed = float((abs(x) + abs(y) + abs(z)).max())
        kx, ky, kz = self.k
        xx, yy, xy, xz, yz = self.to_modes([x * x - z * z, y * y - z * z, x * y, x * z, y * z])
        divergence = self.xp.stack(
            [kx * xx + ky * xy + kz * xz, kx * xy + ky * yy + kz * yz, kx * xz + ky * yz]
        )
        divergence *= -1j
        if linear:
            divergence += self.real.type(linear) * u
        out[:] = self.project(divergence)

    def combine(self, out: Array, terms: list[Term]) -> float:
        """out = sum of coefficient exp(-nu k^2 delay) modes over terms; returns its fluctuation energy."""
        total = sum(
            (c * self.xp.exp(-self.viscosity * self.k_squared * t)).astype(self.real) * a for c, t, a in terms
        )
        out[:] = total
        return self.energy(out)

    def energy(self, u: Array) -> float:
        """Kinetic energy of the fluctuations, <|u - <u>|^2>/2."""
        return float(self.mode_energy(u).ravel()[1:].sum())

    def mode_energy(self, u: Array) -> Array:
        """Energy of each stored mode together with its conjugate, in double precision."""
        squares = (u.real.astype(np.float64) ** 2 + u.imag.astype(np.float64) ** 2).sum(axis=0)
        return 0.5 * squares * self.xp.asarray(self.modes.weights)

    def dissipation(self, u: Array) -> float:
        """2 nu times the enstrophy's integrand over the modes, sum nu k^2 |u_k|^2."""
        return 2 * self.viscosity * float((self.k_squared * self.mode_energy(u)).sum())

    def mean(self, u: Array) -> NDArray:
        """<u> (3,), complex as stored, in main memory."""
        return self.host(u[:, 0, 0, 0])

    def shifted(self, u: Array, fraction: float) -> Array:
        """Modes of u(x + fraction of a cell in each direction)."""
        step = fraction * self.modes.box / self.modes.cells
        i, j, k = (self.xp.asarray(np.exp(1j * axis * step)) for axis in self.modes.k)
        return (u * (i * j * k)).astype(self.complex)

    def at(self, word: str, fields: Array, points: NDArray, threads: int = 1) -> NDArray:
        """Fields (m, n, n, n) at points (P, 3) in units of cells, by a word of `flow.grid`: (P, m), in main memory."""
        parts = [
            self.host(
                _lagrange(self.xp, grid.nodes_of(word), fields, self.xp.asarray(points[i : i + POINTS]))
            )
            for i in range(0, len(points), POINTS)
        ]
        return np.concatenate(parts) if parts else np.empty((0, len(fields)))

    def close(self, u: Array) -> None:
        """Restore c(-k) = conj c(k) where both are stored, at kz = 0: rounding would let them part."""
        cut = self.modes.cut
        plane = u[..., 0]
        plane[:, 0, 0] = plane[:, 0, 0].real
        plane[:, 0, cut + 1 :] = plane[:, 0, cut:0:-1].conj()
        plane[:, cut + 1 :, 0] = plane[:, cut:0:-1, 0].conj()
        plane[:, cut + 1 :, 1:] = plane[:, cut:0:-1, :0:-1].conj()

    def derivative(self, u: Array, axis: int) -> Array:
        """Modes of du/dx_axis."""
        return 1j * self.k[axis] * u

    def curl(self, u: Array) -> Array:
        """Modes of the curl of u."""
        kx, ky, kz = self.k
        return 1j * self.xp.stack([ky * u[2] - kz * u[1], kz * u[0] - kx * u[2], kx * u[1] - ky * u[0]])

    def host(self, a: Array) -> NDArray:
        """The array in main memory."""
        return a.get() if hasattr(a, "get") else a


def _lagrange(xp: ModuleType, width: int, fields: Array, points: Array) -> Array:
    """Lagrange's polynomials through the `width` nearest nodes in each direction, of fields (m, n, n, n): (P, m)."""
    n, nodes = fields.shape[1], np.arange(width)
    low = xp.floor(points) - (width // 2 - 1)
    s = points - low
    weights = xp.ones((*points.shape, width))
    for q in nodes:
        for r in nodes[nodes != q]:
            weights[..., q] *= (s - r) / (q - r)
    x, y, z = ((low.astype(np.int64)[..., None] + xp.asarray(nodes)) % n).swapaxes(0, 1)
    place = (x[:, :, None, None] * n + y[:, None, :, None]) * n + z[:, None, None, :]
    wx, wy, wz = weights.swapaxes(0, 1)
    weight = wx[:, :, None, None] * wy[:, None, :, None] * wz[:, None, None, :]
    return xp.stack([(field.reshape(-1)[place] * weight).sum(axis=(1, 2, 3)) for field in fields], axis=1)
