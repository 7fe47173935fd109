"""Means of correlated time series with honest standard errors.

N samples of a stationary process with integral correlation time tau (in samples, tau = 1/2 + sum of the
autocorrelation) carry N/(2 tau) independent values: the error of the mean is sigma (2 tau/N)^(1/2). tau is
summed to the first lag M >= 5 tau (Sokal 1997, "Monte Carlo methods in statistical mechanics", sec. 3): the
bias of the cut is exp(-5) for an exponential correlation while the noise of the tail is left out.
"""

import csv
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike, NDArray

WINDOW = 5.0  # cut of the correlation sum, in integral times


@dataclass(frozen=True)
class Mean:
    """A time average: its value, standard error, integral correlation time and the series' length.

    correlation_time and duration are in units of the sample spacing given to `mean`.
    """

    value: float
    error: float
    correlation_time: float
    duration: float

    def __str__(self) -> str:
        digits = 6 if self.error == 0 else max(0, 1 - int(np.floor(np.log10(self.error))))
        return f"{self.value:.{digits}f} ± {self.error:.{digits}f}"


def autocorrelation(series: ArrayLike) -> NDArray:
    """Autocorrelation rho (N,) at lags 0 ... N-1 of a series (N,), biased estimator, rho[0] = 1."""
    deviation = _checked(series)
    deviation = deviation - deviation.mean()
    transform = np.fft.rfft(deviation, 2 * deviation.size)
    covariance = np.fft.irfft(np.abs(transform) ** 2)[: deviation.size]
    return covariance / covariance[0]


def integral_time(series: ArrayLike) -> float:
    """Integral correlation time 1/2 + sum_{l>=1} rho(l), in samples; 1/2 for white noise.

    Raises ValueError when the series is shorter than 10 integral times: no error bar can be trusted then.
    """
    series = _checked(series)
    if np.ptp(series) <= 1e-13 * np.abs(series).max(initial=0.0):
        return 0.5
    running = np.cumsum(autocorrelation(series)) - 0.5
    lags = np.arange(series.size)
    closed = lags >= WINDOW * running
    cut = int(np.argmax(closed)) if closed.any() else series.size
    tau = max(float(running[min(cut, series.size - 1)]), 0.5)
    if series.size < 10 * tau:
        raise ValueError(
            f"{series.size} samples are too short a series for a correlation time of {tau:.3g} samples"
        )
    # the sample mean removes its own variance from every lag (Sokal, loc. cit.)
    return tau * (1 + (2 * cut + 1) / series.size)


def mean(series: ArrayLike, spacing: float = 1.0) -> Mean:
    """Mean of a stationary correlated series (N,) and its standard error; spacing: time between samples."""
    series = _checked(series)
    tau = integral_time(series)
    independent = series.size / (2 * tau)
    variance = series.var() * independent / max(independent - 1, 1)
    error = float(np.sqrt(variance / independent))
    return Mean(float(series.mean()), error, tau * spacing, series.size * spacing)


def batch_means(series: ArrayLike, batches: int = 20) -> tuple[float, float]:
    """Mean and standard error from the scatter of `batches` equal consecutive blocks: an independent check.

    Right only when a block is much longer than the correlation time.
    """
    series = _checked(series)
    if not 2 <= batches <= series.size:
        raise ValueError(f"batches must lie in 2 ... {series.size}, got {batches}")
    blocks = series[series.size % batches :].reshape(batches, -1).mean(axis=1)
    return float(blocks.mean()), float(blocks.std(ddof=1) / np.sqrt(batches))


class TimeSeries:
    """Quantities recorded at equal intervals of time, with their running averages.

    `record` adds one line, `mean` averages what lies at or after a time; `write` and `read`
    are a CSV file with the columns time, name, name, ...
    """

    def __init__(self) -> None:
        self.columns: dict[str, list[float]] = {}

    def record(self, time: float, values: dict[str, float]) -> None:
        """Add the values at a time; the names are those of the first record."""
        line = {"time": time} | values
        if self.columns and line.keys() != self.columns.keys():
            raise ValueError(f"recorded are {', '.join(self.columns)}, given {', '.join(line)}")
        for name, value in line.items():
            self.columns.setdefault(name, []).append(float(value))

    def __len__(self) -> int:
        return len(self.columns.get("time", ()))

    def __getitem__(self, name: str) -> NDArray:
        """All values of a quantity, or "time"."""
        return np.array(self.columns[name])

    def mean(self, name: str, since: float = -np.inf) -> Mean:
        """Average of a quantity from time `since` on, with its standard error."""
        time = self["time"]
        kept = time >= since
        if kept.sum() < 2:
            raise ValueError(f"fewer than two samples at or after t = {since:g}")
        return mean(self[name][kept], spacing=float(np.diff(time[kept]).mean()))

    def until(self, time: float) -> "TimeSeries":
        """The part up to and including a time."""
        part, kept = TimeSeries(), self["time"] <= time
        part.columns = {name: self[name][kept].tolist() for name in self.columns}
        return part

    def write(self, path: Path | str) -> None:
        """Write a CSV file."""
        with open(path, "w", newline="") as file:
            writer = csv.writer(file)
            writer.writerow(self.columns)
            writer.writerows(zip(*([f"{v:.7g}" for v in c] for c in self.columns.values()), strict=True))

    @classmethod
    def read(cls, path: Path | str) -> "TimeSeries":
        """Read what `write` wrote."""
        with open(path, newline="") as file:
            names, *lines = csv.reader(file)
        series = cls()
        series.columns = {name: [float(line[i]) for line in lines] for i, name in enumerate(names)}
        return series


def _checked(series: ArrayLike) -> NDArray:
    series = np.asarray(series, float)
    if series.ndim != 1 or series.size < 2:
        raise ValueError(f"series must be one-dimensional with at least 2 samples, got shape {series.shape}")
    if not np.isfinite(series).all():
        raise ValueError(f"series is not finite at sample {int(np.argmin(np.isfinite(series)))}")
    return series
