"""The choices of the model: every option with its words, its default and its checks, and the limits of auto's own
choice, here and nowhere else.

A field is a keyword of `Fibers` (those of FiberOptions) or of `Stepper` and `simulate` (those of MotionOptions); in
constant/fiberProperties it is an entry in camel case: bending_torque is bendingTorque.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field, fields
from typing import Any

INTEGRATORS = ("ab3", "implicit", "auto")
MOBILITIES = ("freeDrain", "rpy")
BENDING_TORQUES = ("consistent", "asPrinted")
CURVATURE_LAWS = ("sine", "discreteRod")
# sub-steps of ab3 that cost as much as an implicit step (docs/accuracy.md): so many auto takes,
AFFORDABLE = 12
DIVIDED = 4  # times the implicit steps that a flow step is divided into, so many at most


class ModelError(ValueError):
    """An option that cannot be: its name, and what is wrong with it."""

    def __init__(self, option: str, wrong: str):
        super().__init__(f"{option} {wrong}")
        self.option, self.wrong = option, wrong


def _word(allowed: tuple[str, ...]) -> Any:
    """An option that is one of these words; the first is the default."""
    return field(default=allowed[0], metadata={"allowed": allowed})


class _Options:
    """Checks every field by what it was declared with."""

    def __post_init__(self) -> None:
        for option in fields(self):  # type: ignore[arg-type]
            name, value = option.name, getattr(self, option.name)
            if allowed := option.metadata.get("allowed"):
                if value not in allowed:
                    raise ModelError(name, f"is {value!r}; allowed are {', '.join(allowed)}")
            elif isinstance(option.default, bool):
                object.__setattr__(self, name, bool(value))
            elif value is not None:
                number, least = float(value), option.metadata["least"]
                if not math.isfinite(number) or number < 0 or (number == 0 and least == "positive"):
                    raise ModelError(name, f"is {value}; it must be finite and {least}")
                object.__setattr__(self, name, number)
        self._check_together()

    def _check_together(self) -> None:
        """ModelError where options do not go with each other."""


@dataclass(frozen=True)
class FiberOptions(_Options):
    """What fibers are made of. Raises ModelError, a ValueError.

    bending_torque: derived from the bending energy, or eq. (6) as printed, twice as stiff. curvature_law: the
    paper's, which weakens beyond 90° between links, or that of a discrete rod, which resists folding.
    """

    bending_torque: str = _word(BENDING_TORQUES)
    curvature_law: str = _word(CURVATURE_LAWS)


@dataclass(frozen=True)
class MotionOptions(_Options):
    """How fibers are moved. Raises ModelError, a ValueError.

    integrator: third order with sub-steps, implicit of second order, or whichever allows the step. mobility: beads
    each alone, or with each other (Rotne–Prager–Yamakawa). strain_coupling: beads feel the ambient strain through
    each other, with rpy. tolerance, of implicit and auto: bead displacement over fiber length; None: theirs.
    repulsion [1/s]: rate at which overlaps of beads that are not neighbours decay; of beads in one place it has no
    direction, and with rpy they have one mobility and stay together.
    """

    integrator: str = _word(INTEGRATORS)
    mobility: str = _word(MOBILITIES)
    strain_coupling: bool = False
    tolerance: float | None = field(default=None, metadata={"least": "positive"})
    repulsion: float = field(default=0.0, metadata={"least": "not negative"})

    def _check_together(self) -> None:
        if self.strain_coupling and self.mobility == "freeDrain":
            raise ModelError("strain_coupling", "with mobility freeDrain has no effect; it needs rpy")


@dataclass(frozen=True)
class Model(FiberOptions, MotionOptions):
    """The whole choice, as a case makes it; it leaves the integrator to each family's stiffness (docs/accuracy.md)."""

    integrator: str = field(default="auto", metadata={"allowed": INTEGRATORS})

    def _check_together(self) -> None:
        super()._check_together()
        if self.tolerance is not None and self.integrator == "ab3":
            wrong = "goes with integrator implicit or auto; ab3 takes its step from eq. (10)"
            raise ModelError("tolerance", wrong)

    @property
    def material(self) -> dict[str, Any]:
        """The options of `Fibers`."""
        return {option.name: getattr(self, option.name) for option in fields(FiberOptions)}

    @property
    def motion(self) -> dict[str, Any]:
        """The options of `Stepper`."""
        return {option.name: getattr(self, option.name) for option in fields(MotionOptions)}

    def entries(self) -> dict[str, str]:
        """All that is chosen, as entries of constant/fiberProperties: name and value."""
        chosen = {entry_name(option.name): getattr(self, option.name) for option in fields(self)}
        return {name: _as_entry(value) for name, value in chosen.items() if value is False or value}


def entry_name(option: str) -> str:
    """bendingTorque of bending_torque."""
    first, *rest = option.split("_")
    return first + "".join(word.capitalize() for word in rest)


def _as_entry(value: str | bool | float) -> str:
    if isinstance(value, bool):
        return "yes" if value else "no"
    return value if isinstance(value, str) else repr(value)
