"""Forces that sustain turbulence, built from the same values as their `constant/fvOptions` entries.

A force enters the momentum equation as `rate(energy) * (u - <u>)` plus a field of few modes, added by
`add(rhs)`; it moves on with `advance(time_step)` after every step of the flow.
"""

import math

import numpy as np
from numpy.typing import NDArray

from gbm_plugin.arrays import Form
from gbm_plugin.spectral.arrays import Array, Arrays
from gbm_plugin.spectral.normals import normals

Value = NDArray | float


class Forcing:
    """The base of all forces, without one."""

    def bind(self, operators: Arrays) -> None:
        """Take the mode set and the array library of the solver that this force will drive."""

    def rate(self, energy: float) -> float:
        """A in f = A (u - <u>), from the kinetic energy of the fluctuations."""
        return 0.0

    def add(self, rhs: Array) -> None:
        """Add what is not proportional to u to the modes of du/dt."""

    def advance(self, time_step: float) -> None:
        """Move the force to the next step."""

    def input(self, u: Array, energy: float) -> float:
        """<u.f>, from the modes of u and the kinetic energy of its fluctuations."""
        return 2 * self.rate(energy) * energy if energy > 0 else 0.0

    def reach(self, energy: float, time_step: float) -> float:
        """The largest kinetic energy to which this force can bring the flow in a step; inf where it does not know."""
        return math.inf

    def state(self) -> dict[str, Value]:
        """All that a bitwise restart needs."""
        return {}

    def forms(self) -> dict[str, Form]:
        """What `state` holds."""
        return {}

    def restore(self, state: dict[str, Value]) -> None:
        """Continue from `state()`."""


class Unforced(Forcing):
    """No force: the energy can only decay."""

    def reach(self, energy: float, time_step: float) -> float:
        return energy


class LinearForcing(Forcing):
    """f = A (u - <u>) (Lundgren 2003, Rosales & Meneveau 2005).

    Exactly one of coefficient (A, 1/time, constant) and power (P, energy per mass and time: A = P/2k, with k
    the kinetic energy of the fluctuations) is given, by keyword.
    """

    def __init__(self, *, coefficient: float | None = None, power: float | None = None):
        if (coefficient is None) == (power is None):
            raise ValueError("LinearForcing takes exactly one of coefficient and power")
        given = coefficient if power is None else power
        if not 0 < given < np.inf:
            name = "coefficient" if power is None else "power"
            raise ValueError(f"{name} of LinearForcing must be positive, got {given}")
        self.coefficient, self.power = coefficient, power

    def rate(self, energy: float) -> float:
        if self.power is None:
            return self.coefficient
        if not energy > 0:
            raise ValueError(
                "LinearForcing with constant power needs a fluid that moves: set a velocity first"
            )
        return self.power / (2 * energy)

    def reach(self, energy: float, time_step: float) -> float:
        if self.power is not None:
            return energy + self.power * time_step
        return energy * math.exp(min(2 * self.coefficient * time_step, 700.0))


class EswaranPope(Forcing):
    """Time-correlated random force on the large scales (Eswaran & Pope 1988), the paper's.

    Each mode 0 < |k| <= cutoff k0, k0 = 2 pi/box, carries a complex vector b(t), an Ornstein-Uhlenbeck
    process of the given variance (of the real and of the imaginary part of each component) and time_scale
    T_L; the force is its solenoidal part b - k (k.b)/k^2. For small T_L the power is 4 variance T_L N_F,
    with N_F the number of modes.

    The processes move on once in a step, exactly for any length of it. The noise of step m depends on (seed, m)
    alone and modes are drawn in order of |k|: a run is reproduced exactly by its seed and time steps, on any machine
    and at any resolution, and eswaranPope of the OpenFOAM plugin has the same force at the same times.
    """

    def __init__(self, *, variance: float, time_scale: float, cutoff: float, seed: int):
        if not 0 < variance < np.inf:
            raise ValueError(f"variance of EswaranPope must be positive, got {variance}")
        if not 0 < time_scale < np.inf:
            raise ValueError(f"time_scale of EswaranPope must be positive, got {time_scale}")
        if not 1 <= cutoff < np.inf:
            raise ValueError(f"cutoff of EswaranPope must be at least 1 (in units of 2 pi/box), got {cutoff}")
        if seed != int(seed) or not 0 <= seed < 2**64:
            raise ValueError(f"seed of EswaranPope must be a whole number from 0 to 2^64 - 1, got {seed}")
        self.variance, self.time_scale, self.cutoff = float(variance), float(time_scale), float(cutoff)
        self.seed, self.draws = int(seed), 0
        self._k = half_shell(self.cutoff)
        self._b = self._noise()

    @property
    def mode_count(self) -> int:
        """N_F, both k and -k counted."""
        return 2 * len(self._k)

    def bind(self, operators: Arrays) -> None:
        modes = operators.modes
        if self.cutoff > modes.cut:
            limit = f"must not exceed {modes.cut} at {modes.cells} cells"
            raise ValueError(f"cutoff of EswaranPope {limit}, got {self.cutoff}")
        self._operators = operators
        both = np.concatenate([self._k, -self._k])
        stored = both[:, 2] >= 0
        # negative kx, ky count from the end, as they are stored
        self._index = tuple(operators.xp.asarray(i) for i in both[stored].T)
        self._source = np.tile(np.arange(len(self._k)), 2)[stored]
        self._mirrored = (np.arange(len(both)) >= len(self._k))[stored]
        self._weights = modes.weights[both[stored, 2]]

    def force(self) -> NDArray:
        """Complex amplitudes (M, 3) of the force in the half shell."""
        k = self._k
        return self._b - k * ((k * self._b).sum(axis=1) / (k * k).sum(axis=1))[:, None]

    def add(self, rhs: Array) -> None:
        for component, values in zip(rhs, self._stored(), strict=True):
            component[self._index] += self._operators.xp.asarray(values, rhs.dtype)

    def advance(self, time_step: float) -> None:
        # of the C library, as in the plugin: NumPy's own differ in the last bit
        memory = math.exp(-time_step / self.time_scale)
        self._b = memory * self._b + math.sqrt(-math.expm1(-2 * time_step / self.time_scale)) * self._noise()

    def input(self, u: Array, energy: float) -> float:
        velocity = self._operators.host(u[(slice(None), *self._index)]).astype(complex)
        return float((self._weights * (velocity * self._stored().conj()).real).sum())

    def reach(self, energy: float, time_step: float) -> float:
        # d|u|/dt <= |f|, with |.| the rms over the box
        force = math.sqrt(2 * float((abs(self.force()) ** 2).sum()))
        return 0.5 * (math.sqrt(2 * energy) + force * time_step) ** 2

    def state(self) -> dict[str, Value]:
        return {"amplitudes": self._b.copy(), "draws": float(self.draws)}

    def forms(self) -> dict[str, Form]:
        return {"amplitudes": ("c", self._b.shape), "draws": ("f", ())}

    def restore(self, state: dict[str, Value]) -> None:
        amplitudes, draws = np.asarray(state["amplitudes"]), float(state["draws"])
        if amplitudes.shape != self._b.shape:
            raise ValueError(f"the stored force has {len(amplitudes)} modes, this one {len(self._b)}")
        if not 0 <= draws < 2**53 or draws != int(draws):
            raise ValueError(f"the stored force has drawn {draws} times")
        self._b, self.draws = amplitudes.copy(), int(draws)

    def _stored(self) -> NDArray:
        """The force (3, M') at the modes that the solver stores."""
        f = self.force()[self._source].T
        return np.where(self._mirrored, f.conj(), f)

    def _noise(self) -> NDArray:
        """Independent complex normal amplitudes (M, 3) of the given variance."""
        pairs = normals(self.seed, self.draws, 6 * len(self._k)).reshape(-1, 3, 2)
        self.draws += 1
        return math.sqrt(self.variance) * (pairs[..., 0] + 1j * pairs[..., 1])


def half_shell(cutoff: float) -> NDArray:
    """One of each pair k, -k of integer vectors (M, 3) with 0 < |k| <= cutoff, in order of |k|."""
    reach = np.arange(-int(cutoff), int(cutoff) + 1)
    k = np.stack(np.meshgrid(reach, reach, reach, indexing="ij"), axis=-1).reshape(-1, 3)
    squares = (k * k).sum(axis=1)
    wanted = (squares > 0) & (squares <= cutoff**2 * (1 + 1e-12))
    leading = np.where(k[:, 2] != 0, k[:, 2], np.where(k[:, 1] != 0, k[:, 1], k[:, 0]))
    k, squares = k[wanted & (leading > 0)], squares[wanted & (leading > 0)]
    return k[np.lexsort((*k.T[::-1], squares))]
