"""Homogeneous turbulence in numbers: spectra, scales and gradient moments of a periodic velocity field.

Every function takes plain arrays, so that a spectral solver and a finite-volume field are judged by the same
code. Averages <.> are over the box; the kinetic energy includes the mean flow, every fluctuation (u' and what
follows from it) excludes it.
"""

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..scales import kolmogorov_length, kolmogorov_time

Box = float | tuple[float, float, float]
CHUNK = 1 << 16  # values handled at once: temporaries stay in the cache


def wavenumbers(shape: tuple[int, int, int], box: Box) -> list[NDArray]:
    """Wavenumbers of `numpy.fft.rfftn`, shaped to broadcast: (nx, 1, 1), (1, ny, 1), (1, 1, nz//2 + 1)."""
    lengths = np.broadcast_to(np.asarray(box, float), (3,))
    if not np.all(lengths > 0):
        raise ValueError(f"box must be positive, got {box}")
    scale = 2 * np.pi / lengths
    counts = [np.fft.fftfreq(n, 1 / n) for n in shape[:2]] + [np.fft.rfftfreq(shape[2], 1 / shape[2])]
    return [
        (c * s).reshape([-1 if a == axis else 1 for a in range(3)])
        for axis, (c, s) in enumerate(zip(counts, scale, strict=True))
    ]


def half_weights(nz: int) -> NDArray:
    """How often each kz of a real transform counts in a sum over modes: 1 for kz = 0 and Nyquist, else 2."""
    weights = np.full(nz // 2 + 1, 2.0)
    weights[0] = 1.0
    if nz % 2 == 0:
        weights[-1] = 1.0
    return weights


def shell_spectrum(mode_energy: NDArray, k: list[NDArray], k0: float) -> tuple[NDArray, NDArray]:
    """Sum the modes' energies over shells |k|/k0 in [m - 1/2, m + 1/2): k_m and E_m, sum(E) k0 = energy."""
    shell = np.rint(np.sqrt(k[0] ** 2 + k[1] ** 2 + k[2] ** 2) / k0).astype(np.intp)
    energy = np.bincount(shell.ravel(), weights=mode_energy.ravel())
    return k0 * np.arange(energy.size), energy / k0


def energy_spectrum(velocity: ArrayLike, box: Box) -> tuple[NDArray, NDArray]:
    """Three-dimensional energy spectrum E(k) of a periodic field, eq. (16) of the paper.

    velocity (3, nx, ny, nz) on equidistant points; box: edge length or (Lx, Ly, Lz).
    Returns k (S,) = k0 (0, 1, 2, ...) and E (S,), with k0 = 2 pi / (longest edge) and shells of width k0
    centred on k; sum(E) k0 = <|u|^2>/2 for any field.
    """
    velocity = _checked(velocity)
    k = wavenumbers(velocity.shape[1:], box)
    mode_energy, _ = _mode_energies(velocity)
    return shell_spectrum(mode_energy, k, 2 * np.pi / float(np.max(box)))


def dissipation_spectrum(k: ArrayLike, spectrum: ArrayLike, viscosity: float) -> NDArray:
    """D(k) = 2 nu k^2 E(k), the integrand of eq. (17) of the paper."""
    return 2 * viscosity * np.asarray(k) ** 2 * np.asarray(spectrum)


def spectrum_statistics(k: ArrayLike, spectrum: ArrayLike, viscosity: float) -> dict[str, float]:
    """Energy, dissipation (eq. (17), with k at the shell's centre) and all scales, from a spectrum alone."""
    k, spectrum = np.asarray(k, float), np.asarray(spectrum, float)
    k0 = k[1] - k[0]
    dissipation = float(k0 * dissipation_spectrum(k, spectrum, viscosity).sum())
    return scales(k, spectrum, dissipation, viscosity)


def scales(k: NDArray, spectrum: NDArray, dissipation: float, viscosity: float) -> dict[str, float]:
    """One-point energies and the length, time and Reynolds numbers of isotropic turbulence.

    kinetic_energy <|u|^2>/2; dissipation eps; velocity_rms u' = (2/3 k_fluctuation)^(1/2);
    enstrophy eps/(2 nu) = <|omega|^2>/2; taylor_length (15 nu u'^2/eps)^(1/2); taylor_reynolds u' lambda/nu;
    kolmogorov_length (nu^3/eps)^(1/4); kolmogorov_time (nu/eps)^(1/2);
    integral_length (pi/2u'^2) int E/k dk; dissipation_length u'^3/eps; turnover_time integral_length/u'.
    A fluid at rest has NaN for the ratios that it does not define.
    """
    k0 = k[1] - k[0]
    fluctuation = k0 * spectrum[1:].sum()
    rms = np.sqrt(2 * fluctuation / 3)
    with np.errstate(divide="ignore", invalid="ignore"):
        taylor = np.sqrt(15 * viscosity * rms**2 / np.float64(dissipation))
        integral = np.pi / 2 * (spectrum[1:] / k[1:]).sum() * k0 / rms**2
        found = {
            "kinetic_energy": k0 * spectrum.sum(),
            "dissipation": dissipation,
            "velocity_rms": rms,
            "enstrophy": dissipation / np.float64(2 * viscosity),
            "taylor_length": taylor,
            "taylor_reynolds": rms * taylor / np.float64(viscosity),
            "kolmogorov_length": kolmogorov_length(viscosity, dissipation),
            "kolmogorov_time": kolmogorov_time(viscosity, dissipation),
            "integral_length": integral,
            "dissipation_length": rms**3 / np.float64(dissipation),
            "turnover_time": integral / rms,
        }
    return {name: float(value) for name, value in found.items()}


def gradient_moments(longitudinal: ArrayLike) -> dict[str, float]:
    """Skewness <g^3>/<g^2>^(3/2) and flatness <g^4>/<g^2>^2 of derivatives g = du_i/dx_i (no sum).

    longitudinal (3, ...): the three derivatives, pooled.
    """
    g = np.asarray(longitudinal).reshape(-1)
    sums = np.zeros(3)
    for start in range(0, g.size, CHUNK):
        part = g[start : start + CHUNK].astype(float)
        square = part * part
        sums += square.sum(), (square * part).sum(), (square * square).sum()
    second, third, fourth = sums / g.size
    with np.errstate(divide="ignore", invalid="ignore"):
        return {
            "velocity_skewness": float(third / second**1.5),
            "velocity_flatness": float(fourth / second**2),
        }


def field_statistics(velocity: ArrayLike, box: Box, viscosity: float) -> dict[str, float]:
    """Scales and gradient moments of a periodic field (3, nx, ny, nz), derivatives being spectrally exact."""
    velocity = _checked(velocity)
    k = wavenumbers(velocity.shape[1:], box)
    mode_energy, modes = _mode_energies(velocity)
    k_squared = k[0] ** 2 + k[1] ** 2 + k[2] ** 2
    dissipation = 2 * viscosity * float((k_squared * mode_energy).sum())
    spectrum = shell_spectrum(mode_energy, k, 2 * np.pi / float(np.max(box)))
    longitudinal = [
        np.fft.irfftn(1j * _without_nyquist(k[i], n) * modes[i], s=velocity.shape[1:], axes=(0, 1, 2))
        for i, n in enumerate(velocity.shape[1:])
    ]
    return scales(*spectrum, dissipation, viscosity) | gradient_moments(longitudinal)


def differenced_dissipation(
    velocity: ArrayLike, box: float, viscosity: float, spacing: float
) -> dict[str, float]:
    """What second-order differences over `spacing` h [m] read of the dissipation of a periodic field (3, n, n, n).

    gradient: nu <|grad_h u|^2> with central differences over 2h, k_i -> sin(k_i h)/h; laplacian: nu <u . lap_h u>
    with the compact one, k_i -> 2 sin(k_i h/2)/h. The field may be given on other points than those apart by h.
    """
    velocity = _checked(velocity)
    k = wavenumbers(velocity.shape[1:], box)
    mode_energy, _ = _mode_energies(velocity)
    readings = {
        "gradient": sum((np.sin(c * spacing) / spacing) ** 2 for c in k),
        "laplacian": sum((2 * np.sin(c * spacing / 2) / spacing) ** 2 for c in k),
    }
    return {name: 2 * viscosity * float((q * mode_energy).sum()) for name, q in readings.items()}


def _checked(velocity: ArrayLike) -> NDArray:
    velocity = np.asarray(velocity)
    if velocity.ndim != 4 or velocity.shape[0] != 3:
        raise ValueError(f"velocity must have shape (3, nx, ny, nz), got {velocity.shape}")
    return velocity


def _mode_energies(velocity: NDArray) -> tuple[NDArray, NDArray]:
    """Energy of each mode of the half space kz >= 0, and the transform itself (unnormalised)."""
    modes = np.fft.rfftn(velocity, axes=(1, 2, 3))
    size = np.prod(velocity.shape[1:], dtype=float)
    squares = (modes.real**2 + modes.imag**2).sum(axis=0)
    return 0.5 * half_weights(velocity.shape[3]) * squares / size**2, modes


def _without_nyquist(k: NDArray, points: int) -> NDArray:
    """A real field has no first derivative at the Nyquist wavenumber."""
    return np.where(np.abs(k) < np.abs(k).max() * (1 - 1e-12), k, 0.0) if points % 2 == 0 else k
