"""Fibers in a flow that is there already: a loop over the stepper."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from .fibers import Fibers, positive
from .stepper import Stepper


@dataclass(frozen=True)
class Trajectory:
    """Recorded shapes: times (S,), positions (S, F, N, 3), and the stepper's report."""

    times: np.ndarray
    positions: np.ndarray
    report: dict


def simulate(
    fibers,
    flow,
    time_step,
    end_time,
    integrator="implicit",
    mobility="freeDrain",
    strain_coupling=False,
    tolerance=None,
    record_every=None,
):
    """Trajectory of fibers carried by flow from time 0 to end_time; a list of them for a list of families.

    The flow is sampled once per time_step (the last step is shortened to end at end_time); its sample() is
    described in gbm_plugin.flow. record_every: steps between records; None records the end only. The fibers
    themselves are not changed. Raises ValueError on unknown words, FloatingPointError on NaN.
    """
    if not isinstance(fibers, Fibers):
        options = (time_step, end_time, integrator, mobility, strain_coupling, tolerance, record_every)
        return [simulate(family, flow, *options) for family in fibers]
    step, end = positive("time_step", time_step), positive("end_time", end_time)
    stepper = Stepper(fibers, 0.0, integrator, mobility, strain_coupling, tolerance)
    steps = max(1, int(np.ceil(end / step * (1 - 1e-9))))
    times, positions = [], []

    def sample():
        stepper.observe(stepper.time, *flow.sample(stepper.positions, stepper.time, stepper.need))

    sample()
    for n in range(1, steps + 1):
        stepper.advance(min(n * step, end) - stepper.time)
        while stepper.provisional:
            sample()
            stepper.correct()
        if n == steps or (record_every and n % record_every == 0):
            times.append(stepper.time)
            positions.append(stepper.positions)
        if n < steps:
            sample()
    return Trajectory(np.array(times), np.array(positions), stepper.report())
