"""Averages of a stationary run with standard errors: flow from its table and its written fields, fibers from
their recording.

Errors of numbers take the correlation in time from the series itself (statistics/series.py); those of curves,
point by point, from the scatter of independent blocks of the run.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ...case.layout import as_time
from ...case.layout import results as results_of
from ...output.field import read_velocity
from ...output.recording import open_recording
from ...output.tables import read_forcing
from ...statistics import series
from ...statistics.fibers import end_to_end_squared_ratio, mean_curvature
from ...statistics.turbulence import differenced_dissipation, energy_spectrum, field_statistics

BLOCKS = 10  # of a curve's error; each must be longer than the correlation time
TABLE = {  # of the forcing
    "k": "k",
    "u'": "uPrime",
    "Re_lambda": "ReLambda",
    "eps budget": "epsilonBudget",
    "eps gradient": "epsilonGradient",
    "eps laplacian": "epsilonLaplacian",
}
FIELD = {  # of field_statistics
    "eps spectrum": "dissipation",
    "integral length": "integral_length",
    "skewness": "velocity_skewness",
    "flatness": "velocity_flatness",
}


@dataclass(frozen=True)
class Averages:
    """numbers: {name: (mean, standard error)}; spectrum: k (K,) and E(k) of each field (S, K); curvature: mean
    curvature of each fiber times its length 2aN, (S, F), by family; fields: velocities (S, 3, n, n, n)."""

    numbers: dict[str, tuple[float, float]]
    k: NDArray
    spectra: NDArray
    curvature: dict[str, NDArray]
    fields: list[NDArray]

    def read_with(self, spacing: float, box: float, viscosity: float) -> dict[str, tuple[float, float]]:
        """What a finite-volume mesh of this spacing [m] would read of the dissipation of these very fields."""
        readings = [differenced_dissipation(u, box, viscosity, spacing) for u in self.fields]
        return {f"eps {name}": _mean([r[name] for r in readings]) for name in readings[0]}


def averages(results: Path, cells: int, box: float, viscosity: float, since: float, highest: int) -> Averages:
    """Averages over all that is later than `since` [s]; spectra up to `highest` waves per box. Raises
    ValueError where that is too short for an error."""
    table = read_forcing(results)
    late = table["Time"] > since
    numbers = {name: _mean(table[column][late]) for name, column in TABLE.items()}
    lost = _mean((table["epsilonBudget"] - table["epsilonLaplacian"])[late])
    budget = numbers["eps budget"][0]
    numbers["numerical dissipation / eps"] = (lost[0] / budget, lost[1] / budget)

    times = {as_time(path.parent.name): path.parent.name for path in results.glob("*/U")}
    late_times = sorted(t for t in times if t is not None and t > since)
    fields = [read_velocity(results, times[t], (cells,) * 3) for t in late_times]
    found = [field_statistics(u, box, viscosity) for u in fields]
    numbers |= {name: _mean([f[entry] for f in found]) for name, entry in FIELD.items()}
    spectra = [energy_spectrum(u, box) for u in fields]

    curvature = {}
    with open_recording(results_of(results)) as recording:
        kept = recording.times > since
        for name, family in recording.families.items():
            positions, length = family.positions[kept], 2 * family.radius * family.beads
            ratio = end_to_end_squared_ratio(positions, family.radius)
            curvature[name] = mean_curvature(positions, family.radius) * length
            numbers[f"<R2>/L2 {name}"] = _mean(ratio.mean(axis=1))
            numbers[f"<curvature> L {name}"] = _mean(curvature[name].mean(axis=1))
    resolved = slice(1, highest + 1)
    return Averages(
        numbers,
        spectra[0][0][resolved],
        np.array([e[resolved] for _, e in spectra]),
        curvature,
        fields,
    )


def density(samples: NDArray, edges: NDArray) -> tuple[NDArray, NDArray]:
    """Probability density of samples (S, F) in bins, and its standard error by blocks of S, (bins,) each."""
    blocks = [np.histogram(part, edges)[0] / part.size for part in np.array_split(samples, BLOCKS)]
    return _over_blocks(np.array(blocks) / np.diff(edges))


def curve(values: NDArray) -> tuple[NDArray, NDArray]:
    """Mean of curves (S, K) and its standard error by blocks of S, (K,) each."""
    return _over_blocks(np.array([part.mean(axis=0) for part in np.array_split(values, BLOCKS)]))


def _over_blocks(values: NDArray) -> tuple[NDArray, NDArray]:
    return values.mean(axis=0), values.std(axis=0, ddof=1) / np.sqrt(len(values))


def _mean(values) -> tuple[float, float]:
    mean = series.mean(values)
    return mean.value, mean.error
