"""Flows known in closed form."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..compiled import kernel, only_read, part_of
from ..sampling import NEEDS, NUMBERS, one_of, rotation_of
from ..threads import in_shares
from .trigonometry import sine_cosine

CHUNK = 256  # points at a time, in the nearest cache
COST = 0.3  # of a point, in steps of a bead


class LinearFlow:
    """u(x) = velocity + gradient · x, steady; gradient[i, j] = du_i/dx_j, all finite, else ValueError."""

    def __init__(self, gradient: ArrayLike, velocity: ArrayLike = (0, 0, 0)):
        self.gradient = np.array(gradient, dtype=float)
        self.velocity = np.array(velocity, dtype=float)
        if self.gradient.shape != (3, 3) or self.velocity.shape != (3,):
            raise ValueError(
                f"gradient and velocity have shapes {self.gradient.shape} and {self.velocity.shape}; "
                "they must be (3, 3) and (3,)"
            )
        if not (np.isfinite(self.gradient).all() and np.isfinite(self.velocity).all()):
            raise ValueError("gradient and velocity of a linear flow must be finite")
        self._rotation = rotation_of(self.gradient)

    def sample(
        self, positions: ArrayLike, time: float, need: str = "gradient"
    ) -> tuple[NDArray, NDArray | None]:
        """Velocity (..., 3) at positions (..., 3), and what need asks for beside it.

        need: "velocity" (extra is None), "rotation" (½∇×u, (..., 3)) or "gradient" ((..., 3, 3)).
        """
        positions = np.asarray(positions, dtype=float)
        velocity = positions @ self.gradient.T + self.velocity
        if one_of("need", need, NEEDS) == "velocity":
            return velocity, None
        extra = self._rotation if need == "rotation" else self.gradient
        return velocity, np.broadcast_to(extra, positions.shape[:-1] + extra.shape)


class TaylorGreen:
    """Steady cellular flow in the plane (paper, eq. 12): U₀ (sin x̃ cos ỹ, −cos x̃ sin ỹ, 0), x̃ = πx/width.

    ValueError unless width is positive and both numbers are finite. The compression rate at the stagnation
    points is S = πU₀/width.
    """

    def __init__(self, width: float, velocity: float):
        self.width, self.velocity = float(width), float(velocity)
        if not (np.isfinite(self.width) and self.width > 0 and np.isfinite(self.velocity)):
            raise ValueError(f"width is {width} and velocity {velocity}; width must be positive, both finite")

    def sample(
        self, positions: ArrayLike, time: float, need: str = "gradient"
    ) -> tuple[NDArray, NDArray | None]:
        """Velocity (..., 3) at positions (..., 3); extra as in LinearFlow.sample."""
        shape = np.shape(positions)
        points = only_read(np.asarray(positions, dtype=float)).reshape(-1, 3)
        wavenumber = np.pi / self.width
        extra = np.empty((len(points), NUMBERS[one_of("need", need, NEEDS)] - 3))
        velocity = np.empty(points.shape)
        in_shares(_cellular, COST * len(points), points, wavenumber, self.velocity, velocity, extra)
        tail = (3, 3) if need == "gradient" else (3,)
        return velocity.reshape(shape), None if need == "velocity" else extra.reshape(*shape[:-1], *tail)


@kernel
def _cellular(share, shares, points, wavenumber, speed, velocity, extra):
    """velocity (P, 3) at points (P, 3), and rotation or gradient, extra (P, 3 or 9); (P, 0) for neither."""
    phase, sine, cosine = np.empty(2 * CHUNK), np.empty(2 * CHUNK), np.empty(2 * CHUNK)
    rate, columns = speed * wavenumber, extra.shape[1]
    first, last = part_of(share, shares, points.shape[0])
    for start in range(first, last, CHUNK):
        count = min(CHUNK, last - start)
        for i in range(count):
            phase[i], phase[count + i] = wavenumber * points[start + i, 0], wavenumber * points[start + i, 1]
        sine_cosine(phase[: 2 * count], sine, cosine)
        for i in range(count):
            p, j = start + i, count + i
            velocity[p, 0], velocity[p, 1] = speed * sine[i] * cosine[j], -speed * cosine[i] * sine[j]
            velocity[p, 2] = 0.0
            turn, stretch = rate * sine[i] * sine[j], rate * cosine[i] * cosine[j]
            for c in range(columns):
                extra[p, c] = 0.0
            if columns == 3:
                extra[p, 2] = turn
            elif columns == 9:
                extra[p, 0], extra[p, 1], extra[p, 3], extra[p, 4] = stretch, -turn, turn, -stretch


class ABC:
    """Steady Arnold–Beltrami–Childress flow of a periodic box (Dombre et al., J. Fluid Mech. 167, 353 (1986)):

    u = (a sin kz + c cos ky, b sin kx + a cos kz, c sin ky + b cos kx), k = 2π/box, with ∇×u = k u. Its
    convection is the gradient of a pressure, so that the force νk²u holds it. a, b, c [m/s]; ValueError unless
    they are finite and box [m] is positive.
    """

    def __init__(self, a: float = 1.0, b: float = 1.0, c: float = 1.0, box: float = 2 * np.pi):
        self.amplitudes = np.array([a, b, c], dtype=float)
        self.box = float(box)
        if not (np.isfinite(self.amplitudes).all() and np.isfinite(self.box) and self.box > 0):
            raise ValueError(
                f"a, b, c are {a}, {b}, {c} and box {box}; box must be positive, all of them finite"
            )

    def sample(
        self, positions: ArrayLike, time: float, need: str = "gradient"
    ) -> tuple[NDArray, NDArray | None]:
        """Velocity (..., 3) at positions (..., 3); extra as in LinearFlow.sample."""
        positions = np.asarray(positions, dtype=float)
        a, b, c = self.amplitudes
        wavenumber = 2 * np.pi / self.box
        sin_x, sin_y, sin_z = np.moveaxis(np.sin(wavenumber * positions), -1, 0)
        cos_x, cos_y, cos_z = np.moveaxis(np.cos(wavenumber * positions), -1, 0)
        velocity = np.stack([a * sin_z + c * cos_y, b * sin_x + a * cos_z, c * sin_y + b * cos_x], axis=-1)
        if one_of("need", need, NEEDS) == "velocity":
            return velocity, None
        if need == "rotation":
            return velocity, 0.5 * wavenumber * velocity
        gradient = np.zeros((*positions.shape, 3))
        gradient[..., 0, 1], gradient[..., 0, 2] = -c * sin_y, a * cos_z
        gradient[..., 1, 0], gradient[..., 1, 2] = b * cos_x, -a * sin_z
        gradient[..., 2, 0], gradient[..., 2, 1] = -b * sin_x, c * cos_y
        return velocity, wavenumber * gradient
