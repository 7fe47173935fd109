"""Fibers in a flow that can be sampled in this process: a loop over their steppers.

The flow is sampled where the fibers are, and extrapolated in time along their paths between the samples. How far
that was off is seen when the next sample comes: a step of implicit or auto that was too far off is taken back and
done in parts.
"""

from __future__ import annotations

import warnings
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, overload

import numpy as np
from numpy.typing import NDArray

from ..sampling import Flow, FlowEnded
from .fibers import Fibers, positive
from .group import Group
from .stepper import Stepper

FIRST_PART = 1 / 8  # of a time step, tried first
SAFETY, SHRINK, GROW = 0.8, 0.2, 2.0  # of the next part, from the error of the last
SMALLEST_PART = 1e-9  # of a time step: a flow that needs less jumps
ORDER = 4  # of the error of a part in its length, with quadratic extrapolation
# what is left of the estimate after the first steps, which were corrected, by the samples at hand: of the first
# nothing is known before the second, whose linear prediction shows that it was 1/12 of this gap off, not 5/12
STARTING = {2: 0.0, 3: 1 / 5}
LOST = 0.3  # of a fiber's length: an error of one step of ab3 after which the path is another one
CORRECTED = 1 / 9  # of that error stays with quadratic interpolation between both ends: 1/24 instead of 3/8


@dataclass(frozen=True)
class Trajectory:
    """Recorded shapes: times (S,), positions (S, F, N, 3), the first at the start; and a report.

    report: counts of the stepper (steps, substeps, …, worst_error: the largest accepted estimate of an implicit
    step); samples of the flow; redone, parts of steps that were taken back; flow_error, the estimated error that came
    from extrapolating the flow, summed over the run, and worst_flow_error, its largest part: as worst_error, in fiber
    lengths; left, the fibers that left the flow. fibers: those at the start.
    """

    times: NDArray
    positions: NDArray
    report: dict[str, Any]
    fibers: Fibers


@overload
def simulate(
    fibers: Fibers, flow: Flow, time_step: float, end_time: float, *words: Any, **options: Any
) -> Trajectory: ...
@overload
def simulate(
    fibers: Sequence[Fibers], flow: Flow, time_step: float, end_time: float, *words: Any, **options: Any
) -> list[Trajectory]: ...
def simulate(
    fibers: Fibers | Sequence[Fibers],
    flow: Flow,
    time_step: float,
    end_time: float,
    integrator: str = "implicit",
    mobility: str = "freeDrain",
    strain_coupling: bool = False,
    tolerance: float | None = None,
    record_every: int | None = None,
    repulsion: float = 0.0,
    start_time: float = 0.0,
) -> Trajectory | list[Trajectory]:
    """Trajectory of fibers carried by flow from start_time to end_time; a list of them for a list of families, which
    move together: the flow is sampled once for all.

    With ab3 the flow is sampled once per time_step, and a step that cannot be followed so is refused. With implicit
    and auto a time step is divided where the flow along the paths cannot be extrapolated over it within the tolerance:
    as often as that takes, except in a flow that is known at times of its own only (`sample_interval`, a
    SpectralSolver), which is sampled at each of them.
    record_every: steps between records; None records start and end. The other options are those of Stepper; the flow's
    sample() is as in gbm_plugin.flow. The fibers themselves are not changed.

    Fibers that leave a flow that is known in a part of space stay where they left it; where a flow ends before
    end_time, so does the trajectory: a warning says which, and when.

    Raises ValueError on unknown words and bad numbers, and where a flow that is known at times of its own changes too
    fast between them for the tolerance; FloatingPointError on NaN.
    """
    families = [fibers] if isinstance(fibers, Fibers) else list(fibers)
    step, start = positive("time_step", time_step), float(start_time)
    span = positive("end_time - start_time", end_time - start)
    if record_every is not None and (int(record_every) != record_every or record_every < 1):
        raise ValueError(f"record_every is {record_every}; it must be a whole number of at least 1, or None")
    if not callable(getattr(flow, "sample", None)):
        hint = "; gbm_plugin.flow.from_function(u) makes one of a function" if callable(flow) else ""
        raise TypeError(f"{flow!r} is no flow: it has no sample(positions, time, need){hint}")
    words = (integrator, mobility, strain_coupling, tolerance, repulsion)
    group = Group([Stepper(family, start, *words) for family in families])
    run = (_OnceAStep if integrator == "ab3" else _own_times(flow) or _InParts)(group, flow, step)
    steps = max(1, int(np.ceil(span / step * (1 - 1e-9))))
    run.record()
    try:
        for n in range(1, steps + 1):
            run.to(end_time if n == steps else start + n * step)
            if n == steps or (record_every and n % record_every == 0):
                run.record()
    except FlowEnded as error:
        warnings.warn(f"the trajectory ends at time {run.time:g}: {error}", stacklevel=2)
        run.record()
    paths = run.trajectories(families)
    return paths[0] if isinstance(fibers, Fibers) else paths


class _Run:
    """A group on its way through a flow, and what is kept of it."""

    def __init__(self, group: Group, flow: Flow, step: float):
        self.group, self.flow, self.step = group, flow, step
        self.lengths = [s.fibers.contour_length for s in group.steppers]
        self.tolerance = min(s.local_tolerance for s in group.steppers)
        self.left = [
            np.zeros(s.fibers.count, bool) for s in group.steppers
        ]  # fibers that are where the flow is not
        self._resting = group.by_family  # where all were at the last sample
        self.counts = {"samples": 0, "redone": 0, "flow_error": 0.0, "worst_flow_error": 0.0}
        self.times: list[float] = []
        self._shapes: list[list[NDArray]] = []
        self.sample()

    @property
    def time(self) -> float:
        return self.group.time

    def positions(self) -> list[NDArray]:
        """(F, N, 3) of each family, of fibers that left the flow where they did."""
        return [
            np.where(left[:, None, None], resting, now) if left.any() else now
            for left, resting, now in zip(self.left, self._resting, self.group.by_family, strict=True)
        ]

    def record(self) -> None:
        """Keep the present shapes, unless they are kept."""
        if not self.times or self.times[-1] != self.time:
            self.times.append(self.time)
            self._shapes.append(self.positions())

    def sample(self) -> None:
        """The flow at the beads now."""
        positions = self._inside()
        beads = self.group.positions
        if any(left.any() for left in self.left):
            beads = np.concatenate([part.reshape(-1, 3) for part in positions])
        velocity, extra = self.flow.sample(beads, self.time, self.group.need)
        if any(left.any() for left in self.left):
            moving = ~np.concatenate(
                [np.repeat(left, part.shape[1]) for left, part in zip(self.left, positions, strict=True)]
            )
            velocity = velocity * moving[:, None]
            extra = None if extra is None else extra * moving.reshape(-1, *(1,) * (extra.ndim - 1))
        self.group.observe(self.time, velocity, extra)
        self._resting = positions
        self.counts["samples"] += 1

    def _inside(self) -> list[NDArray]:
        """Present positions, once the fibers that have left the flow are noted."""
        if inside := getattr(self.flow, "inside", None):
            for number, now in enumerate(self.positions()):
                gone = ~inside(now).all(axis=1) & ~self.left[number]
                if gone.any() and not self.times:
                    raise ValueError(f"fibers {np.flatnonzero(gone)} start outside of the flow")
                self.left[number] = self.left[number] | gone
        return self.positions()

    def flow_error(self) -> float:
        """Largest estimate, over the fibers, of what extrapolating the flow cost in the last step: over length."""
        pairs = zip(self.group.steppers, self.left, strict=True)
        return max(float(np.max(s.flow_error[~left], initial=0.0)) for s, left in pairs)

    def to(self, end: float) -> None:
        """Move on to this time."""
        before = [left.copy() for left in self.left]
        try:
            self.move(end)
        except FlowEnded as error:
            if self.group.steppers[0].sampled_until < self.time:
                self.group.undo()
                self.left = before
            if error.until is not None and self.time < error.until < end:
                self.to(error.until)
            raise

    def move(self, end: float) -> None:
        """As to, where the flow does not end."""
        raise NotImplementedError

    def step_by(self, length: float) -> None:
        """One step, corrected where the history is too short, and the sample at its end."""
        self.group.advance(length)
        while self.group.provisional:
            self.sample()
            self.group.correct()
        self.sample()

    def accept(self, error: float) -> None:
        """Count the flow's part of the error."""
        self.counts["flow_error"] += error
        self.counts["worst_flow_error"] = max(self.counts["worst_flow_error"], error)

    def trajectories(self, families: Sequence[Fibers]) -> list[Trajectory]:
        times = np.array(self.times)
        shapes = [np.array(shapes) for shapes in zip(*self._shapes, strict=True)]
        for number, left in enumerate(self.left):
            if left.any():
                which = ", ".join(map(str, np.flatnonzero(left)[:5])) + (", …" if left.sum() > 5 else "")
                warnings.warn(
                    f"fibers {which} of family {number} left the flow, and stay where they did", stacklevel=3
                )
        return [
            Trajectory(times, positions, s.report() | self.counts | {"left": np.flatnonzero(left)}, fibers)
            for fibers, s, positions, left in zip(
                families, self.group.steppers, shapes, self.left, strict=True
            )
        ]


class _OnceAStep(_Run):
    """The flow is sampled once in a step, whatever that costs, unless it costs everything."""

    def move(self, end: float) -> None:
        start = self.time
        self.step_by(end - start)
        error = self.flow_error()
        if not error <= LOST:
            raise ValueError(
                f"the flow along the fibers changes too fast for a step of {end - start:g} from time {start:g}: "
                f"extrapolating it costs {error:.2g} of a fiber's length; take shorter steps, or the integrator "
                "implicit or auto, which divide them"
            )
        self.accept(error)


class _InParts(_Run):
    """Steps in as many parts as the tolerance asks for; a part that was too long is done again."""

    def __init__(self, group: Group, flow: Flow, step: float):
        super().__init__(group, flow, step)
        self.part = FIRST_PART * step

    def move(self, end: float) -> None:
        while (rest := end - self.time) > 1e-12 * self.step:
            length = rest / max(1, np.ceil(rest / self.part * (1 - 1e-9)))
            before = [left.copy() for left in self.left]
            self.step_by(length)
            error = self.flow_error()
            factor = SAFETY * (self.tolerance / max(error, 1e-300)) ** (1 / ORDER)
            self.part = min(self.step, length * min(GROW, max(SHRINK, factor)))
            if error <= self.tolerance:
                self.accept(error)
                continue
            if length < SMALLEST_PART * self.step:
                raise ValueError(
                    f"the flow jumps at time {self.time:g}: no step is short enough to follow it"
                )
            self.group.undo()
            self.left = before
            self.counts["redone"] += 1


class _AtOwnTimes(_Run):
    """A flow that cannot go back, sampled at each of its own times. A step that was too long is done again with what
    is known at its end."""

    def move(self, end: float) -> None:
        interval: float = self.flow.sample_interval  # type: ignore[attr-defined]
        count = max(1, round((end - self.time) / interval))
        for n in range(count, 0, -1):
            self.step_by((end - self.time) / n)
            error = self.flow_error() * STARTING.get(samples := self.group.steppers[0].samples, 1.0)
            if error > self.tolerance and samples not in STARTING:
                self.group.correct()
                self.sample()
                self.counts["redone"] += 1
                error *= CORRECTED
            if error > self.tolerance:
                raise ValueError(
                    f"the flow, known every {interval:g}, changes too fast along the fibers at time {self.time:g}: "
                    f"a step costs {error:.2g} of a fiber's length, the tolerance allows {self.tolerance:.2g}; take "
                    "shorter steps of the flow, or a greater tolerance"
                )
            self.accept(error)


def _own_times(flow: Flow) -> type[_Run] | None:
    return _AtOwnTimes if getattr(flow, "sample_interval", None) else None
