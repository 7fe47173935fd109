"""The flow along each bead's own path: the samples received, and the polynomial in time through them."""

from __future__ import annotations

import numpy as np

from .layout import pack, unpack

SAMPLES = 3  # in the polynomial in time
KEPT = SAMPLES + 1  # one more, to compare the newest with its prediction


def lagrange_weights(times, time: float) -> np.ndarray:
    """Weights of values at the given times in their interpolating polynomial at one time."""
    times = np.asarray(times, dtype=float)
    weights = np.ones(len(times))
    for j, own in enumerate(times):
        for other in np.delete(times, j):
            weights[j] *= (time - other) / (own - other)
    return weights


class Ambient:
    """The newest samples of velocity and rotation at the beads, newest last."""

    def __init__(self, fibers: int, beads: int):
        self.shape = (fibers, beads)
        self.times: list[float] = []
        self.samples: list[tuple[np.ndarray, ...]] = []  # each (velocity, rotation) in blocks

    def __len__(self) -> int:
        return len(self.times)

    def observe(self, time: float, velocity, rotation) -> None:
        """Take a sample (F, N, 3) of each; one at the newest time replaces that one."""
        if self.times and time < self.times[-1]:
            raise ValueError(f"sample at time {time:g} is older than the last one, at {self.times[-1]:g}")
        buffers = (None, None)
        if self.times and time == self.times[-1]:
            buffers = self.samples.pop()
            self.times.pop()
        elif len(self.times) == KEPT:
            buffers = self.samples.pop(0)
            self.times.pop(0)
        self.times.append(float(time))
        self.samples.append((pack(velocity, buffers[0]), pack(rotation, buffers[1])))

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
        gap = self.samples[-1][0].copy()
        for weight, sample in zip(lagrange_weights(before, self.times[-1]), earlier, strict=True):
            gap -= weight * sample[0]
        gap = unpack(gap, (*self.shape, 3))
        return np.sqrt((gap**2).sum(axis=2).mean(axis=1))

    def state(self) -> dict[str, np.ndarray]:
        """Times and samples, in blocks."""
        return {"sample_times": np.array(self.times), "samples": np.array(self.samples)}

    def restore(self, state) -> None:
        """Take back what state() gave."""
        self.times = [float(time) for time in state["sample_times"]]
        self.samples = [(np.array(velocity), np.array(rotation)) for velocity, rotation in state["samples"]]
