"""The Gears Bead Model: fibers of touching beads that bend, do not stretch, and roll on each other."""

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from .fibers import Fibers
    from .group import Group
    from .preparation import prepare
    from .rates import instant_rates
    from .reaction import Reaction
    from .stepper import Stepper, merged_states
    from .trajectory import Trajectory, simulate

__all__ = [
    "Fibers",
    "Group",
    "Reaction",
    "Stepper",
    "Trajectory",
    "instant_rates",
    "merged_states",
    "prepare",
    "simulate",
]

_HOMES = {
    "Fibers": "fibers",
    "Group": "group",
    "Reaction": "reaction",
    "Stepper": "stepper",
    "merged_states": "stepper",
    "instant_rates": "rates",
}
_HOMES |= {"Trajectory": "trajectory", "simulate": "trajectory", "prepare": "preparation"}


def __getattr__(name: str) -> Any:
    """Names from below, when they are first used: who reads the words of `model` needs no compiler of kernels."""
    if name not in _HOMES:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return getattr(import_module(f".{_HOMES[name]}", __name__), name)
