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
    """The newest samples of velocity, rotation (and strain) at the beads, newest last."""

    def __init__(self, fibers: int, beads: int, need: str):
        self.shape = (fibers, beads)
        self.need = need
        self.times: list[float] = []
        self.samples: list[tuple[np.ndarray, ...]] = []  # each (velocity, rotation[, strain]) in blocks

    def __len__(self) -> int:
        return len(self.times)

    def observe(self, time: float, velocity, extra) -> None:
        """Take a sample (F, N, 3), (F, N, 3) or (F, N, 3, 3); one at the newest time replaces that one."""
        fields = self._fields(time, velocity, extra)
        if self.times and time < self.times[-1]:
            raise ValueError(f"sample at time {time:g} is older than the last one, at {self.times[-1]:g}")
        if self.times and time == self.times[-1]:
            buffers = self.samples.pop()
            self.times.pop()
        elif len(self.times) == KEPT:
            buffers = self.samples.pop(0)
            self.times.pop(0)
        else:
            buffers = (None,) * len(fields)
        self.times.append(float(time))
        self.samples.append(tuple(pack(field, out) for field, out in zip(fields, buffers, strict=True)))

    def _fields(self, time, velocity, extra) -> tuple[np.ndarray, ...]:
        velocity, extra = np.asarray(velocity, dtype=float), np.asarray(extra, dtype=float)
        tail = (3, 3) if self.need == "gradient" else (3,)
        for name, array, shape in (
            ("velocity", velocity, (*self.shape, 3)),
            (self.need, extra, (*self.shape, *tail)),
        ):
            if array.shape != shape:
                raise ValueError(f"sampled {name} has shape {array.shape}; it must be {shape}")
            if not np.isfinite(array.sum()):
                wrong = np.flatnonzero(~np.isfinite(array).reshape(len(array), -1).all(axis=1))
                raise FloatingPointError(f"sampled {name} at time {time:g} is not finite at fiber {wrong[0]}")
        if self.need == "rotation":
            return velocity, extra
        gradient, transpose = extra, np.swapaxes(extra, -1, -2)
        curl = (transpose - gradient)[..., [1, 2, 0], [2, 0, 1]]
        strain = 0.5 * (gradient + transpose)[..., [0, 0, 0, 1, 1, 2], [0, 1, 2, 1, 2, 2]]
        return velocity, 0.5 * curl, strain

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
        kinds = zip(*self.samples, strict=True) if self.samples else ()
        stacked = {f"sample_{kind}": np.stack(arrays) for kind, arrays in enumerate(kinds)}
        return {"sample_times": np.array(self.times), **stacked}

    def restore(self, state) -> None:
        """Take back what state() gave."""
        self.times = [float(time) for time in state["sample_times"]]
        kinds = 3 if self.need == "gradient" else 2
        self.samples = [
            tuple(np.array(state[f"sample_{kind}"][j]) for kind in range(kinds)) for j in range(len(self.times))
        ]
