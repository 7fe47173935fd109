"""Every kernel that a choice of options needs, compiled or loaded before a run waits for it."""

from __future__ import annotations

from typing import Any

import numpy as np

from .fibers import Fibers
from .stepper import Stepper


def prepare(feedback: bool = False, **options: Any) -> None:
    """Move one small fiber with these options of a Stepper, by all that runs call; feedback: its forces too."""
    fibers = Fibers.straight(1, 3, 1.0, 1.0, 1.0)
    stepper = Stepper(fibers, 0.0, **options)
    extra = np.zeros((1, 3, 3, 3) if stepper.need == "gradient" else (1, 3, 3))

    def observe() -> None:
        stepper.observe(stepper.time, np.zeros((1, 3, 3)), extra)

    observe()
    for step in (1e-3, 1.0):  # both sides of eq. (10), between which auto chooses
        stepper.advance(step)
        observe()
        stepper.correct()
        observe()
    stepper.prediction_gap.sum()
    stepper.tension.sum()
    if feedback:
        stepper.reaction(1.0)
    stepper.restore(stepper.state())
