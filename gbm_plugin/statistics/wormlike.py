"""The worm-like chain, eq. (19) of the paper: a chain that forgets its direction over a persistence length.

The persistence length of a fiber in turbulence is γ l_p, l_p = (K^b)^(1/4)/(μρε)^(1/8), eq. (15), with γ to be
measured. Eq. (19) as printed has γ in front instead; the text and the conclusion define it inside, and only so does
a short fiber stay straight.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.optimize import brentq, least_squares, minimize_scalar

from .ensemble import jackknife_error

RANGE = (0.02, 200.0)  # of γ


def persistence_length(stiffness: ArrayLike, viscosity: float, density: float, dissipation: float) -> NDArray:
    """l_p [m], eq. (15), of the bending stiffness K^b [N m²], the dynamic viscosity [Pa s], the density [kg/m³] and
    the dissipation per unit mass [m²/s³]."""
    return np.asarray(stiffness, float) ** 0.25 / (viscosity * density * dissipation) ** 0.125


def squared_ratio(length: ArrayLike) -> NDArray:
    """<R²>/L² of chains whose length is so many persistence lengths: 1 for short ones, 2/x for long, eq. (19)."""
    x = np.asarray(length, float)
    safe = np.where(x < 1e-3, 1.0, x)
    return np.where(x < 1e-3, 1 - x / 3 + x**2 / 12, 2 / safe + 2 * np.expm1(-safe) / safe**2)


def persistence_lengths(ratio: float) -> float:
    """How many persistence lengths a chain of this <R²>/L² is long, the inverse of `squared_ratio`: 0 for a ratio of 1
    or more. ValueError for a ratio that is not positive."""
    if not ratio > 0:
        raise ValueError(f"<R²>/L² is {ratio}; it must be positive")
    return 0.0 if ratio >= 1 else float(brentq(lambda x: float(squared_ratio(x)) - ratio, 0.0, 3 / ratio))


@dataclass(frozen=True)
class Fit:
    """γ with its standard error; scatter: the rms by which points differ from the curve beyond their own errors, in
    the logarithm of <R²>/L²; points: how many were fitted."""

    gamma: float
    error: float | None
    scatter: float
    points: int


def fit(length: ArrayLike, ratio: ArrayLike, error: ArrayLike, prefactor: bool = False) -> Fit:
    """γ from <R²>/L² (M,), its standard errors (M,), and L/l_p (M,), l_p without γ.

    Least squares in ln <R²>/L²; the variance of a point is that of its error and one that all share, as large as
    makes χ² = M − 1 (Paule & Mandel 1982): the curve is a model, not the truth, and exact points do not outweigh the
    rest. The error of γ is the larger of the formal one and that of leaving out one point after the other.
    prefactor: γ in front of eq. (19), as printed, instead of in the persistence length.
    Raises ValueError for no points or a ratio that is not positive.
    """
    x, y, e = (np.atleast_1d(np.asarray(v, float)) for v in (length, ratio, error))
    if not len(x) or not (x > 0).all() or not (y > 0).all():
        raise ValueError("γ cannot be fitted: a positive length and ratio of one family or more are needed")

    def model(gamma: float) -> NDArray:
        return np.log(gamma * squared_ratio(x) if prefactor else squared_ratio(x / gamma))

    target, own = np.log(y), e / y
    whole, error, scatter = _solve(model, target, own, slice(None))
    if len(x) > 1:
        parts = [_solve(model, target, own, np.arange(len(x)) != i)[0] for i in range(len(x))]
        error = max(error, float(jackknife_error(parts)))
    return Fit(whole, error if error > 0 else None, scatter, len(x))


@dataclass(frozen=True)
class Transition:
    """<R²>/L² = P + (1 − P)/(1 + (x/x₀)^n) of x = L/l_p: straight fibers that begin to buckle, and a plateau. Errors:
    those of leaving out one point after the other; scatter: the rms of ln <R²>/L² from the curve."""

    plateau: float
    middle: float
    steepness: float
    errors: tuple[float, float, float]
    scatter: float

    def __call__(self, length: ArrayLike) -> NDArray:
        return _transition((self.plateau, self.middle, self.steepness), np.asarray(length, float))


def _transition(words, x: NDArray) -> NDArray:
    plateau, middle, steepness = words
    return plateau + (1 - plateau) / (1 + (x / middle) ** steepness)


def fit_transition(length: ArrayLike, ratio: ArrayLike) -> Transition:
    """The curve through <R²>/L² (M,) at L/l_p (M,), every point alike. ValueError for fewer than five points."""
    x, y = (np.atleast_1d(np.asarray(v, float)) for v in (length, ratio))
    if len(x) < 5 or not (x > 0).all() or not (y > 0).all():
        raise ValueError(
            "a transition cannot be fitted: positive lengths and ratios of five families are needed"
        )

    def solve(chosen: NDArray) -> NDArray:
        bounds = [(1e-3, 0.1, 0.5), (1.0, 100.0, 12.0)]
        off = lambda words: np.log(y[chosen] / _transition(words, x[chosen]))  # noqa: E731
        return least_squares(off, (0.4, 5.0, 3.0), bounds=bounds).x

    every = np.arange(len(x))
    whole = solve(every >= 0)
    errors = jackknife_error([solve(every != i) for i in every])
    scatter = float(np.sqrt(np.mean(np.log(y / _transition(whole, x)) ** 2)))
    return Transition(*whole.tolist(), tuple(errors.tolist()), scatter)


def _solve(model: Callable, target: NDArray, own: NDArray, chosen) -> tuple[float, float, float]:
    """γ, its formal error and the scatter of the chosen points."""
    y, e = target[chosen], own[chosen]
    floor = 1e-6  # of an error, in the logarithm: that of a point without one

    def best(scatter: float) -> tuple[float, float]:
        variance = e**2 + scatter**2 + floor**2
        found = minimize_scalar(
            lambda g: (((y - model(np.exp(g))[chosen]) ** 2) / variance).sum(),
            bounds=np.log(RANGE),
            method="bounded",
            options={"xatol": 1e-7},
        )
        return float(np.exp(found.x)), float(found.fun)

    scatter = 0.0
    if len(y) > 1 and best(0.0)[1] > len(y) - 1:
        top = 1.0
        while best(top)[1] > len(y) - 1:
            top *= 2
        scatter = float(brentq(lambda s: best(s)[1] - (len(y) - 1), 0.0, top, xtol=1e-5))
    gamma, _ = best(scatter)
    slope = (model(gamma * 1.001)[chosen] - model(gamma / 1.001)[chosen]) / (2e-3 * gamma)
    weight = (slope**2 / (e**2 + scatter**2 + floor**2)).sum()
    return gamma, float(weight**-0.5) if weight > 0 else 0.0, scatter
