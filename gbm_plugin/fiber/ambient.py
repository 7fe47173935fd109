"""The flow along each bead's own path: the samples received, and the polynomial in time through them."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ..compiled import kernel, only_read, part_of
from ..sampling import lagrange_weights
from ..simd import LANES, blank, load, splat, store
from ..threads import COPYING, in_shares
from .layout import pack, unpack

SAMPLES = 3  # in the polynomial in time
KEPT = SAMPLES + 1  # one more, to compare the newest with its prediction


@kernel
def _squared_gap(share, shares, new, first, second, third, weights, square):
    """Sum over the rows of a fiber of (new − weighted predictors)², fields in blocks (B, rows, LANES)."""
    begin, end = part_of(share, shares, new.shape[0])
    for b in range(begin, end):
        for row in range(new.shape[1]):
            for lane in range(LANES):
                predicted = weights[0] * first[b, row, lane] + weights[1] * second[b, row, lane]
                predicted += weights[2] * third[b, row, lane]
                square[b, lane] += (new[b, row, lane] - predicted) ** 2


@kernel
def _receive(share, shares, velocity, rotation, velocities, rotations, sums):
    """Both fields (F, rows) as blocks (B, rows, LANES); sums (B, LANES): of all numbers of a fiber."""
    last = velocity.shape[0] - 1
    begin, end = part_of(share, shares, sums.shape[0])
    for b in range(begin, end):
        total = splat(0.0)
        for field, blocks in ((velocity, velocities), (rotation, rotations)):
            for lane in range(LANES):
                fiber = min(b * LANES + lane, last)
                for row in range(field.shape[1]):
                    blocks[b, row, lane] = field[fiber, row]
            for row in range(field.shape[1]):
                total = total + load(blocks[b], row)
        store(sums, b, total)


class Ambient:
    """The newest samples of velocity and rotation at the beads, newest last."""

    def __init__(self, fibers: int, beads: int):
        self.shape = (fibers, beads)
        self.times: list[float] = []
        self.samples: list[tuple[np.ndarray, np.ndarray]] = []  # each (velocity, rotation) in blocks

    def __len__(self) -> int:
        return len(self.times)

    def observe(self, time: float, velocity: NDArray, rotation: NDArray) -> bool:
        """Take a sample (F, N, 3) of each, and say whether all of it is finite; one at the newest time replaces that
        one."""
        if self.times and time < self.times[-1]:
            raise ValueError(f"sample at time {time:g} is older than the last one, at {self.times[-1]:g}")
        if self.times and time == self.times[-1]:
            own = self.samples.pop()
            self.times.pop()
        elif len(self.times) == KEPT:
            own = self.samples.pop(0)
            self.times.pop(0)
        else:
            fibers, beads = self.shape
            own = blank(-(-fibers // LANES), 3 * beads), blank(-(-fibers // LANES), 3 * beads)
        sums = blank(len(own[0]))
        fields = (only_read(field.reshape(self.shape[0], -1)) for field in (velocity, rotation))
        in_shares(_receive, 2 * COPYING * self.shape[0] * self.shape[1], *fields, *own, sums)
        self.times.append(float(time))
        self.samples.append(own)
        return bool(np.isfinite(sums).all())

    def forget(self, after: float) -> None:
        """Drop the samples of later times."""
        count = sum(time <= after for time in self.times)
        del self.times[count:], self.samples[count:]

    def polynomial(self, start: float) -> tuple[np.ndarray, list[tuple[np.ndarray, ...]]]:
        """Times counted from start, and fields, of the newest samples, newest first.

        Each field is a tuple of SAMPLES arrays, of which the first len(times) count.
        """
        times, recent = self.times[: -1 - SAMPLES : -1], self.samples[: -1 - SAMPLES : -1]
        recent = recent + [recent[-1]] * (SAMPLES - len(recent))
        return np.array(times) - start, list(zip(*recent, strict=True))

    @property
    def prediction_gap(self) -> np.ndarray:
        """(F,) rms over the beads of |extrapolated − received velocity| at the newest sample; 0 with one."""
        if len(self) < 2:
            return np.zeros(self.shape[0])
        before, earlier = self.times[-1 - SAMPLES : -1], self.samples[-1 - SAMPLES : -1]
        weights = np.zeros(SAMPLES)
        weights[: len(before)] = lagrange_weights(before, self.times[-1])
        predictors = [velocity for velocity, _ in earlier] + [earlier[0][0]] * (SAMPLES - len(earlier))
        new = self.samples[-1][0]
        square = blank(len(new))
        beads = self.shape[0] * self.shape[1]
        in_shares(_squared_gap, COPYING * beads, new, *predictors, weights, square)
        return np.sqrt(square.reshape(-1)[: self.shape[0]] / self.shape[1])

    def state(self) -> dict[str, np.ndarray]:
        """Times (S,) and samples (F, S, 2, 3N) of velocity and rotation."""
        fibers = self.shape[0]
        samples = [[unpack(field, (fibers, -1)) for field in sample] for sample in self.samples]
        return {"sample_times": np.array(self.times), "samples": np.moveaxis(np.array(samples), 2, 0)}

    def restore(self, state) -> None:
        """Take back what state() gave."""
        self.times = [float(time) for time in state["sample_times"]]
        samples = np.moveaxis(state["samples"], 0, 2)
        self.samples = [(pack(velocity), pack(rotation)) for velocity, rotation in samples]
