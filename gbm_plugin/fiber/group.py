"""Families of fibers that move through one flow, which is sampled once for all of them."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager

import numpy as np
from numpy.typing import NDArray

from ..sampling import NEEDS, rotation_of
from .reaction import Reaction
from .stepper import Stepper


class Group:
    """Steppers as one: the calls are those of Stepper, for beads (B, 3) of all families one after the other.

    names: of the families, by which errors name them; one alone has none.
    """

    def __init__(self, steppers: Sequence[Stepper], names: Sequence[str] = ()):
        self.steppers = tuple(steppers)
        self._names = list(names) or [str(n) for n in range(len(self.steppers))] * (len(self.steppers) > 1)
        ends = np.cumsum([s.fibers.count * s.fibers.beads for s in self.steppers])
        self._parts = [
            slice(end - s.fibers.count * s.fibers.beads, end) for s, end in zip(steppers, ends, strict=True)
        ]
        self.beads = int(ends[-1])
        self._positions: NDArray | None = None

    @property
    def time(self) -> float:
        """Of all."""
        return self.steppers[0].time

    @property
    def need(self) -> str:
        """What must be sampled for all: "velocity", "rotation" or "gradient"."""
        return max((s.need for s in self.steppers), key=NEEDS.index)

    @property
    def positions(self) -> NDArray:
        """(B, 3), to be read only."""
        if self._positions is None:
            parts = [s.positions.reshape(-1, 3) for s in self.steppers]
            self._positions = parts[0] if len(parts) == 1 else np.concatenate(parts)
            self._positions.flags.writeable = False
        return self._positions

    @property
    def by_family(self) -> list[NDArray]:
        """Positions (F, N, 3) of each family."""
        return self.split(self.positions)

    def split(self, beads: NDArray) -> list[NDArray]:
        """Values (B, ...) at all beads as one array (F, N, ...) for each family."""
        shapes = [(s.fibers.count, s.fibers.beads) for s in self.steppers]
        return [
            beads[part].reshape(*shape, *beads.shape[1:])
            for part, shape in zip(self._parts, shapes, strict=True)
        ]

    def observe(self, time: float, velocity: NDArray, extra: NDArray | None) -> None:
        """Take the flow at the present positions: velocity (B, 3) and what `need` says, from which each family takes
        its own."""
        velocities = self.split(np.asarray(velocity))
        extras = [None] * len(velocities) if extra is None else self.split(np.asarray(extra))
        for number, (own, other) in enumerate(zip(velocities, extras, strict=True)):
            with self._named(number) as stepper:
                stepper.observe(time, own, _needed(stepper.need, other))

    def reaction(self, time_step: float) -> Reaction:
        """Forces and torques (B, 3) on the fluid at the newest sample, and the powers of all; as that of Stepper."""
        parts = [s.reaction(time_step) for s in self.steppers]
        force = np.concatenate([p.force.reshape(-1, 3) for p in parts])
        torque = np.concatenate([p.torque.reshape(-1, 3) for p in parts])
        return Reaction(force, torque, sum(p.bending for p in parts), sum(p.friction for p in parts))

    def advance(self, time_step: float) -> None:
        """All by one step."""
        self._positions = None
        for number in range(len(self.steppers)):
            with self._named(number) as stepper:
                stepper.advance(time_step)

    @property
    def provisional(self) -> bool:
        """Whether any must be corrected with a sample at the end of the step."""
        return any(s.provisional for s in self.steppers)

    def correct(self) -> None:
        """Redo the last step of those that must; of all, where none must."""
        self._positions = None
        some = self.provisional
        for number in range(len(self.steppers)):
            with self._named(number) as stepper:
                if stepper.provisional or not some:
                    stepper.correct()

    @contextmanager
    def _named(self, number: int) -> Iterator[Stepper]:
        """The stepper of a family, whose errors then say of which."""
        try:
            yield self.steppers[number]
        except (ValueError, FloatingPointError) as error:
            if not self._names:
                raise
            raise type(error)(f"family {self._names[number]}: {error}") from None

    def undo(self) -> None:
        """Take the last step back."""
        self._positions = None
        for s in self.steppers:
            s.undo()


def _needed(need: str, extra: NDArray | None) -> NDArray | None:
    """What one family needs, (F, N, ...), of what was sampled for all."""
    if need == "velocity" or extra is None:
        return None
    return rotation_of(extra) if need == "rotation" and extra.ndim == 4 else extra
