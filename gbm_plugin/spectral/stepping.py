"""Time stepping with an exact viscous factor: the schemes act on v = exp(nu k^2 t) u."""

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from gbm_plugin.arrays import Form
from gbm_plugin.spectral.arrays import Array, Arrays

Evaluate = Callable[[Array, Array, float], None]  # (u, out, fluctuation energy of u): du/dt without viscosity
ChooseStep = Callable[[], float]  # called when du/dt at the start of the step is known


class RungeKutta4:
    """The classical fourth-order scheme."""

    def __init__(self, operators: Arrays):
        self._operators = operators
        self._arrays: list[Array] = []

    def step(
        self, u: Array, energy: float, time: float, evaluate: Evaluate, choose: ChooseStep
    ) -> tuple[float, float]:
        """Advance u in place; returns the time step and the new energy."""
        if not self._arrays:
            self._arrays = [self._operators.zeros() for _ in range(4)]
        slope, *scratch = self._arrays
        evaluate(u, slope, energy)
        h = choose()
        return h, finish_runge_kutta(self._operators, u, slope, h, evaluate, scratch)

    def forget(self) -> None:
        """Nothing is kept from step to step."""

    def state(self) -> dict[str, NDArray]:
        return {}

    def forms(self, field: Form) -> dict[str, Form]:
        return {}

    def restore(self, state: dict[str, NDArray]) -> None:
        """Nothing to continue from."""


class AdamsBashforth3:
    """Third-order Adams-Bashforth for steps of any length; the first two steps are Runge-Kutta's."""

    def __init__(self, operators: Arrays):
        self._operators = operators
        self.forget()

    def step(
        self, u: Array, energy: float, time: float, evaluate: Evaluate, choose: ChooseStep
    ) -> tuple[float, float]:
        """Advance u in place; returns the time step and the new energy."""
        full = len(self._slopes) == 3
        slope = self._slopes.pop() if full else self._operators.zeros()
        self._slopes.insert(0, slope)
        self._times = [time, *self._times][:3]
        evaluate(u, slope, energy)
        h = choose()
        if len(self._slopes) < 3:
            scratch = [self._operators.zeros() for _ in range(3)]
            return h, finish_runge_kutta(self._operators, u, slope, h, evaluate, scratch)
        ages = [time - t for t in self._times]
        terms = zip(adams_bashforth_weights(ages, h), (h + age for age in ages), self._slopes, strict=True)
        return h, self._operators.combine(u, [(1.0, h, u), *terms])

    def forget(self) -> None:
        """Start anew: the field has changed by other means."""
        self._slopes: list[Array] = []  # newest first
        self._times: list[float] = []

    def state(self) -> dict[str, NDArray]:
        slopes = [self._operators.host(s).copy() for s in self._slopes]
        return {f"slope_{i}": s for i, s in enumerate(slopes)} | {"slope_times": np.array(self._times)}

    def forms(self, field: Form) -> dict[str, Form]:
        """What `state` can hold for fields of this form."""
        return {f"slope_{i}": field for i in range(3)} | {"slope_times": ("f", (range(4),))}

    def restore(self, state: dict[str, NDArray]) -> None:
        """ValueError where a slope is missing, or their times do not fall."""
        times, present = state["slope_times"], [f"slope_{i}" in state for i in range(3)]
        if present != [i < len(times) for i in range(3)] or (np.diff(times) >= 0).any():
            raise ValueError(f"there are {sum(present)} slopes, and their times are {times}")
        self._times = np.asarray(state["slope_times"]).tolist()
        xp = self._operators.xp
        self._slopes = [xp.array(state[f"slope_{i}"]) for i in range(len(self._times))]


def adams_bashforth_weights(ages: list[float], h: float) -> NDArray:
    """Weights b_j: sum b_j g(-age_j) = int_0^h g(s) ds for quadratic g; equal steps: h (23, -16, 5)/12."""
    powers = np.arange(len(ages))
    scaled = -np.asarray(ages) / h
    return h * np.linalg.solve(scaled ** powers[:, None], 1 / (powers + 1))


def finish_runge_kutta(
    operators: Arrays, u: Array, slope: Array, h: float, evaluate: Evaluate, scratch: list[Array]
) -> float:
    """The step of length h from u, whose slope is known; u is advanced, its new energy returned."""
    total, stage, k = scratch
    combine = operators.combine
    combine(total, [(1, h, u), (h / 6, h, slope)])
    evaluate(stage, k, combine(stage, [(1, h / 2, u), (h / 2, h / 2, slope)]))
    combine(total, [(1, 0, total), (h / 3, h / 2, k)])
    evaluate(stage, k, combine(stage, [(1, h / 2, u), (h / 2, 0, k)]))
    combine(total, [(1, 0, total), (h / 3, h / 2, k)])
    evaluate(stage, k, combine(stage, [(1, h, u), (h, h / 2, k)]))
    return combine(u, [(1, 0, total), (h / 6, 0, k)])
