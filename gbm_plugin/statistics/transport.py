"""Dispersion of paths."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike, NDArray


def mean_square_displacement(paths: ArrayLike, lags: Sequence[int]) -> NDArray[np.float64]:
    """<|x(t + lag) − x(t)|²> of paths (T, F, d), unwrapped, for lags in samples: over all fibers and times t.

    Raises ValueError where a lag is not within the paths.
    """
    paths = np.asarray(paths, float)
    if paths.ndim != 3 or min(lags) < 1 or max(lags) >= len(paths):
        raise ValueError(f"paths of shape {paths.shape} have no lags from {min(lags)} to {max(lags)}")
    return np.array([((paths[lag:] - paths[:-lag]) ** 2).sum(axis=-1).mean() for lag in lags])


def exponent(lags: ArrayLike, displacement: ArrayLike) -> float:
    """Slope of log displacement against log lag, by least squares: 1 in diffusion, 2 in straight motion, 0 for
    paths that stay where they are."""
    return float(np.polyfit(np.log(np.asarray(lags, float)), np.log(np.asarray(displacement, float)), 1)[0])
