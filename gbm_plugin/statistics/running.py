"""Statistics of fibers gathered while they move, sample by sample, so that a long run needs no long recording.

What is gathered is the same as from the recording at the same times, to rounding: averages with errors that know
correlation in time and between fibers (`ensemble`), moments, histograms, correlations in time. Some of it belongs
to each fiber and some to all together. Fibers that several processes share are put together by `merged`: what is of
fibers side by side, what is of all added.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..arrays import Form, check_arrays
from .ensemble import Estimate, estimate
from .fibers import end_to_end, gyration_radius, mean_curvature

BINS = 200
POWERS = 4
MOST = 1 << 40  # samples

# of the histograms' bins; what lies outside counts in the one at the end
EDGES = {
    "R2": np.linspace(0, 1, BINS + 1),
    "projected": np.linspace(0, 1, BINS + 1),
    "Rg": np.linspace(0, 0.5, BINS + 1),
    "curvature": np.concatenate([[0.0], np.logspace(-5, 2, BINS)]),
}


class Average:
    """Of one number of each fiber, with its moments and its histogram. sums: over all fibers at each time; of_fibers:
    over all times of each fiber; powers: of the first to fourth power, over both."""

    def __init__(self, fibers: int, edges: NDArray):
        self.edges = edges
        self.sums: list[float] = []
        self.of_fibers = np.zeros(fibers)
        self.powers = np.zeros(POWERS)
        self.counts = np.zeros(len(edges) - 1, np.int64)

    def add(self, values: NDArray) -> None:
        """One sample (F,)."""
        self.sums.append(float(values.sum()))
        self.of_fibers += values
        self.powers += [(values**p).sum() for p in range(1, POWERS + 1)]
        self.counts += _histogram(values, self.edges)

    def estimate(self) -> Estimate:
        """The average with its standard error, as `ensemble.fiber_average` has it."""
        fibers = len(self.of_fibers)
        return estimate(np.array(self.sums) / fibers, self.of_fibers / len(self.sums))

    def moments(self) -> NDArray:
        """<v>, <v²>, <v³>, <v⁴>."""
        return self.powers / (len(self.sums) * len(self.of_fibers))

    def density(self) -> NDArray:
        """In the bins; its integral is 1."""
        return self.counts / (self.counts.sum() * np.diff(self.edges))


class Correlation:
    """<v(t)·v(t + lag)> of vectors (F, d) at lags of 0 … lags samples. The latest samples are kept."""

    def __init__(self, fibers: int, dimensions: int, lags: int):
        self.products = np.zeros(lags + 1)
        self.pairs = np.zeros(lags + 1, np.int64)
        self.recent = np.zeros((0, fibers, dimensions))  # newest first

    def add(self, values: NDArray) -> None:
        """One sample (F, d)."""
        self.recent = np.concatenate([values[None], self.recent[: len(self.products) - 1]])
        reached = len(self.recent)
        self.products[:reached] += np.einsum("lfd,fd->l", self.recent, values)
        self.pairs[:reached] += 1

    def value(self) -> NDArray:
        """<v·v'>/<v²> at the lags reached, as `ensemble.correlation` has it."""
        reached = self.pairs > 0
        mean = self.products[reached] / self.pairs[reached]
        return mean / mean[0]


class Running:
    """The statistics of a family of fibers: F of N beads of radius a [m].

    R2, projected, Rg and curvature are R²/L², the squares of the end-to-end vector as it is seen along x, y and z over
    L², the gyration radius over L, eq. (14), and the mean curvature times L, eq. (11), with L = 2a(N−1).
    """

    def __init__(self, fibers: int, beads: int, radius: float, lags: int):
        self.fibers, self.beads, self.radius, self.lags = fibers, beads, radius, lags
        names = ("R2", "Rg") if beads < 3 else ("R2", "Rg", "curvature")
        self.averages = {name: Average(fibers, EDGES[name]) for name in names}
        self.projected = np.zeros((3, BINS), np.int64)
        dimensions = {"R": 3} if beads < 3 else {"R": 3, "curvature": 1}
        self.correlations = {name: Correlation(fibers, d, lags) for name, d in dimensions.items()}

    @property
    def samples(self) -> int:
        return len(self.averages["R2"].sums)

    def observe(self, positions: ArrayLike) -> None:
        """One sample of the bead positions (F, N, 3) [m]."""
        positions = np.asarray(positions, float)
        contour = 2 * self.radius * (self.beads - 1)
        vector = end_to_end(positions) / contour
        values = {"R2": (vector**2).sum(axis=-1), "Rg": gyration_radius(positions) / contour}
        if self.beads > 2:
            values["curvature"] = mean_curvature(positions, self.radius) * contour
            self.correlations["curvature"].add(values["curvature"][:, None])
        for name, average in self.averages.items():
            average.add(values[name])
        for axis in range(3):
            self.projected[axis] += _histogram(values["R2"] - vector[:, axis] ** 2, EDGES["projected"])
        self.correlations["R"].add(vector)

    def curvature_correlation(self) -> NDArray:
        """Of the fluctuations of the curvature around its mean."""
        c = self.correlations["curvature"]
        reached = c.pairs > 0
        square = self.averages["curvature"].moments()[0] ** 2
        covariance = c.products[reached] / (c.pairs[reached] * self.fibers) - square
        return covariance / covariance[0]

    def state(self) -> dict[str, NDArray]:
        """Everything, for a restart to the same bits and for a file."""
        own = {"projected/counts": self.projected}
        for name, a in self.averages.items():
            own |= {f"{name}/sums": np.array(a.sums), f"{name}/of_fibers": a.of_fibers}
            own |= {f"{name}/powers": a.powers, f"{name}/counts": a.counts, f"{name}/edges": a.edges}
        for name, c in self.correlations.items():
            own |= {f"{name}/products": c.products, f"{name}/pairs": c.pairs, f"{name}/recent": c.recent}
        return {name: np.array(value) for name, value in own.items()}

    def forms(self) -> dict[str, Form]:
        """What `state` holds."""
        found: dict[str, Form] = {"projected/counts": ("i", (3, BINS))}
        for name, a in self.averages.items():
            found |= {f"{name}/sums": ("f", (range(MOST),)), f"{name}/of_fibers": ("f", (self.fibers,))}
            found |= {f"{name}/powers": ("f", (POWERS,)), f"{name}/counts": ("i", a.counts.shape)}
            found |= {f"{name}/edges": ("f", a.edges.shape)}
        for name, c in self.correlations.items():
            lags = self.lags + 1
            found |= {f"{name}/products": ("f", (lags,)), f"{name}/pairs": ("i", (lags,))}
            found |= {f"{name}/recent": ("f", (range(lags + 1), *c.recent.shape[1:]))}
        return found

    def restore(self, state: Mapping[str, NDArray]) -> None:
        """Take back what `state` gave. ValueError where it is of other fibers or not whole."""
        check_arrays(state, self.forms())
        self.projected = np.array(state["projected/counts"])
        lengths = {len(state[f"{name}/sums"]) for name in self.averages}
        if len(lengths) != 1:
            raise ValueError(f"it has {' and '.join(map(str, sorted(lengths)))} samples")
        if any(not np.array_equal(state[f"{name}/edges"], a.edges) for name, a in self.averages.items()):
            raise ValueError("its histograms have other bins")
        for name, a in self.averages.items():
            a.sums = state[f"{name}/sums"].tolist()
            a.of_fibers, a.powers, a.counts = (
                np.array(state[f"{name}/{key}"]) for key in ("of_fibers", "powers", "counts")
            )
        for name, c in self.correlations.items():
            c.products, c.pairs, c.recent = (
                np.array(state[f"{name}/{key}"]) for key in ("products", "pairs", "recent")
            )


def merged(states: Sequence[Mapping[str, NDArray]], fibers: slice, pooled: bool = True) -> dict[str, NDArray]:
    """The states of the parts of a family as one, of which the given fibers stay. pooled: with what is of all fibers
    together, which one of several that share the family must have, and the others not."""
    found = {}
    for name, first in states[0].items():
        parts = [state[name] for state in states]
        kind = name.rpartition("/")[2]
        if kind in ("of_fibers", "recent"):
            axis = 0 if kind == "of_fibers" else 1
            found[name] = np.concatenate(parts, axis=axis)[(slice(None),) * axis + (fibers,)]
        elif kind in ("pairs", "edges"):  # the same in all parts
            found[name] = first
        elif not pooled:
            found[name] = np.zeros_like(first)
        else:
            found[name] = first if len(parts) == 1 else np.sum(parts, axis=0)
    return found


def _histogram(values: NDArray, edges: NDArray) -> NDArray[np.int64]:
    return np.histogram(np.clip(values, edges[0], edges[-1]), edges)[0]
