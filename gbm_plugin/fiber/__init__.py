"""The Gears Bead Model: fibers of touching beads that bend, do not stretch, and roll on each other."""

from .fibers import Fibers
from .prepare import prepare
from .rates import instant_rates
from .simulate import Trajectory, simulate
from .stepper import Stepper, merged_states

__all__ = ["Fibers", "Stepper", "Trajectory", "instant_rates", "merged_states", "prepare", "simulate"]
