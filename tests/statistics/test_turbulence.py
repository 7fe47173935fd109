"""Spectra and scales against fields whose energy, dissipation and moments are known by hand."""

import numpy as np
import pytest

from gbm_plugin.statistics import turbulence


def grid(shape, box):
    axes = [np.arange(n) * length / n for n, length in zip(shape, box, strict=True)]
    return np.meshgrid(*axes, indexing="ij")


@pytest.mark.parametrize("shape", [(8, 8, 8), (9, 9, 9), (8, 12, 6), (7, 8, 9)])
@pytest.mark.parametrize("box", [2 * np.pi, (1.0, 1.5, 0.75)])
def test_shells_hold_all_the_energy(shape, box):
    u = np.random.default_rng(0).standard_normal((3, *shape)) + np.array([1, -2, 3]).reshape(3, 1, 1, 1)
    k, spectrum = turbulence.energy_spectrum(u, box)
    assert k[1] == pytest.approx(2 * np.pi / np.max(box))
    assert spectrum.sum() * k[1] == pytest.approx((u**2).sum(axis=0).mean() / 2, rel=1e-13)
    assert spectrum[0] * k[1] == pytest.approx((u.mean(axis=(1, 2, 3)) ** 2).sum() / 2, rel=1e-12)


@pytest.mark.parametrize("count", [(1, 0, 0), (3, 4, 0), (2, 2, 1), (0, 0, 5)])
def test_single_wave_lands_in_its_shell(count):
    box, n = 3.0, 12
    k0 = 2 * np.pi / box
    phase = sum(c * k0 * x for c, x in zip(count, grid((n,) * 3, (box,) * 3), strict=True))
    u = np.array([np.cos(phase), np.sin(phase), 0 * phase])  # |u|^2 = 1 everywhere
    k, spectrum = turbulence.energy_spectrum(u, box)
    shell = round(np.linalg.norm(count))
    assert spectrum[shell] * k0 == pytest.approx(0.5, rel=1e-13)
    assert np.delete(spectrum, shell) == pytest.approx(0.0, abs=1e-15)
    assert turbulence.spectrum_statistics(k, spectrum, 0.1)["dissipation"] == pytest.approx(
        2 * 0.1 * (shell * k0) ** 2 * 0.5
    )


def test_taylor_green_scales():
    """u = (sin x cos y cos z, -cos x sin y cos z, 0): k = 1/8, enstrophy 3/8, |k|^2 = 3."""
    x, y, z = grid((16,) * 3, (2 * np.pi,) * 3)
    u = np.array([np.sin(x) * np.cos(y) * np.cos(z), -np.cos(x) * np.sin(y) * np.cos(z), 0 * x])
    nu = 0.02
    found = turbulence.field_statistics(u, 2 * np.pi, nu)
    rms = np.sqrt(2 / 3 / 8)
    eps = 2 * nu * 3 / 8
    assert found["kinetic_energy"] == pytest.approx(1 / 8)
    assert found["enstrophy"] == pytest.approx(3 / 8)
    assert found["dissipation"] == pytest.approx(eps)
    assert found["velocity_rms"] == pytest.approx(rms)
    assert found["taylor_length"] == pytest.approx(np.sqrt(15 * nu * rms**2 / eps))
    assert found["taylor_reynolds"] == pytest.approx(rms * np.sqrt(15 * nu * rms**2 / eps) / nu)
    assert found["kolmogorov_length"] == pytest.approx((nu**3 / eps) ** 0.25)
    assert found["dissipation_length"] == pytest.approx(rms**3 / eps)
    # |k| = sqrt(3) lies in the shell centred on 2
    assert found["integral_length"] == pytest.approx(np.pi / (2 * rms**2) * (1 / 8) / 2)
    assert found["velocity_skewness"] == pytest.approx(0.0, abs=1e-13)


def test_gradient_moments_of_known_distributions():
    """One-sided exponential: skewness 2, kurtosis 9; Gaussian 0 and 3 (errors ~ 1/sqrt(samples))."""
    rng = np.random.default_rng(3)
    gauss = turbulence.gradient_moments(rng.standard_normal((3, 400_000)))
    assert gauss["velocity_skewness"] == pytest.approx(0.0, abs=0.01)
    assert gauss["velocity_flatness"] == pytest.approx(3.0, abs=0.03)
    exponential = turbulence.gradient_moments(rng.exponential(size=(3, 400_000)) - 1)
    assert exponential["velocity_skewness"] == pytest.approx(2.0, abs=0.05)
    assert exponential["velocity_flatness"] == pytest.approx(9.0, abs=0.5)


def test_field_moments_see_the_derivative():
    """u_x = sin x + a sin 2x: <(cos x + 2a cos 2x)^3> = 3 (2a)/4 by orthogonality."""
    n, a = 24, 0.3
    x, y, z = grid((n,) * 3, (2 * np.pi,) * 3)
    u = np.array([np.sin(s) + a * np.sin(2 * s) for s in (x, y, z)])
    found = turbulence.field_statistics(u, 2 * np.pi, 1.0)
    variance = 0.5 + 2 * a**2
    assert found["velocity_skewness"] == pytest.approx(3 * 2 * a / 4 / variance**1.5, rel=1e-12)


def test_mean_flow_changes_no_fluctuation():
    u = np.random.default_rng(5).standard_normal((3, 8, 8, 8))
    still = turbulence.field_statistics(u, 1.0, 0.1)
    moving = turbulence.field_statistics(u + 7.0, 1.0, 0.1)
    still_mean = u.mean(axis=(1, 2, 3))
    assert moving.pop("kinetic_energy") - still.pop("kinetic_energy") == pytest.approx(
        ((still_mean + 7) ** 2 - still_mean**2).sum() / 2
    )
    assert moving == pytest.approx(still, rel=1e-11)


def test_scaling_with_the_box():
    """x -> 2x at equal velocities: lengths double, dissipation at equal Reynolds number halves."""
    u = np.random.default_rng(6).standard_normal((3, 8, 8, 8))
    small, large = turbulence.field_statistics(u, 1.0, 0.1), turbulence.field_statistics(u, 2.0, 0.2)
    for name in ("taylor_length", "kolmogorov_length", "integral_length", "dissipation_length"):
        assert large[name] == pytest.approx(2 * small[name])
    assert large["dissipation"] == pytest.approx(small["dissipation"] / 2)
    assert large["taylor_reynolds"] == pytest.approx(small["taylor_reynolds"])


def test_refusals():
    with pytest.raises(ValueError, match=r"\(3, nx, ny, nz\)"):
        turbulence.energy_spectrum(np.zeros((8, 8, 8)), 1.0)
    with pytest.raises(ValueError, match="box must be positive"):
        turbulence.energy_spectrum(np.zeros((3, 8, 8, 8)), -1.0)


def test_differenced_dissipation_is_that_of_the_differences():
    """On the points of the field itself, the same as differences taken there; far finer, the dissipation."""
    n, nu = 12, 0.3
    u = np.random.default_rng(5).standard_normal((3, n, n, n))
    h = 2 * np.pi / n
    read = turbulence.differenced_dissipation(u, 2 * np.pi, nu, h)
    central = [(np.roll(u, -1, axis) - np.roll(u, 1, axis)) / (2 * h) for axis in (1, 2, 3)]
    assert read["gradient"] == pytest.approx(nu * sum((g**2).sum(0).mean() for g in central))
    compact = sum((np.roll(u, -1, axis) - 2 * u + np.roll(u, 1, axis)) / h**2 for axis in (1, 2, 3))
    assert read["laplacian"] == pytest.approx(-nu * (u * compact).sum(0).mean())
    exact = turbulence.field_statistics(u, 2 * np.pi, nu)["dissipation"]
    fine = turbulence.differenced_dissipation(u, 2 * np.pi, nu, 1e-3)
    assert fine["gradient"] == pytest.approx(exact, rel=1e-4) and fine["laplacian"] == pytest.approx(
        exact, rel=1e-4
    )
