"""Fibers in a flow that can be sampled at any time: a loop over the stepper."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from .fibers import Fibers, positive
from .stepper import Stepper

FIRST_PIECES, MOST_PIECES = 8, 64  # parts of a time step between which the flow is sampled
EXTRAPOLATION = 3 / 8  # error of a step over (step × prediction gap) with quadratic extrapolation


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
    repulsion=0.0,
):
    """Trajectory of fibers carried by flow from time 0 to end_time; a list of them for a list of families.

    The flow is sampled once per time_step with ab3. With implicit and auto a time step is divided where the
    flow along the paths changes too fast to be extrapolated within the tolerance (always in the first
    steps, which have no history). record_every: steps between records; None records the end only. Other
    options as in Stepper; the flow's sample() as in gbm_plugin.flow. The fibers themselves are not changed.
    Raises ValueError on unknown words and bad numbers, FloatingPointError on NaN.
    """
    if not isinstance(fibers, Fibers):
        options = (
            time_step,
            end_time,
            integrator,
            mobility,
            strain_coupling,
            tolerance,
            record_every,
            repulsion,
        )
        return [simulate(family, flow, *options) for family in fibers]
    step, end = positive("time_step", time_step), positive("end_time", end_time)
    if record_every is not None and (int(record_every) != record_every or record_every < 1):
        raise ValueError(f"record_every is {record_every}; it must be a whole number of at least 1, or None")
    stepper = Stepper(fibers, 0.0, integrator, mobility, strain_coupling, tolerance, repulsion)
    steps = max(1, int(np.ceil(end / step * (1 - 1e-9))))
    pieces = 1 if integrator == "ab3" else FIRST_PIECES
    times, positions = [], []
    _sample(stepper, flow)
    for n in range(1, steps + 1):
        start, stop = stepper.time, min(n * step, end)
        worst = 0.0
        for piece in range(1, pieces + 1):
            last = piece == pieces
            stepper.advance((stop if last else start + (stop - start) * piece / pieces) - stepper.time)
            while stepper.provisional:
                _sample(stepper, flow)
                stepper.correct()
            if last and (n == steps or (record_every and n % record_every == 0)):
                times.append(stepper.time)
                positions.append(stepper.positions)
            if not last or n < steps:
                _sample(stepper, flow)
                if integrator != "ab3":
                    worst = max(worst, stepper.prediction_gap.max())
        if integrator != "ab3":
            pieces = _pieces(pieces, EXTRAPOLATION * worst * step / pieces / fibers.contour_length, stepper)
    return Trajectory(np.array(times), np.array(positions), stepper.report())


def _sample(stepper: Stepper, flow) -> None:
    stepper.observe(stepper.time, *flow.sample(stepper.positions, stepper.time, stepper.need))


def _pieces(pieces: int, error: float, stepper: Stepper) -> int:
    """Parts of the next time step: twice or half as many as of the last, from its (fourth-order) error."""
    if error > stepper.local_tolerance:
        return min(2 * pieces, MOST_PIECES)
    return max(1, pieces // 2) if 16 * error < stepper.local_tolerance else pieces
