"""What the state of a family is made of, checked before a kernel sees it: kernels trust the shapes of their arrays."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from ..arrays import Form, check_arrays
from .ambient import KEPT

UNIT = 1e-6  # how far from 1 the length of a link may be


def forms(fibers: int, beads: int) -> dict[str, Form]:
    """Number type and shape of each array in the state of so many fibers; a range: any length in it."""
    rows = 3 * beads
    return {
        "time": ("f", ()),
        "links_and_centres": ("f", (fibers, rows)),
        "multipliers": ("f", (fibers, rows - 3)),
        "rates": ("f", (fibers, 2, rows)),
        "rate_ages": ("f", (range(3),)),
        "suggested_step": ("f", (fibers,)),
        "tension": ("f", ()),
        "sample_times": ("f", (range(1, KEPT + 1),)),
        "samples": ("f", (fibers, range(1, KEPT + 1), 2, rows)),
    }


def check_state(state: Mapping[str, np.ndarray], fibers: int, beads: int) -> None:
    """ValueError where it is not one of so many fibers: for a missing array, another type or shape, a value that is
    not finite, links that are not of unit length, times that do not increase up to that of the state."""
    check_arrays(state, forms(fibers, beads), infinite=("suggested_step",))
    if len(state["sample_times"]) != state["samples"].shape[1]:
        raise ValueError(
            f"there are {state['samples'].shape[1]} samples at {len(state['sample_times'])} times"
        )
    links = state["links_and_centres"].reshape(fibers, beads, 3)[:, :-1]
    wrong = np.abs(np.linalg.norm(links, axis=2) - 1).max(axis=1) > UNIT
    if wrong.any():
        raise ValueError(f"the links of fiber {int(wrong.argmax())} are not of unit length")
    times, ages = state["sample_times"], np.append(0.0, state["rate_ages"])
    if (np.diff(times) <= 0).any() or times[-1] > state["time"] or (np.diff(ages) <= 0).any():
        raise ValueError("its times do not increase")
    if (state["suggested_step"] <= 0).any() or state["tension"] < 0:
        raise ValueError("it has a step or a tension that is negative")
