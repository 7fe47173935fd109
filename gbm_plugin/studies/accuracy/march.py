"""Fibers moved as a coupled run moves them: one sample of the flow a step, and nothing of the flow in their time."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...fiber import Stepper
from ...statistics.fibers import end_to_end_squared_ratio, mean_curvature
from ..scenes import ends_apart
from .flows import Carrier

START = 2  # steps that are corrected
ENOUGH = 0.2  # [s], not worth to be repeated


@dataclass(frozen=True)
class Outcome:
    """Positions (F, N, 3) at the end; processor time of the fibers, without the flow's, and that of the flow [s];
    settled: of the fibers, as if no step were one of the first, which are corrected and know no flow before them."""

    positions: NDArray
    radius: float
    seconds: float
    settled: float
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
    clock, own, sampling, first = time.process_time, 0.0, 0.0, 0.0

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
        first = own if n == START else first
    settled = (own - first) * count / (count - START) if count > START else own
    return Outcome(np.array(stepper.positions), fibers.radius, own, settled, sampling, stepper.report())


def fastest(runs: Sequence[Callable[[], Outcome]]) -> list[Outcome]:
    """The fastest of up to four marches of each, which all find the same, in turns, so that what else the machine
    does is the same for all; of one where it takes longer than ENOUGH."""
    found = [run() for run in runs]  # which loads kernels, and samples of the flow
    for _ in range(3):
        for n, run in enumerate(runs):
            if found[n].seconds < ENOUGH:
                found[n] = min(found[n], run(), key=lambda outcome: outcome.settled)
    return found
