"""Fibers moved as a coupled run moves them: one sample of the flow a step, and nothing of the flow in their time."""

from __future__ import annotations

import time
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...fiber import Stepper
from ...statistics.fibers import end_to_end_squared_ratio, mean_curvature
from ..scenes import ends_apart
from .flows import Carrier


@dataclass(frozen=True)
class Outcome:
    """Positions (F, N, 3) at the end; processor time of the fibers, without the flow's, and that of the flow [s]."""

    positions: NDArray
    radius: float
    seconds: float
    sampling: float
    report: dict[str, Any]

    def errors(self, exact: Outcome) -> dict[str, float]:
        """Rms distance of the ends over the length; of <R²>, relative; of the mean curvature, times the length."""
        length = 2 * self.radius * self.positions.shape[1]
        ratio, other = (end_to_end_squared_ratio(o.positions, o.radius).mean() for o in (self, exact))
        bend, bent = (mean_curvature(o.positions, o.radius).mean() for o in (self, exact))
        return {
            "error": ends_apart(self.positions, exact.positions, self.radius),
            "r2_error": float(abs(ratio / other - 1)),
            "curvature_error": float(abs(bend - bent) * length),
        }


def march(carrier: Carrier, fibers, step: float, end: float, **options: Any) -> Outcome:
    """fibers from time 0 to end, in steps of `step` (both in τ); options of `Stepper`."""
    tau, count = carrier.kolmogorov_time, max(1, round(end / step))
    stepper = Stepper(fibers, 0.0, **options)
    clock, own, sampling = time.process_time, 0.0, 0.0

    def sampled() -> None:
        nonlocal own, sampling
        positions, begin = stepper.positions, clock()
        values = carrier.flow.sample(positions, stepper.time, stepper.need)
        middle = clock()
        stepper.observe(stepper.time, *values)
        sampling, own = sampling + middle - begin, own + clock() - middle

    sampled()
    for n in range(1, count + 1):
        begin = clock()
        stepper.advance(n * end * tau / count - stepper.time)
        own += clock() - begin
        while stepper.provisional:
            sampled()
            begin = clock()
            stepper.correct()
            own += clock() - begin
        sampled()
    return Outcome(np.array(stepper.positions), fibers.radius, own, sampling, stepper.report())


def best(carrier: Carrier, fibers, step: float, end: float, enough: float = 0.2, **options: Any) -> Outcome:
    """The fastest of up to three marches, which all find the same; of one where it takes longer than `enough` [s]."""
    march(carrier, fibers, step, step, **options)  # kernels are loaded, and samples of the flow
    outcome = march(carrier, fibers, step, end, **options)
    for _ in range(2):
        if outcome.seconds > enough:
            break
        again = march(carrier, fibers, step, end, **options)
        outcome = min(outcome, again, key=lambda o: o.seconds)
    return outcome
