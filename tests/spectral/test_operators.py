"""The fused slab-wise operators against the equations on whole arrays, and those against direct sums."""

import numpy as np
import pytest

from gbm_plugin.spectral.arrays import Arrays
from gbm_plugin.spectral.modes import Modes
from gbm_plugin.spectral.slabs import Slabs

from .fields import noise


def pair(n, precision="double", threads=1):
    modes = Modes(n, box=3.0)
    return Arrays(modes, 0.1, precision), Slabs(modes, 0.1, precision, threads)


def solenoidal(arrays, seed=0):
    u = arrays.to_modes(noise(arrays.modes.cells, seed) + 0.3)
    mean = u[:, 0, 0, 0].copy()
    u = arrays.project(u)
    u[:, 0, 0, 0] = mean
    return u


@pytest.mark.parametrize("n", [4, 6, 8, 10, 16, 22, 36])
@pytest.mark.parametrize("precision, bound", [("double", 3e-15), ("single", 2e-6)])
@pytest.mark.parametrize("threads", [1, 3])
def test_slabs_are_the_whole_arrays(n, precision, bound, threads):
    arrays, slabs = pair(n, precision, threads)
    u = solenoidal(arrays)
    assert (
        np.abs(slabs.to_physical(u) - arrays.to_physical(u)).max()
        < bound * np.abs(arrays.to_physical(u)).max()
    )
    one, other = arrays.zeros(), slabs.zeros()
    arrays.nonlinear(u, one, 0.7, want_speed=True)
    slabs.nonlinear(u, other, 0.7, want_speed=True)
    assert np.abs(one - other).max() < bound * np.abs(one).max()
    assert slabs.max_speed == pytest.approx(arrays.max_speed, rel=bound)
    terms = [(1.0, 0.1, u), (-0.5, 0.2, one), (0.25, 0.0, u)]
    a, b = (
        arrays.combine(one, terms),
        slabs.combine(other, [(c, t, u if x is u else other) for c, t, x in terms]),
    )
    assert np.abs(one - other).max() < bound * np.abs(one).max()
    assert a == pytest.approx(b, rel=2 * bound)
    assert one.dtype == other.dtype == arrays.complex


def test_threads_give_the_same_bits():
    results = []
    for threads in (1, 2, 3):
        arrays, slabs = pair(20, threads=threads)
        u, out = solenoidal(arrays), arrays.zeros()
        slabs.nonlinear(u, out, 0.2)
        energy = slabs.combine(out, [(1.0, 0.1, u), (0.3, 0.1, out)])
        results.append((out, energy))
    for out, energy in results[1:]:
        assert np.array_equal(out, results[0][0]) and energy == results[0][1]


def test_products_are_free_of_aliasing():
    """The nonlinear term at n points equals that of the same field on 2n points, truncated."""
    arrays, slabs = pair(12)
    u, out = solenoidal(arrays), arrays.zeros()
    slabs.nonlinear(u, out)
    fine = Arrays(Modes(24, box=3.0), 0.1)
    wide, wide_out = fine.zeros(), fine.zeros()
    cut = arrays.modes.cut
    place = np.ix_(range(3), arrays.modes.signed, arrays.modes.signed, range(cut + 1))
    wide[place] = u
    fine.nonlinear(wide, wide_out)
    assert np.abs(out - wide_out[place]).max() < 1e-14 * np.abs(out).max()


def test_nonlinear_term_by_convolution():
    """Three modes by hand: the sum over p + q = k of -i P(k) (q . u(p)) u(q), no transform involved."""
    modes = Modes(8, box=2 * np.pi)
    arrays, slabs = Arrays(modes, 0.1), Slabs(modes, 0.1)
    rng = np.random.default_rng(7)
    field = {}
    for k in [(1, 0, 0), (0, 1, 1), (1, -1, 1), (2, 1, 0)]:
        k = np.array(k)
        a = rng.normal(size=3) + 1j * rng.normal(size=3)
        a -= k * (k @ a) / (k @ k)
        field[tuple(k)], field[tuple(-k)] = a, a.conj()
    u, expected, out = arrays.zeros(), arrays.zeros(), arrays.zeros()
    for k, a in field.items():
        if k[2] >= 0:
            u[(slice(None), *k)] = a
    for p, a in field.items():
        for q, b in field.items():
            k = np.add(p, q)
            if np.abs(k).max() <= modes.cut and k[2] >= 0 and k.any():
                term = -1j * (np.array(q) @ a) * b
                expected[(slice(None), *k)] += term - k * (k @ term) / (k @ k)
    slabs.nonlinear(u, out)
    assert np.abs(out - expected).max() < 1e-14 * np.abs(expected).max()


def test_energy_and_derivatives_in_physical_space():
    arrays, _ = pair(14)
    u = solenoidal(arrays)
    v = arrays.to_physical(u)
    fluctuation = v - v.mean(axis=(1, 2, 3), keepdims=True)
    assert arrays.energy(u) == pytest.approx((fluctuation**2).sum(axis=0).mean() / 2, rel=1e-13)
    gradient = [arrays.to_physical(arrays.derivative(u, j)) for j in range(3)]  # [j][i]
    curl = np.stack(
        [gradient[1][2] - gradient[2][1], gradient[2][0] - gradient[0][2], gradient[0][1] - gradient[1][0]]
    )
    assert arrays.to_physical(arrays.curl(u)) == pytest.approx(curl, abs=1e-12)
    h = 1e-5  # central difference of the Fourier sum itself, along x
    shift = np.exp(1j * arrays.modes.k[0] * h)
    difference = arrays.to_physical(u * shift - u / shift) / (2 * h)
    assert gradient[0] == pytest.approx(difference, abs=1e-6)
