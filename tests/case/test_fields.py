"""Initial fields: what is asked for is there, on any lattice, and the same on all."""

from __future__ import annotations

import numpy as np
import pytest

from gbm_plugin.case.fields import FourierModes, abc, peaked_spectrum, random_modes, taylor_green_vortex


def direct(modes: FourierModes, x: np.ndarray) -> np.ndarray:
    """The sum of the definition at points (P, 3) of a box of width 2 pi: (P, 3)."""
    phase = np.exp(1j * x @ modes.wavevectors.T)
    return (phase @ modes.amplitudes).real


def points(cells, offset: float) -> np.ndarray:
    axes = [(np.arange(n) + offset) * 2 * np.pi / n for n in cells]
    return np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1)


@pytest.mark.parametrize("offset", [0.0, 0.5], ids=["nodes", "cell centres"])
@pytest.mark.parametrize("cells", [(12, 12, 12), (9, 12, 16)])
def test_lattice_values_are_those_of_the_sum(cells, offset):
    modes = random_modes({1: 0.3, 3: 0.1}, seed=4)
    u = modes.on_lattice(cells, offset)
    x = points(cells, offset)
    np.testing.assert_allclose(u, direct(modes, x.reshape(-1, 3)).T.reshape(3, *cells), atol=1e-12)


@pytest.mark.parametrize("seed", [0, 1, 99])
def test_energy_of_each_shell_is_met(seed):
    spectrum = {1: 0.2, 2: 0.0, 3: 0.05, 4: 1e-3}
    modes = random_modes(spectrum, seed)
    assert modes.kinetic_energy == pytest.approx(sum(spectrum.values()), rel=1e-12)
    n = 12
    u = np.fft.fftn(modes.on_lattice((n, n, n)), axes=(1, 2, 3)) / n**3
    k = np.fft.fftfreq(n, 1 / n)
    shell = np.rint(np.sqrt(sum(np.meshgrid(k**2, k**2, k**2, indexing="ij")))).astype(int)
    energy = np.bincount(shell.ravel(), 0.5 * (np.abs(u) ** 2).sum(axis=0).ravel())
    for number, wanted in spectrum.items():
        assert energy[number] == pytest.approx(wanted, rel=1e-12, abs=1e-15)
    assert energy.sum() == pytest.approx(sum(spectrum.values()), rel=1e-12)


def test_no_divergence_and_no_mean():
    modes = random_modes(peaked_spectrum(0.5, 2, 4), seed=1)
    assert np.abs((modes.wavevectors * modes.amplitudes).sum(axis=1)).max() < 1e-14
    assert np.abs(modes.on_lattice((10, 10, 10)).mean(axis=(1, 2, 3))).max() < 1e-15


def test_same_field_on_every_lattice():
    """Every second node of 24 is a node of 12."""
    modes = random_modes(peaked_spectrum(0.5, 2, 4), seed=7)
    np.testing.assert_allclose(
        modes.on_lattice((24,) * 3)[:, ::2, ::2, ::2], modes.on_lattice((12,) * 3), atol=1e-13
    )


def test_peaked_spectrum_has_its_sum_and_its_peak():
    spectrum = peaked_spectrum(0.7, 3.0, 12)
    assert sum(spectrum.values()) == pytest.approx(0.7)
    assert max(spectrum, key=spectrum.get) == 3  # of k^4 exp(-2 (k/peak)^2)


def test_taylor_green_vortex():
    x = points((8, 8, 8), 0.5)
    u = taylor_green_vortex(1.5).on_lattice((8, 8, 8), 0.5)
    sin, cos = np.sin(x), np.cos(x)
    expected = [
        sin[..., 0] * cos[..., 1] * cos[..., 2],
        -cos[..., 0] * sin[..., 1] * cos[..., 2],
        0 * x[..., 0],
    ]
    np.testing.assert_allclose(u, 1.5 * np.array(expected), atol=1e-14)


def test_abc_is_its_own_curl():
    a, b, c = 1.0, 0.7, 0.4
    x = points((8, 8, 8), 0.0)
    u = abc(a, b, c).on_lattice((8, 8, 8))
    expected = [
        a * np.sin(x[..., 2]) + c * np.cos(x[..., 1]),
        b * np.sin(x[..., 0]) + a * np.cos(x[..., 2]),
        c * np.sin(x[..., 1]) + b * np.cos(x[..., 0]),
    ]
    np.testing.assert_allclose(u, expected, atol=1e-14)
    modes = abc(a, b, c)
    np.testing.assert_allclose(
        1j * np.cross(modes.wavevectors, modes.amplitudes), modes.amplitudes, atol=1e-15
    )


def test_too_few_cells_are_refused():
    modes = random_modes({4: 1.0}, seed=1)
    with pytest.raises(ValueError, match=r"modes up to \(4, 4, 4\).*8, 16, 16"):
        modes.on_lattice((8, 16, 16))
    modes.on_lattice((9, 9, 9))


@pytest.mark.parametrize("spectrum", [{}, {1: 0.0}, {1: -1.0, 2: 1.0}, {0: 1.0, 1: 1.0}])
def test_spectrum_that_is_none(spectrum):
    with pytest.raises(ValueError, match="a spectrum needs shells of 1 and above"):
        random_modes(spectrum, seed=1)
