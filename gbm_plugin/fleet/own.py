r"""A bead's own disturbance in the flow that it samples, with feedback: how large it is, and how it is taken out.

A force F on the fluid is spread over about a cell Δx, and a bead that samples there finds what it did itself: in steady
Stokes flow a/(√π Δx) of its slip F/6πμa, for a Gaussian of that width. But Δx²/ν is several Kolmogorov times, and the
disturbance that a bead finds is that of its past,

    u(t) = ∫ F(t') K(t − t') dt',    K(τ) = (2/3ρ) ∫ |w(k)|² e^(−νκ²τ) d³k/(2π)³,

the response of the unsteady Stokes equations to the weights w of spreading and sampling, over the resolved k and from
where the box begins; κ² is the k² of the flow's own Laplacian. A Gaussian of width σ would have
(2/3ρ) [4π(σ² + ντ)]^(−3/2). A torque T turns the bead in the same way,

    Ω(t) = ∫ T(t') K'(t − t') dt',   K'(τ) = (1/12ρ) ∫ (|d|² + |d·k|²/k²) e^(−νκ²τ) d³k/(2π)³,

d(k) being the weights of the gradient, ikw where it is exact: then, in steady flow and all of a cube of wavenumbers,
(4π/3) (a/Δx)³ of its spin T/8πμa³. |w|² and |d|² are means over the places of a bead between nodes. Taken together in
shells of k these are sums of exponentials, each of which needs no history: integrated with the weights with which the
flow itself takes forces (Adams–Bashforth, the first two steps Runge–Kutta).

pimpleFoam's pressure takes its gradient and the fluxes whose divergence it removes from faces, and its Laplacian from
cells side by side: of a mode it takes out the part r = Σ 4 sin²(θ/2) g(θ) f(θ) / Σ 4 sin²(θ/2), g and f being the
responses of face values, θ = k_i Δx. Where waves are as short as cells this is less than all of what is along k:
1 − r/3 of a force stays, and not 2/3.

A bead that slips leaves its disturbance behind, where Δx times its slip s is not small beside ν. In Oseen's flow a mode
has 1/(νk² + ik·s) in place of 1/νk², and the mean over directions is that of a rate νk²/g(s/νk),

    g(q) = (3/2) [(1 + 1/q²) arctan(q)/q − 1/q²] for a force along the slip,   arctan(q)/q for a torque,
    (3/q²) [1 − arctan(q)/q] for what of the force is along k and stays.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..compiled import inlined, kernel, only_read, part_of
from ..threads import in_shares

SHELLS = 10
INTERVALS = 2048  # of slips, between which what is left after a step is interpolated: to 1e-6
COST = 0.3  # of a bead, in steps of a bead
WIDTHS = {"trilinear": 2, "cubic": 4, "quintic": 6}  # nodes in each direction
CENTRAL2, CENTRAL6 = (
    (1.0,),
    (3 / 2, -3 / 20, 1 / 90),
)  # Laplacians of OpenFOAM's `Gauss linear`, and of boxFoam
FACES = {
    "linear": (1 / 2,),
    "cubic": (9 / 16, -1 / 16),
}  # weights of the cells on either side, the nearest first


class Kernel(NamedTuple):
    """K(τ) = Σ weight e^(−rate τ): weights (M,), rates (M,) [1/s], and what part of it is along k."""

    weight: NDArray
    rate: NDArray
    along: NDArray


class Mesh(NamedTuple):
    """How a flow sees a bead. interpolation: of samples; cell, box: their sizes [m]; cut: largest resolved wavenumber
    in each direction over π/Δx; laplacian: weights c_m of u(+m) − 2u + u(−m), none where derivatives are exact; faces:
    words of FACES for grad(p) and the fluxes, none where the projection is one."""

    interpolation: str
    cell: float
    box: float
    cut: float = 1.0
    laplacian: tuple[float, ...] = ()
    faces: tuple[str, ...] = ()

    def viscous(self, phase: NDArray) -> NDArray:
        """(κΔx)² of one direction at phases kΔx."""
        if not self.laplacian:
            return phase**2
        return sum(2 * c * (1 - np.cos((m + 1) * phase)) for m, c in enumerate(self.laplacian))

    def projected(self, phase: NDArray) -> NDArray | float:
        """r of modes with phases (..., 3): how much of what is along k the pressure takes out."""
        if not self.faces:
            return 1.0
        compact = 4 * np.sin(phase / 2) ** 2
        seen = compact.copy()
        for word in self.faces:
            seen *= sum(2 * a * np.cos((m + 0.5) * phase) for m, a in enumerate(FACES[word]))
        return seen.sum(axis=-1) / compact.sum(axis=-1)


def kernels(mesh: Mesh, viscosity: float, density: float) -> tuple[Kernel, Kernel]:
    """Of the velocity by a force, and of the rotation by a torque [1/(kg m²)]. viscosity: kinematic. K(0) and ∫K dτ are
    exact for any number of shells."""
    cell, cut = mesh.cell, mesh.cut
    low = (
        (3 / (4 * np.pi)) ** (1 / 3) * 2 * np.pi / mesh.box
    )  # a sphere of the volume of one mode, which is the mean
    high = np.sqrt(3) * np.pi * cut / cell
    edges = np.geomspace(low, high, 40 * SHELLS + 1)
    k = np.sqrt(edges[1:] * edges[:-1])
    volume = (edges[1:] ** 3 - edges[:-1] ** 3) / (6 * np.pi**2)
    directions = np.random.default_rng(0).standard_normal((2000, 3))
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    phase = np.abs(k[:, None, None] * directions) * cell
    decay = viscosity / cell**2 * mesh.viscous(phase).sum(axis=2)
    seen = np.where(phase <= np.pi * cut, _response(mesh.interpolation, phase), 0.0)
    slope, both = _slopes(mesh, phase, seen)
    d = np.abs(directions)
    turned, along = np.zeros((2, *seen.shape[:2]))
    for i in range(3):
        j, m = (i + 1) % 3, (i + 2) % 3
        own = slope[..., i] * seen[..., j] * seen[..., m]
        turned += own
        along += d[:, i] ** 2 * own
        along += 2 * d[:, i] * d[:, j] * both[..., i] * both[..., j] * seen[..., m]

    def shells(across: NDArray, factor: float, along: NDArray | float = 0.0) -> Kernel:
        def sums(response: NDArray) -> NDArray:
            return factor * (volume * response.mean(axis=1)).reshape(SHELLS, -1).sum(axis=1)

        weight, steady = sums(across + along), sums((across + along) / decay)
        return Kernel(weight, weight / steady, 1 - sums(across / decay) / steady)

    felt = seen.prod(axis=2)
    return (
        shells(2 / 3 * felt, 1 / density, felt * (1 - mesh.projected(phase)) / 3),
        shells((turned + along) / cell**2, 1 / (12 * density)),
    )


def _weights(word: str, x: float) -> tuple[NDArray, NDArray, NDArray]:
    """The nodes in one direction around a place x between 0 and 1, the weights of their values and of their slope."""
    width = WIDTHS[word]
    nodes = np.arange(width) - (width // 2 - 1)
    basis = [
        np.poly1d([r for r in nodes if r != q], r=True) / np.prod([q - r for r in nodes if r != q])
        for q in nodes
    ]
    return nodes, np.array([b(x) for b in basis]), np.array([b.deriv()(x) for b in basis])


def _table(word: str, which: Callable[[NDArray, NDArray], NDArray]) -> tuple[NDArray, NDArray]:
    """Means over places between two nodes, for phases from 0 to π: which(w, s) of the responses of value and slope."""
    phases, places = np.linspace(0, np.pi, 129), (np.arange(16) + 0.5) / 16
    total = np.zeros(phases.shape)
    for x in places:
        nodes, weights, slopes = _weights(word, x)
        waves = np.exp(1j * np.outer(phases, nodes))
        total += which(waves @ weights, waves @ slopes) / len(places)
    return phases, total


def _response(word: str, phase: NDArray) -> NDArray:
    """|w|² in one direction at phases kΔx, the mean over places between two nodes."""
    if word == "exact":
        return np.ones(phase.shape)
    return np.interp(phase, *_table(word, lambda w, s: np.abs(w) ** 2))


def _slopes(mesh: Mesh, phase: NDArray, seen: NDArray) -> tuple[NDArray, NDArray]:
    """Of the gradient's weights s in one direction, in units of cells: means of |s|² and of Im(s w*)."""
    if not mesh.laplacian:
        return phase**2 * seen, phase * seen
    if mesh.interpolation == "trilinear":  # central differences, interpolated
        return np.sin(phase) ** 2 * seen, np.sin(phase) * seen
    resolved = seen > 0
    slope = np.interp(phase, *_table(mesh.interpolation, lambda w, s: np.abs(s) ** 2))
    both = np.interp(phase, *_table(mesh.interpolation, lambda w, s: (s * w.conj()).imag))
    return slope * resolved, both * resolved


def _shared(left: NDArray, along: NDArray) -> NDArray:
    """g of s/νk (..., M, 2), for forces and torques, of which so much (M, 2) is along k."""
    q = np.maximum(left, 1e-3)  # below it g is 1 to 1e-6
    turned = np.arctan(q) / q
    across = 1.5 * ((1 + 1 / q**2) * turned - 1 / q**2)
    pushed = across + along * (3 * (1 - turned) / q**2 - across)
    return np.stack([pushed[..., 0], turned[..., 1]], axis=-1)


@inlined
def _add_motion(weight, parts, motion):
    """motion (6,) += Σ weight parts of the shells (M, 6)."""
    for m in range(parts.shape[0]):
        for c in range(6):
            motion[c] += weight[m, c // 3] * parts[m, c]


@kernel
def _sum(share, shares, weight, parts, motion):
    """motion (B, 6) of parts (B, M, 6)."""
    first, last = part_of(share, shares, parts.shape[0])
    for b in range(first, last):
        motion[b] = 0
        _add_motion(weight, parts[b], motion[b])


@kernel
def _advance(share, shares, fades, half, drag, step, weight, loads, parts, motion):
    """parts (B, M, 6) one step on, and motion (B, 6), by loads (S <= 3, B, 6), newest first; fades: `_fades`."""
    first, last = part_of(share, shares, parts.shape[0])
    for b in range(first, last):
        x, y, z = loads[0, b, 0], loads[0, b, 1], loads[0, b, 2]
        slip = np.sqrt(x * x + y * y + z * z) / drag
        place = slip / (slip + half) * INTERVALS
        if not place >= 0:  # no number: nor will the parts be
            place = 0.0
        i = min(int(place), INTERVALS - 1)
        place -= i
        for m in range(parts.shape[1]):
            for kind in range(2):
                fade = fades[i, m, kind] + place * (fades[i + 1, m, kind] - fades[i, m, kind])
                if loads.shape[0] < 3:
                    now = step / 6 * (fade + 4 * np.sqrt(fade) + 1)
                    for c in range(3 * kind, 3 * kind + 3):
                        parts[b, m, c] = fade * parts[b, m, c] + now * loads[0, b, c]
                    continue
                now = step * (23 / 12) * fade
                before = -step * (16 / 12) * fade * fade
                earlier = step * (5 / 12) * fade * fade * fade
                for c in range(3 * kind, 3 * kind + 3):
                    past = before * loads[1, b, c] + earlier * loads[2, b, c]
                    parts[b, m, c] = fade * parts[b, m, c] + now * loads[0, b, c] + past
        motion[b] = 0
        _add_motion(weight, parts[b], motion[b])


class OwnDisturbance:
    """That of beads (B, 3), from their forces and torques so far. viscosity: kinematic; drag: 6πμa, over which a force
    is the slip of its bead [kg/s]."""

    def __init__(self, kernels: tuple[Kernel, Kernel], viscosity: float, drag: float, beads: int):
        self._viscosity, self._drag = viscosity, drag
        self._weight, self._rate, self._along = (np.stack(a, axis=1) for a in zip(*kernels, strict=True))
        self._parts = np.zeros((beads, SHELLS, 6))
        self._loads = np.zeros((0, beads, 6))  # newest first
        self._motion = np.zeros((beads, 6))
        self._step, self._fades, self._half = 0.0, np.zeros(0), 0.0

    @property
    def motion(self) -> NDArray:
        """Velocity and rotation now, (B, 2, 3) [m/s, 1/s]."""
        return self._motion.reshape(-1, 2, 3)

    def _tabulate(self, time_step: float) -> None:
        """What a step leaves of the shells, (INTERVALS + 1, M, 2), at slips s with s/(s + half) in equal steps."""
        slowness = np.sqrt(self._viscosity * self._rate)  # νk
        self._step, self._half = time_step, float(slowness.max())
        part = np.linspace(0, 1, INTERVALS + 1)[:-1, None, None]
        left = self._half * part / (1 - part) / slowness
        fades = np.exp(-time_step * self._rate / _shared(left, self._along))
        self._fades = np.concatenate([fades, np.zeros((1, *fades.shape[1:]))])

    def advance(self, force: NDArray, torque: NDArray, time_step: float) -> None:
        """One step, at whose start the beads put these (B, 3) on the flow; all steps are equal."""
        if time_step != self._step:
            self._tabulate(time_step)
        self._loads = np.concatenate([np.concatenate([force, torque], axis=1)[None], self._loads[:2]])
        self._motion = np.empty_like(self._motion)  # the one before may still be looked at
        own = (self._fades, self._half, self._drag, time_step, self._weight, only_read(self._loads))
        in_shares(_advance, COST * len(self._parts), *own, self._parts, self._motion)

    def state(self) -> NDArray:
        """(B, M + S, 6): the parts, and the loads of up to three steps."""
        return np.concatenate([self._parts, self._loads.swapaxes(0, 1)], axis=1)

    def restore(self, state: NDArray) -> None:
        """Take back what state() gave. ValueError for another number of beads or shells."""
        beads = len(self._parts)
        if state.shape[0] != beads or not SHELLS <= state.shape[1] <= SHELLS + 3 or state.shape[2:] != (6,):
            raise ValueError(
                f"the own disturbance is {state.shape}; it must be ({beads}, {SHELLS} ... + 3, 6)"
            )
        self._parts = np.ascontiguousarray(state[:, :SHELLS], float)
        self._loads = np.ascontiguousarray(state[:, SHELLS:].swapaxes(0, 1), float)
        self._motion = np.empty_like(self._motion)
        in_shares(_sum, COST * beads, self._weight, self._parts, self._motion)


def prepare() -> None:
    """Compile or load the kernels."""
    own = OwnDisturbance((Kernel(*np.ones((3, SHELLS))),) * 2, 1.0, 1.0, 1)
    own.advance(np.zeros((1, 3)), np.zeros((1, 3)), 1.0)
    own.restore(own.state())
