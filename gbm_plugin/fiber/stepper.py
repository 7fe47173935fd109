"""Advancing one family of fibers through samples of a flow: the one stepping code of all runs."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..simd import LANES, blank
from ..threads import COPYING, available, in_shares
from . import ab3, implicit
from .ambient import SAMPLES, Ambient
from .bending import FOLD
from .blocks import Samples
from .contact import repulsion_velocity
from .fibers import TOUCHING, Fibers, positive
from .layout import bead_positions, pack, unpack
from .model import AFFORDABLE, DIVIDED, MotionOptions
from .rates import material, rates_of_blocks
from .reaction import EXERT, Reaction, implicit_sigma, powers_of
from .reaction import scratch_rows as reaction_rows
from .state import check_state
from .strain import with_strain

TOLERANCE = 1e-3  # bead displacement over fiber length, and
SHARE = 0.1  # of it, the most that one accepted step may add
MOST_SUBSTEPS = 1_000_000  # of a flow step, by ab3
SMALLEST_STEP = 1e-20  # of a flow step, by implicit: stiff sharp folds open within 1e-14
LOST = 0.5  # [rad] estimated error of a sub-step of ab3 beyond which its links point nowhere in particular


class Stepper:
    """Time stepping of one family, fed with one sample of the flow at the beads per step.

    options: of model.MotionOptions. integrator "ab3": third order, sub-steps within eq. (10); "implicit": second, any
    step; "auto": ab3 where a few sub-steps within eq. (10) do and its error estimate allows, else implicit, fiber by
    fiber. ab3 has no tolerance: its sub-steps are stable, and as accurate as they happen to be; what is lost is
    refused.
    tolerance (for implicit and auto; None: 1e-3): bead displacement over fiber length. Every accepted step of
    every fiber is held to a tenth of it, in the rms rotation of its links, so that a relaxation of several
    steps stays within; those of ab3 in auto to all of it, for they are of third order and the estimate of second.
    repulsion: below about 1/time_step.

    need says what observe() takes beside the velocity. The loop of a run:

        stepper.observe(time, velocity, extra)                  # at stepper.positions
        each step:  stepper.advance(dt)
                    while stepper.provisional: observe(time + dt, …); stepper.correct()
                    stepper.observe(time + dt, …)
    """

    def __init__(self, fibers: Fibers, time: float = 0.0, *words: Any, **options: Any):
        """words, options: those of model.MotionOptions, in its order or by name."""
        self.fibers = fibers
        self._beads = fibers.count * fibers.beads
        motion = MotionOptions(*words, **options)
        self.integrator, self.mobility, self.repulsion = motion.integrator, motion.mobility, motion.repulsion
        self.need = "gradient" if motion.strain_coupling else "rotation"
        self.tolerance = TOLERANCE if motion.tolerance is None else motion.tolerance
        self.local_tolerance = SHARE * self.tolerance
        self.time = float(time)
        self.provisional = False
        self._ambient = Ambient(fibers.count, fibers.beads)
        self._push: NDArray | None = None  # velocities of repulsion at the newest sample
        self._reacting: NDArray | None = None  # scratch of reaction()
        self._material = material(fibers)
        # before and after the last step: links and centre; multipliers; rates w_(n−1), w_(n−2) and their ages
        self._state = pack(np.concatenate([fibers.links, fibers.centres[:, None]], axis=1))
        blocks, rows = self._state.shape[:2]
        self._last = blank(blocks, rows)
        self._multipliers = blank(blocks, rows - 3)
        self._last_multipliers = blank(blocks, rows - 3)
        self._last_rates = [blank(blocks, rows) for _ in range(2)]
        self._rates = list(self._last_rates)
        self._spare = [blank(blocks, rows) for _ in range(2)]
        self._last_ages: list[float] = []
        self._ages: list[float] = []
        self._last_step = np.full(fibers.count, np.inf)  # suggested to each fiber
        self._step = self._last_step.copy()
        self._tensions = np.zeros(fibers.count)  # over 6πμa, in the last step; and their largest
        self._last_tension = 0.0
        self._tension = 0.0
        self._start, self._length = self.time, 0.0  # of the last step
        self._scratch = blank(available(), self._scratch_rows())
        self._counts = {
            "steps": 0,
            "ab3_steps": 0,
            "substeps": 0,
            "refinements": 0,
            "refined_fibers": 0,
            "worst_error": 0.0,
        }

    def _scratch_rows(self) -> int:
        steps = {"ab3": (ab3,), "implicit": (implicit,), "auto": (ab3, implicit)}[self.integrator]
        return max(step.scratch_rows(self.mobility, self.fibers.beads) for step in steps)

    @property
    def positions(self) -> np.ndarray:
        """(F, N, 3) bead centres now, unwrapped."""
        positions = np.empty((self.fibers.count, self.fibers.beads, 3))
        in_shares(
            bead_positions,
            COPYING * self._beads,
            self._state,
            2 * self.fibers.radius,
            self._scratch,
            positions,
            most=len(self._scratch),
        )
        return positions

    @property
    def tension(self) -> np.ndarray:
        """(F, N−1) [N] of each link now, positive where it is pulled: the multiplier of its fixed length, in the flow
        of the newest sample. ValueError where that is of another time."""
        links, _, forces = self._instant()
        return (links * forces).sum(axis=2)

    @property
    def bead_velocities(self) -> np.ndarray:
        """(F, N, 3) [m/s] of the beads now, in the flow of the newest sample. ValueError as of tension."""
        links, (turns, drift), _ = self._instant()
        steps = 2 * self.fibers.radius * np.cross(turns, links)
        along = np.concatenate([np.zeros_like(steps[:, :1]), np.cumsum(steps, axis=1)], axis=1)
        return along + (drift - along.mean(axis=1))[:, None]

    def _instant(self) -> tuple[np.ndarray, tuple[np.ndarray, np.ndarray], np.ndarray]:
        """Links, their rates and that of the centre, and contact forces, as of instant_rates."""
        if not self.samples or self.sampled_until != self.time:
            raise ValueError(f"no sample of the flow at time {self.time:g}: observe() comes before")
        sample = self._ambient.samples[-1]
        turns, drift, forces = rates_of_blocks(self.fibers, self._state, *sample, self.mobility)
        links = unpack(self._state, (self.fibers.count, self.fibers.beads, 3))[:, :-1]
        return links, (turns, drift), forces

    @property
    def prediction_gap(self) -> np.ndarray:
        """(F,) rms over beads of |predicted − received ambient velocity| at the newest sample."""
        return self._ambient.prediction_gap

    @property
    def samples(self) -> int:
        """Samples at hand, four at most; the newest is of sampled_until."""
        return len(self._ambient)

    @property
    def sampled_until(self) -> float:
        """Time of the newest sample."""
        return self._ambient.times[-1]

    @property
    def flow_error(self) -> np.ndarray:
        """(F,) bead displacement, over fiber length, that extrapolating the flow over the last step cost: known once
        the sample at its end is there.

        The predicted velocity errs by c Π(t − t_i), t_i the times of the samples in the polynomial, and the prediction
        gap is its error at the end: c, and with it the integral over the step, follow. A step that was corrected is
        better than that.
        """
        before = self._ambient.times[-1 - SAMPLES : -1]
        if not before:
            return np.zeros(self.fibers.count)
        # coefficients of Π in units of the step, from its start: by numpy.poly they take a third of a small step
        error = [1.0]
        for time in before:
            node = (time - self._start) / self._length
            error = [a - node * b for a, b in zip([0.0, *error], [*error, 0.0], strict=True)]
        share = sum(c / (power + 1) for power, c in enumerate(error)) / sum(error)
        return abs(share) * self._length * self.prediction_gap / self.fibers.contour_length

    def observe(self, time: float, velocity: ArrayLike, extra: ArrayLike | None) -> None:
        """Take the flow at the current positions: velocity (F, N, 3); rotation (F, N, 3) or gradient.

        A second sample at the same time replaces the first. Raises ValueError for another time or shape,
        FloatingPointError for NaN, and for a fiber so far away that rounding blurs its beads.
        """
        if time != self.time:
            raise ValueError(f"sample is of time {time:g}; the fibers are at time {self.time:g}")
        self._near()
        tail = (3, 3) if self.need == "gradient" else (3,)
        given = {
            "velocity": self._field("velocity", velocity, (3,)),
            self.need: self._field(self.need, extra, tail),
        }
        own, turning = given.values()
        if self.need == "gradient":
            own, turning = with_strain(self.positions, own, turning, self.fibers.radius)
        if self.repulsion:
            self._push = repulsion_velocity(self.positions, 2 * self.fibers.radius, self.repulsion)
            own = own + self._push
        if not self._ambient.observe(time, own, turning):
            self._refuse(given)

    def _field(self, name: str, values: ArrayLike | None, tail: tuple[int, ...]) -> NDArray:
        """Sampled values, if they are (F, N, *tail)."""
        array, shape = np.asarray(values, dtype=float), (self.fibers.count, self.fibers.beads, *tail)
        if array.shape != shape:
            raise ValueError(f"sampled {name} has shape {array.shape}; it must be {shape}")
        return array

    def _refuse(self, given: Mapping[str, NDArray]) -> None:
        """FloatingPointError naming the first fiber at which one of the sampled fields is not finite."""
        for name, field in given.items():
            wrong = np.flatnonzero(~np.isfinite(field).reshape(len(field), -1).all(axis=1))
            if len(wrong):
                raise FloatingPointError(
                    f"sampled {name} is not finite at fiber {wrong[0]}, time {self.time:g}, "
                    f"after step {self._counts['steps']}"
                )

    def reaction(self, time_step: float) -> Reaction:
        """Force and torque (F, N, 3) of every bead on the fluid at the newest sample, which is of the present time,
        and their powers. time_step: of the run, within which stiff modes of implicit fibers relax (reaction.py).

        Raises ValueError without a sample of the present time.
        """
        if not self._ambient.times or self._ambient.times[-1] != self.time:
            raise ValueError(
                f"no sample of the flow at time {self.time:g}; observe() comes before reaction()"
            )
        fibers, mu = self.fibers, self.fibers.viscosity
        if self._reacting is None:
            rows = reaction_rows(self.mobility, fibers.beads)
            self._reacting = blank(available(), rows)
        velocity, rotation = self._ambient.samples[-1]
        drag = 6 * np.pi * mu * fibers.radius
        sizes, out = np.array([drag, drag * fibers.radius]), np.empty((fibers.count, 2, fibers.beads, 3))
        powers = blank(len(self._state), 3)
        in_shares(
            EXERT[self.mobility, self.integrator != "ab3"],
            self._beads,
            self._material,
            implicit_sigma(time_step, fibers.radius),
            self._state,
            velocity,
            rotation,
            self._reacting,
            sizes,
            powers,
            out,
            most=len(self._reacting),
        )
        force, torque = out[:, 0], out[:, 1]
        if self._push is not None:
            force = force + drag * self._push
        return Reaction(force, torque, *powers_of(powers, fibers.count, mu, fibers.radius))

    def _near(self) -> None:
        """FloatingPointError where a fiber is so far from the origin that its beads could not be told apart."""
        reach = TOUCHING * 2 * self.fibers.radius / np.finfo(float).eps
        if not np.abs(self._state[:, -3:]).max() <= reach:
            far = ~(np.abs(unpack(self._state[:, -3:], (self.fibers.count, 3))).max(axis=1) <= reach)
            raise FloatingPointError(
                f"fiber {np.flatnonzero(far)[0]} is more than {reach:.2g} from the origin at time {self.time:g}: "
                f"double precision no longer tells its beads apart, whose diameter is {2 * self.fibers.radius:g}"
            )

    def advance(self, time_step: float) -> None:
        """Advance by time_step, extrapolating the samples in time along each bead's path.

        Raises ValueError without a sample at the present time, and where ab3 cannot take the step; FloatingPointError
        where a fiber becomes NaN, or too stiff for its bends.
        """
        length = positive("time_step", time_step)
        if not self._ambient.times or self._ambient.times[-1] != self.time:
            raise ValueError(f"no sample of the flow at time {self.time:g}; observe() comes before advance()")
        self.provisional = len(self._ambient) < SAMPLES
        self._start, self._length = self.time, length
        self._state, self._last = self._last, self._state
        self._multipliers, self._last_multipliers = self._last_multipliers, self._multipliers
        pool = [*self._last_rates, *self._spare]
        self._last_rates = self._rates
        self._spare = [array for array in pool if not any(array is kept for kept in self._rates)]
        self._last_ages, self._last_tension = self._ages, self._tension
        self._last_step = self._step.copy()
        self._counts["steps"] += 1
        self._run()

    def correct(self) -> None:
        """Redo the last step with the sample at its end included."""
        if not self._length or self._ambient.times[-1] != self.time:
            raise ValueError("correct() follows advance() and the observe() at its end")
        self.provisional = False
        self._run()

    def undo(self) -> None:
        """Take the last step back, with the sample at its end; the next may be shorter. Not twice."""
        if self.time != self._start + self._length or not self._length:
            raise ValueError("undo() follows advance(), once")
        self._ambient.forget(after=self._start)
        self.time, self._length, self.provisional = self._start, 0.0, False
        self._state, self._last = self._last, self._state
        self._multipliers, self._last_multipliers = self._last_multipliers, self._multipliers
        self._rates, self._ages = self._last_rates, self._last_ages
        self._step, self._tension = self._last_step, self._last_tension
        self._counts["steps"] -= 1

    def _run(self) -> None:
        """The last step, from its kept start, with the samples that there are."""
        self.time = self._start + self._length
        self._step[:] = self._last_step
        if self.integrator == "implicit":
            self._implicit(np.arange(self.fibers.count))
            return
        count = self._substeps()
        if self.integrator == "ab3":
            if count > MOST_SUBSTEPS:
                raise ValueError(
                    f"ab3 would need {count:.3g} sub-steps in a step of {self._length:g}; at most "
                    f"{MOST_SUBSTEPS} are allowed: take the implicit integrator"
                )
            self._followed(self._explicit(count), count)
        else:
            self._by_turns(count)
        self._tension = float(self._tensions.max())

    def _by_turns(self, count: int) -> None:
        """By ab3 where its count sub-steps are affordable, and by implicit steps what is left or all."""
        everyone = np.arange(self.fibers.count)
        if count <= AFFORDABLE * np.clip(self._length / self._step, 1, DIVIDED).mean():
            error = self._explicit(count)
            self._multipliers[:] = self._last_multipliers  # from which a later implicit step goes on
            if not np.isfinite(error).all():
                self._forget_lost()
            self._implicit(everyone[~(error <= self.tolerance)])
        else:
            self._ages = []
            self._implicit(everyone)

    def _forget_lost(self) -> None:
        """After an attempt that went wrong: its rates make no history, and lanes beyond the last fiber stay."""
        self._ages = []
        for rates in self._rates:
            np.nan_to_num(rates, copy=False, nan=0.0, posinf=0.0, neginf=0.0)
        lost = ~np.isfinite(self._state).all(axis=1)
        np.copyto(self._state, self._last, where=lost[:, None])

    def _substeps(self) -> int:
        """Sub-steps that keep ab3 stable: eq. (10), less for bent discrete rods and under great tension."""
        fibers = self.fibers
        softness = 1.0
        if fibers.curvature_law == "discreteRod":
            links = self._last.reshape(len(self._last), fibers.beads, 3, LANES)[:, :-1]
            cosine = (links[:, 1:] * links[:, :-1]).sum(axis=2).min(initial=1.0)
            softness = min(1.0, 0.5 * max(1.0 + cosine, FOLD))
        limit = ab3.stable_step(fibers, softness, self._last_tension)
        return max(1, int(np.ceil(min(self._length / limit * (1 - 1e-12), 1e18))))

    def _explicit(self, count: int) -> np.ndarray:
        """All fibers by ab3 in count sub-steps; returns the error estimates (F,)."""
        fibers, h = self.fibers, self._length / count
        times, (velocity, rotation) = self._ambient.polynomial(self._start)
        error, tension = blank(len(self._state)), blank(len(self._state))
        new, old = self._spare
        in_shares(
            ab3.ADVANCE[self.mobility],
            self._beads,
            self._material,
            Samples(velocity, rotation, times),
            ab3.plan(self._last_ages, h, ab3.sample_weights(times, h, count)),
            ab3.History(self._last, *self._last_rates),
            ab3.History(self._state, new, old),
            self._scratch,
            error,
            tension,
            most=len(self._scratch),
        )
        self._rates = [new, self._last_rates[0] if count == 1 else old]
        self._ages = [h, 2 * h] if count > 1 else [h, *(age + h for age in self._last_ages[:1])]
        self._tensions[:] = tension.reshape(-1)[: fibers.count]
        error = error.reshape(-1)[: fibers.count]
        self._count(count, error if self.integrator == "ab3" else error[:0])
        self._counts["ab3_steps"] += 1
        return error

    def _implicit(self, members: np.ndarray) -> None:
        """The given fibers by linearly implicit steps, each with as many as its error estimate asks for."""
        fibers, end = self.fibers, self._length
        times, (velocity, rotation) = self._ambient.polynomial(self._start)
        samples = Samples(velocity, rotation, times)
        elapsed, error, trial = np.zeros(fibers.count), np.zeros(fibers.count), np.zeros(fibers.count)
        pace = implicit.Pace(trial, elapsed, self._step, error, self._tensions)
        before = implicit.Ends(self._last, self._last_multipliers)
        after = implicit.Ends(self._state, self._multipliers)
        attempts, refined = 0, np.zeros(0, dtype=int)
        while len(members):
            remaining = end - elapsed[members]
            trial[members] = remaining / np.ceil(np.maximum(remaining / self._step[members] * (1 - 1e-12), 1))
            work = (
                self._material,
                members,
                samples,
                self.local_tolerance,
                before,
                after,
                pace,
                self._scratch,
            )
            in_shares(
                implicit.ATTEMPT[self.mobility], len(members) * fibers.beads, *work, most=len(self._scratch)
            )
            before = after
            attempts += 1
            self._count(0, error[members][error[members] <= self.local_tolerance])
            self._possible(members[trial[members] < SMALLEST_STEP * end], error)
            members = members[elapsed[members] < end * (1 - 1e-12)]
            if attempts == 1:
                refined = members
            self._counts["refinements"] += len(members)
        self._counts["refined_fibers"] += len(refined)
        self._counts["substeps"] += attempts

    def _followed(self, error: np.ndarray, count: int) -> None:
        """ValueError where ab3 did not follow the motion, FloatingPointError where it became NaN."""
        self._finite(error)
        if not error.max() <= LOST:
            raise ValueError(
                f"ab3 loses fiber {error.argmax()} in step {self._counts['steps']}, from time {self._start:g}: links "
                f"turn by {error.max():.2g} rad more in third than in second order within {self._length / count:.3g}; "
                "take shorter steps, or the integrator implicit or auto"
            )

    def _possible(self, members: np.ndarray, error: np.ndarray) -> None:
        """FloatingPointError where implicit needs steps that are too short, of which the first fiber is named."""
        if not len(members):
            return
        self._finite(error[members], members)
        raise FloatingPointError(
            f"fiber {members[0]} needs steps below {SMALLEST_STEP:g} of {self._length:g} in step "
            f"{self._counts['steps']}, from time {self._start:g}: it is too stiff for so bent a shape"
        )

    def _count(self, substeps: int, error: np.ndarray) -> None:
        self._counts["substeps"] += substeps
        self._counts["worst_error"] = max(self._counts["worst_error"], float(error.max(initial=0.0)))

    def _finite(self, error: NDArray, members: NDArray | None = None) -> None:
        """FloatingPointError naming the first fiber whose estimate is NaN."""
        wrong = np.flatnonzero(~np.isfinite(error))
        if len(wrong):
            fiber = wrong[0] if members is None else members[wrong[0]]
            raise FloatingPointError(
                f"fiber {fiber} has no finite solution in step {self._counts['steps']}, "
                f"from time {self._start:g} to {self.time:g}"
            )

    def report(self) -> dict:
        """Counts since the start: steps, sub-steps, refinements, fibers refined, worst accepted estimate."""
        return dict(self._counts)

    def state(self) -> dict[str, np.ndarray]:
        """Everything that a bitwise restart needs; arrays of fibers have these in their first dimension."""
        count = self.fibers.count
        own = {
            "time": np.array(self.time),
            "links_and_centres": unpack(self._state, (count, -1)),
            "multipliers": unpack(self._multipliers, (count, -1)),
            "rates": np.stack([unpack(rates, (count, -1)) for rates in self._rates], axis=1),
            "rate_ages": np.array(self._ages),
            "suggested_step": self._step.copy(),
            "tension": np.array(self._tension),
        }
        return {**own, **self._ambient.state()}

    def restore(self, state: Mapping[str, NDArray]) -> None:
        """Take back what state() gave; ValueError if it is not of these fibers, or none at all."""
        check_state(state, self.fibers.count, self.fibers.beads)
        self.time = float(state["time"])
        pack(state["links_and_centres"], self._state)
        pack(state["multipliers"], self._multipliers)
        self._rates = [pack(rates) for rates in np.moveaxis(state["rates"], 1, 0)]
        self._last_rates = list(self._rates)
        self._ages = [float(age) for age in state["rate_ages"]]
        self._step = np.array(state["suggested_step"])
        self._tension = float(state["tension"])
        self.provisional = False
        self._ambient.restore(state)


def merged_states(states: Sequence[dict], part: slice) -> dict[str, np.ndarray]:
    """The state of some fibers out of the states of groups that follow each other in one family.

    Groups whose explicit steps had different lengths lose the history of their rates: the next step begins
    that anew. ValueError where they are of different times.
    """
    merged = {
        key: np.concatenate([state[key] for state in states])[part]
        for key in ("links_and_centres", "multipliers", "rates", "suggested_step", "samples")
    }
    first = states[0]
    for key in ("time", "sample_times"):
        if not all(np.array_equal(first[key], state[key]) for state in states):
            raise ValueError(f"the parts of a family differ in {key.replace('_', ' ')}")
        merged[key] = first[key]
    same = all(np.array_equal(first["rate_ages"], state["rate_ages"]) for state in states)
    merged["rate_ages"] = first["rate_ages"] if same else np.zeros(0)
    merged["tension"] = np.max([state["tension"] for state in states])
    return merged
