"""Initial velocity fields as lists of Fourier modes, the same for every engine and every resolution."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True)
class FourierModes:
    """u(x) = sum over modes of Re[a exp(i 2 pi (m . (x - origin)/box))], a real field.

    wavevectors m: (M, 3) integers; amplitudes a: (M, 3) complex, with a . (m/box) = 0 [m/s].
    """

    wavevectors: np.ndarray
    amplitudes: np.ndarray

    def on_lattice(self, cells: tuple[int, int, int], offset: float = 0.0) -> np.ndarray:
        """Velocity (3, nx, ny, nz) at x_i = (i + offset) box/n: offset 0 for spectral nodes, 1/2 for cell
        centres. ValueError where the cells are too few for the highest mode."""
        self.must_fit(cells)
        cells = np.asarray(cells)
        phase = np.exp(2j * np.pi * offset * (self.wavevectors / cells).sum(axis=1))
        index = tuple(self.wavevectors.T % cells[:, None])
        out = np.empty((3, *cells))
        for component in range(3):
            half = np.zeros(cells, dtype=complex)
            np.add.at(half, index, self.amplitudes[:, component] * phase)
            out[component] = np.fft.ifftn(half).real * cells.prod()
        return out

    def must_fit(self, cells: tuple[int, int, int]) -> None:
        """ValueError where the cells are too few for the highest mode."""
        highest = np.abs(self.wavevectors).max(axis=0, initial=0)
        if np.any(2 * highest >= cells):
            raise ValueError(
                f"the initial field has modes up to {tuple(map(int, highest))} in x, y, z, which "
                f"{tuple(map(int, cells))} cells cannot hold: more than twice as many are needed"
            )

    @property
    def kinetic_energy(self) -> float:
        """Mean of u^2/2 [m2/s2] of a list whose wavevectors are all different, none zero or opposite."""
        return float(np.sum(np.abs(self.amplitudes) ** 2) / 4)


def _half_space(highest: int) -> np.ndarray:
    """One of each pair m, -m of integer vectors with 0 < |m| <= highest, in order of |m|."""
    line = np.arange(-highest, highest + 1)
    m = np.stack(np.meshgrid(line, line, line, indexing="ij"), axis=-1).reshape(-1, 3)
    square = (m**2).sum(axis=1)
    upper = (m[:, 0] > 0) | ((m[:, 0] == 0) & ((m[:, 1] > 0) | ((m[:, 1] == 0) & (m[:, 2] > 0))))
    m = m[upper & (square <= highest**2)]
    order = np.lexsort((m[:, 2], m[:, 1], m[:, 0], (m**2).sum(axis=1)))
    return m[order]


def random_modes(spectrum: dict[int, float], seed: int, box: float = 2 * np.pi) -> FourierModes:
    """A random, isotropic, divergence-free field of a cubic box.

    spectrum: {shell: energy}: the mean kinetic energy [m2/s2] of the modes with |m| rounded to that shell,
    E(k) dk with dk = 2 pi/box, met exactly. The modes do not depend on the number of cells.
    """
    highest = max((shell for shell, energy in spectrum.items() if energy > 0), default=0)
    if highest < 1 or min(spectrum.values()) < 0 or min(spectrum) < 1:
        raise ValueError("a spectrum needs shells of 1 and above with energies that are not negative")
    m = _half_space(highest)
    length = np.sqrt((m**2).sum(axis=1))
    rng = np.random.default_rng(seed)
    a = rng.standard_normal((len(m), 3)) + 1j * rng.standard_normal((len(m), 3))
    direction = m / length[:, None]
    a -= (a * direction).sum(axis=1, keepdims=True) * direction
    shell = np.rint(length).astype(int)
    energy = np.bincount(shell, (np.abs(a) ** 2).sum(axis=1) / 4, minlength=highest + 1)
    wanted = np.array([spectrum.get(i, 0.0) for i in range(highest + 1)])
    with np.errstate(divide="ignore", invalid="ignore"):
        scale = np.where(energy > 0, np.sqrt(wanted / energy), 0.0)
    keep = wanted[shell] > 0
    return FourierModes(m[keep], (a * scale[shell][:, None])[keep])


def peaked_spectrum(kinetic_energy: float, peak: float, highest: int) -> dict[int, float]:
    """E(k) ~ k^4 exp(-2 (k/peak)^2) in the shells 1...highest, with this sum [m2/s2]."""
    k = np.arange(1, highest + 1)
    e = (k / peak) ** 4 * np.exp(-2 * (k / peak) ** 2)
    return dict(zip(k.tolist(), (kinetic_energy * e / e.sum()).tolist(), strict=True))


def taylor_green_vortex(velocity: float) -> FourierModes:
    """The decaying three-dimensional vortex, not the cells of flow.TaylorGreen: (sin x cos y cos z, -cos x sin y cos z,
    0) times velocity, x in units of box/2 pi."""
    signs = np.array([(1, s, t) for s in (1, -1) for t in (1, -1)])
    # sin x cos y cos z = Re sum over s, t of -i/4 e^{i(x + s y + t z)}; the second term with -s
    a = np.zeros((4, 3), dtype=complex)
    a[:, 0] = -0.25j * velocity
    a[:, 1] = 0.25j * velocity * signs[:, 1]
    return FourierModes(signs, a)


def abc(a: float, b: float, c: float) -> FourierModes:
    """Arnold-Beltrami-Childress flow (A sin z + C cos y, B sin x + A cos z, C sin y + B cos x)."""
    m = np.array([(0, 0, 1), (1, 0, 0), (0, 1, 0)])
    amplitudes = np.array([(-1j * a, a, 0), (0, -1j * b, b), (c, 0, -1j * c)])
    return FourierModes(m, amplitudes)
