"""Probability densities and how far they are from each other and from theory."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import ArrayLike, NDArray

QUANTILES = (np.arange(1000) + 0.5) / 1000


def density(values: ArrayLike, edges: ArrayLike) -> NDArray[np.float64]:
    """Density in bins: its integral over all bins is the share of the values that lies in them."""
    values, edges = np.ravel(values), np.asarray(edges, float)
    counts, _ = np.histogram(values, edges)
    return counts / (values.size * np.diff(edges))


def wasserstein(first: ArrayLike, second: ArrayLike) -> float:
    """Mean distance by which a value of one sample has to be moved to make the other of it, from a thousand quantiles
    of each (the 1-Wasserstein distance), in units of the values."""
    return float(np.abs(quantiles(first) - quantiles(second)).mean())


def quantiles(values: ArrayLike) -> NDArray[np.float64]:
    """A thousand quantiles of a sample, one in the middle of each thousandth."""
    return np.quantile(np.ravel(values), QUANTILES)


def own_noise(values: ArrayLike) -> float:
    """The Wasserstein distance that chance alone makes between two samples as good as this one (T, F): that of its two
    halves over √2, the larger of halves of the fibers and of the time."""
    values = np.asarray(values, float)
    times, fibers = (n // 2 for n in values.shape)
    pairs = [(values[:times], values[times:])] if times else []
    pairs += [(values[:, :fibers], values[:, fibers:])] if fibers else []
    return max((wasserstein(a, b) for a, b in pairs), default=0.0) / np.sqrt(2)


def mean_pairwise(samples: list[NDArray]) -> float:
    """Mean Wasserstein distance over all pairs of samples; 0 for a single one."""
    q = [quantiles(values) for values in samples]
    pairs = [np.abs(q[i] - q[j]).mean() for i in range(len(q)) for j in range(i)]
    return float(np.mean(pairs)) if pairs else 0.0


def distance_to(values: ArrayLike, distribution: Callable[[NDArray], NDArray]) -> float:
    """The largest distance between the distribution of the values and the one given (Kolmogorov–Smirnov's D): 0 where
    they are one, at most 1."""
    values = np.sort(np.ravel(values))
    expected = distribution(values)
    rank = np.arange(len(values) + 1) / len(values)
    return float(max(np.abs(rank[1:] - expected).max(), np.abs(rank[:-1] - expected).max()))
