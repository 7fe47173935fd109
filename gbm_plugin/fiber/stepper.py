"""Advancing one family of fibers through samples of a flow: the one stepping code of all runs."""

from __future__ import annotations

import numpy as np
from numba import get_num_threads

from . import ab3
from .ambient import Ambient, lagrange_weights
from .bending import CURVATURE_LAWS, velocity_scale
from .fibers import Fibers, one_of, positive
from .layout import bead_positions, pack, unpack
from .simd import LANES

INTEGRATORS = ("ab3",)
MOBILITIES = ("freeDrain",)


class Stepper:
    """Time stepping of one family, fed with one sample of the flow at the beads per step."""

    def __init__(
        self,
        fibers: Fibers,
        time=0.0,
        integrator="ab3",
        mobility="freeDrain",
        strain_coupling=False,
        tolerance=None,
    ):
        self.fibers = fibers
        self.integrator = one_of("integrator", integrator, INTEGRATORS)
        self.mobility = one_of("mobility", mobility, MOBILITIES)
        self.need = "gradient" if strain_coupling else "rotation"
        self.time = float(time)
        self.provisional = False
        self._ambient = Ambient(fibers.count, fibers.beads, self.need)
        self._beta = pack(velocity_scale(fibers))[:, 0]
        self._state = pack(np.concatenate([fibers.links, fibers.centres[:, None]], axis=1))
        self._last = np.empty_like(self._state)
        self._spare = [np.zeros_like(self._state) for _ in range(2)]
        self._given = [np.zeros_like(self._state) for _ in range(2)]  # rates w_(n−1), w_(n−2) before the last step
        self._rates = list(self._given)  # and after it
        self._ages: list[float] = []
        self._before = None
        self._error = np.zeros((len(self._state), LANES))
        self._tension = np.zeros_like(self._error)
        self._scratch = np.zeros((get_num_threads(), 10 * self._state.shape[1], LANES))
        self._report = {"substeps": 0, "refinements": 0, "worst_error": 0.0}

    @property
    def positions(self) -> np.ndarray:
        """(F, N, 3) bead centres now, unwrapped."""
        positions = np.empty((self.fibers.count, self.fibers.beads, 3))
        bead_positions(self._state, 2 * self.fibers.radius, positions)
        return positions

    @property
    def prediction_gap(self) -> np.ndarray:
        """(F,) rms over beads of |predicted − received ambient velocity| at the newest sample."""
        return self._ambient.prediction_gap

    def observe(self, time, velocity, extra) -> None:
        """Take the flow at the current positions: velocity (F, N, 3), rotation (F, N, 3) or gradient (F, N, 3, 3)."""
        if time != self.time:
            raise ValueError(f"sample is of time {time:g}; the fibers are at time {self.time:g}")
        self._ambient.observe(time, velocity, extra)

    def advance(self, time_step) -> None:
        """Advance by time_step, extrapolating the samples in time along each bead's path."""
        step = positive("time_step", time_step)
        if not self._ambient.times or self._ambient.times[-1] != self.time:
            raise ValueError(f"no sample of the flow at time {self.time:g}; observe() comes before advance()")
        self.provisional = len(self._ambient) < 3
        self._before = (self.time, step, list(self._ages))
        self._state, self._last = self._last, self._state
        pool = [*self._given, *self._spare]
        self._given = self._rates
        self._spare = [array for array in pool if not any(array is kept for kept in self._given)]
        self._step()

    def correct(self) -> None:
        """Redo the last step with the sample at its end included."""
        if not self.provisional or self._ambient.times[-1] != self.time:
            raise ValueError("correct() follows a provisional advance() and the observe() at its end")
        self.provisional = False
        self._step()

    def _step(self) -> None:
        """From _last at the time of _before into _state, with the samples that there are."""
        start, step, ages = self._before
        fibers = self.fibers
        limit = fibers.viscosity * (2 * fibers.radius) ** 4 / max(fibers.bending_stiffness.max(), 1e-300)
        count = max(1, int(np.ceil(step / limit * (1 - 1e-12))))
        h = step / count
        times, samples = self._ambient.recent()
        weights = np.zeros((count, 2, 3))
        for s in range(count):
            for stage in range(2):
                weights[s, stage, : len(times)] = lagrange_weights(times, start + (s + 0.5 * stage) * h)
        velocity, rotation = ([*field, field[0], field[0]][:3] for field in list(zip(*samples, strict=True))[:2])
        (given_new, given_old), (new, old) = self._given, self._spare
        ab3.advance(
            self._last, (given_new, new), (given_old, old), tuple(velocity), tuple(rotation), weights,
            ab3.plan(ages, h, count), self._beta, fibers.radius, CURVATURE_LAWS.index(fibers.curvature_law),
            self._scratch, self._state, self._error, self._tension,
        )  # fmt: skip
        self._rates = [new, given_new if count == 1 else old]
        self._ages = [h, *(2 * h if count > 1 else age + h for age in ([0.0] if count > 1 else ages[:1]))]
        self.time = start + step
        self._report["substeps"] += count
        if not np.isfinite(self._error).all():
            fiber = int(np.argmin(np.isfinite(unpack(self._error[:, None], (fibers.count, 1))[:, 0])))
            raise FloatingPointError(f"fiber {fiber} became NaN in the step from time {start:g} to {self.time:g}")

    def report(self) -> dict:
        """Counts since the start: sub-steps, refinements, worst error estimate."""
        return dict(self._report)

    def state(self) -> dict[str, np.ndarray]:
        """Everything that a bitwise restart needs."""
        own = {"time": np.array(self.time), "fibers": self._state.copy(), "rate_ages": np.array(self._ages)}
        return {**own, "rates": np.stack(self._rates), **self._ambient.state()}

    def restore(self, state) -> None:
        """Take back what state() gave."""
        if state["fibers"].shape != self._state.shape:
            raise ValueError(
                f"state holds blocks of shape {state['fibers'].shape}; these fibers need {self._state.shape}"
            )
        self.time = float(state["time"])
        self._state[...] = state["fibers"]
        self._rates = [np.array(rates) for rates in state["rates"]]
        self._given = list(self._rates)
        self._ages = [float(age) for age in state["rate_ages"]]
        self.provisional = False
        self._ambient.restore(state)
