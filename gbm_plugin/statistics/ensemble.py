"""Averages over the fibers of one flow, which are correlated in time and with each other.

Fibers in one flow see the same swings of its dissipation, so that their number alone does not make an average
exact; a fiber that stays in one eddy makes many like records. Two errors know of these: that of the series of
averages over all fibers (correlation in time, and between fibers), and the spread between the fibers' own averages
over time (correlation in time, with few long correlated ones too). The larger counts.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from .series import mean


@dataclass(frozen=True)
class Estimate:
    """An average with its standard error. of_series: the error from the series of averages over fibers, None where
    that is too short for one; of_fibers: that of the fibers' spread, None for a single fiber; correlation_time: of
    the series, in its samples, None where unknown."""

    value: float
    error: float | None
    of_series: float | None
    of_fibers: float | None
    correlation_time: float | None

    def __str__(self) -> str:
        if not self.error:
            return f"{self.value:.4g}"
        digits = max(0, 1 - int(np.floor(np.log10(self.error))))
        return f"{self.value:.{digits}f} ± {self.error:.{digits}f}"


def fiber_average(values: ArrayLike) -> Estimate:
    """Average of values (T, F) at T equidistant times of F fibers. Raises ValueError for another shape or values that
    are not finite."""
    values = np.asarray(values, float)
    if values.ndim != 2 or 0 in values.shape:
        raise ValueError(f"values have shape {values.shape}; allowed is (T, F), none of them 0")
    if not np.isfinite(values).all():
        raise ValueError("values are not all finite")
    return estimate(values.mean(axis=1), values.mean(axis=0))


def estimate(series: ArrayLike, of_fibers: ArrayLike) -> Estimate:
    """The average of which those over fibers at each time (T,) and over the time of each fiber (F,) are known."""
    series, fibers = np.asarray(series, float), np.asarray(of_fibers, float)
    of_series = time = spread = None
    try:
        found = mean(series)
        of_series, time = found.error, found.correlation_time
    except ValueError:
        pass
    if len(fibers) > 1:
        spread = float(fibers.std(ddof=1) / np.sqrt(len(fibers)))
    known = [e for e in (of_series, spread) if e is not None]
    return Estimate(float(series.mean()), max(known, default=None), of_series, spread, time)


def jackknife_error(parts: ArrayLike) -> NDArray[np.float64]:
    """Standard error (...) of what was found M times, (M, ...), each time without one of M points: a fit tells its own
    where points lie off the curve by more than their errors."""
    parts = np.asarray(parts, float)
    return np.sqrt((len(parts) - 1) / len(parts) * ((parts - parts.mean(axis=0)) ** 2).sum(axis=0))


def correlation(values: ArrayLike, most: int) -> NDArray[np.float64]:
    """<v(t)·v(t + lag)>/<v²> for lags 0 … most of values (T, F, d), over fibers and times. ValueError where T is not
    larger than `most`."""
    values = np.asarray(values, float)
    if values.ndim != 3 or not 0 <= most < len(values):
        raise ValueError(f"values of shape {values.shape} have no lags up to {most}; (T, F, d) is needed")
    length = len(values)
    transform = np.fft.rfft(values, 2 * length, axis=0)
    power = (transform.real**2 + transform.imag**2).sum(axis=(1, 2))
    products = np.fft.irfft(power, 2 * length)[: most + 1] / (length - np.arange(most + 1))
    return products / products[0]


def integral_scale(correlation: ArrayLike) -> float:
    """Integral of a correlation (lags,) by the trapezoidal rule up to its first zero, in lags; to its end where it has
    none."""
    rho = np.asarray(correlation, float)
    below = np.flatnonzero(rho <= 0)
    rho = rho[: below[0] + 1].clip(min=0) if len(below) else rho
    return float(np.trapezoid(rho))
