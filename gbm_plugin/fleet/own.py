r"""A bead's own disturbance in the flow that it samples, with feedback: how large it is, and how it is taken out.

A force F on the fluid is spread over about a cell Δx, and a bead that samples there finds what it did itself: in steady
Stokes flow a/(√π Δx) of its slip F/6πμa, for a Gaussian of that width. But Δx²/ν is several Kolmogorov times, and the
disturbance that a bead finds is that of its past,

    u(t) = ∫ F(t') K(t − t') dt',    K(τ) = (2/3ρ) ∫ |w(k)|² e^(−νk²τ) d³k/(2π)³,

the response of the unsteady Stokes equations to the weights w of spreading and sampling, over the resolved k and from
where the box begins; a Gaussian of width σ would have (2/3ρ) [4π(σ² + ντ)]^(−3/2). |w|² is the mean over the places
of a bead between nodes. Taken together in shells of k it is a sum of exponentials, each of which needs no history:
integrated with the weights with which the flow itself takes forces (Adams–Bashforth, the first two steps
Runge–Kutta).
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

SHELLS = 10
WIDTHS = {"trilinear": 2, "cubic": 4, "quintic": 6}  # nodes in each direction
ADAMS_BASHFORTH = np.array([23.0, -16.0, 5.0]) / 12


class Kernel(NamedTuple):
    """K(τ) = Σ weight e^(−rate τ): weights (M,) [1/kg] and rates (M,) [1/s]."""

    weight: NDArray
    rate: NDArray


def kernel(word: str, cell: float, box: float, viscosity: float, density: float, cut: float = 1.0) -> Kernel:
    """Of an interpolation on cells of this size in a cubic box [m]. viscosity: kinematic; cut: largest resolved
    wavenumber in each direction over π/Δx. K(0) and ∫K dτ are exact for any number of shells."""
    low = (
        (3 / (4 * np.pi)) ** (1 / 3) * 2 * np.pi / box
    )  # a sphere of the volume of one mode, which is the mean
    high = np.sqrt(3) * np.pi * cut / cell
    edges = np.geomspace(low, high, 40 * SHELLS + 1)
    k = np.sqrt(edges[1:] * edges[:-1])
    directions = np.random.default_rng(0).standard_normal((2000, 3))
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    phase = np.abs(k[:, None, None] * directions) * cell
    seen = np.where(phase <= np.pi * cut, _response(word, phase), 0.0).prod(axis=2).mean(axis=1)
    parts = 2 / (3 * density) * seen * (edges[1:] ** 3 - edges[:-1] ** 3) / (6 * np.pi**2)
    weight = parts.reshape(SHELLS, -1).sum(axis=1)
    steady = (parts / (viscosity * k**2)).reshape(SHELLS, -1).sum(axis=1)
    return Kernel(weight, weight / steady)


def _response(word: str, phase: NDArray) -> NDArray:
    """|w|² in one direction at phases kΔx, the mean over places between two nodes."""
    if word == "exact":
        return np.ones(phase.shape)
    width = WIDTHS[word]
    nodes = np.arange(width) - (width // 2 - 1)
    places = (np.arange(16) + 0.5) / 16
    table = np.linspace(0, np.pi, 129)
    total = np.zeros(table.shape)
    for x in places:
        weights = [np.prod([(x - r) / (q - r) for r in nodes if r != q]) for q in nodes]
        total += np.abs(np.exp(1j * np.outer(table, nodes)) @ weights) ** 2 / len(places)
    return np.interp(phase, table, total)


class OwnDisturbance:
    """That of beads (B, 3), from their forces so far."""

    def __init__(self, kernel: Kernel, beads: int):
        self.kernel = kernel
        self._parts = np.zeros((len(kernel.rate), beads, 3))
        self._forces: list[NDArray] = []  # newest first

    @property
    def velocity(self) -> NDArray:
        """(B, 3) now [m/s]."""
        return np.tensordot(self.kernel.weight, self._parts, axes=1)

    def advance(self, force: NDArray, time_step: float) -> None:
        """One step, at whose start the beads put this force (B, 3) on the flow; all steps are equal."""
        self._forces = [force, *self._forces][:3]
        fade = np.exp(-self.kernel.rate * time_step)[:, None, None]
        self._parts *= fade
        if len(self._forces) < 3:
            self._parts += time_step / 6 * (fade + 4 * np.sqrt(fade) + 1) * force
            return
        for age, (weight, past) in enumerate(zip(ADAMS_BASHFORTH, self._forces, strict=True)):
            self._parts += time_step * weight * fade ** (1 + age) * past

    def state(self) -> NDArray:
        """(B, M + S, 3): the parts, and the forces of up to three steps."""
        return np.concatenate(
            [self._parts, np.array(self._forces).reshape(-1, *self._parts.shape[1:])]
        ).swapaxes(0, 1)

    def restore(self, state: NDArray) -> None:
        """Take back what state() gave. ValueError for another number of beads or shells."""
        beads, shells = self._parts.shape[1], len(self.kernel.rate)
        if state.shape[0] != beads or not shells <= state.shape[1] <= shells + 3 or state.shape[2:] != (3,):
            raise ValueError(
                f"the own disturbance is {state.shape}; it must be ({beads}, {shells} ... + 3, 3)"
            )
        arrays = np.ascontiguousarray(state.swapaxes(0, 1))
        self._parts, self._forces = arrays[:shells], list(arrays[shells:])
