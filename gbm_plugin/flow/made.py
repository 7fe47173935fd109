"""Flows of one's own: from a function, or from one field on a grid."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..sampling import NEEDS, one_of, rotation_of
from .stored import LOCATIONS, StoredFlow

DIFFERENCE = 1e-5  # of the extent of the positions: where rounding and curvature of a smooth flow err alike

Function = Callable[[NDArray, float], ArrayLike]


class _FunctionFlow:
    def __init__(
        self,
        velocity: Function,
        rotation: Function | None,
        gradient: Function | None,
        difference: float | None,
    ):
        self._given: dict[str, Function | None] = {
            "velocity": velocity,
            "rotation": rotation,
            "gradient": gradient,
        }
        self._difference = difference

    def sample(
        self, positions: ArrayLike, time: float, need: str = "gradient"
    ) -> tuple[NDArray, NDArray | None]:
        """Velocity (..., 3) at positions (..., 3), and what need asks for beside it, as all flows."""
        positions = np.asarray(positions, dtype=float)
        velocity = self._call("velocity", positions, time)
        if one_of("need", need, NEEDS) == "velocity":
            return velocity, None
        if self._given[need] is not None:
            return velocity, self._call(need, positions, time)
        known = self._given["gradient"] is not None
        gradient = self._call("gradient", positions, time) if known else self._differences(positions, time)
        return velocity, rotation_of(gradient) if need == "rotation" else gradient

    def _call(self, what: str, positions: NDArray, time: float) -> NDArray:
        function = self._given[what]
        assert function is not None
        values = np.asarray(function(positions, time), dtype=float)
        shape = (*positions.shape, 3) if what == "gradient" else positions.shape
        if values.shape != shape:
            raise ValueError(
                f"the function of the {what} gives shape {values.shape} for positions of shape {positions.shape}; "
                f"{shape} is needed"
            )
        return values

    def _differences(self, positions: NDArray, time: float) -> NDArray:
        """Gradient by central differences."""
        extent = np.ptp(positions.reshape(-1, 3), axis=0).max() or np.abs(positions).max() or 1.0
        step = self._difference or DIFFERENCE * extent
        gradient = np.empty((*positions.shape, 3))
        for axis in range(3):
            shift = step * np.eye(3)[axis]
            ahead, behind = (self._call("velocity", positions + s, time) for s in (shift, -shift))
            gradient[..., axis] = (ahead - behind) / (2 * step)
        return gradient


def from_function(
    velocity: Function,
    rotation: Function | None = None,
    gradient: Function | None = None,
    difference: float | None = None,
) -> _FunctionFlow:
    """A flow from velocity(positions, time): (..., 3) [m/s] at positions (..., 3) [m].

    rotation(positions, time): ½∇×u, (..., 3); gradient(positions, time): (..., 3, 3), [..., i, j] = du_i/dx_j. What is
    not given, and asked for, is found by central differences over `difference` [m], 1e-5 of the extent of the fibers
    without it: give it for a flow with scales below that. ValueError where a function gives another shape.
    """
    for name, given in (("velocity", velocity), ("rotation", rotation), ("gradient", gradient)):
        if given is not None and not callable(given):
            raise ValueError(f"{name} is {given!r}; it must be a function of positions (..., 3) and time")
    if difference is not None and not 0 < difference < np.inf:
        raise ValueError(f"difference is {difference}; it must be a positive length")
    return _FunctionFlow(velocity, rotation, gradient, difference)


def from_array(
    values: ArrayLike,
    box: ArrayLike,
    origin: ArrayLike = (0, 0, 0),
    location: str = "nodes",
    periodic: bool = True,
    interpolation: str = "cubic",
) -> StoredFlow:
    """A steady flow from one field: values (3, nx, ny, nz) [m/s], [c, i, j, k] at (x_i, y_j, z_k).

    box: widths [m], three or one; origin: its lower corner. location "nodes": x_i = origin + i box/nx, or "centres":
    x_i = origin + (i + ½) box/nx. periodic=False: the field ends at its outermost values; with nodes, box then
    reaches from the first to the last, x_i = origin + i box/(nx − 1). interpolation: "cubic" or "trilinear".
    ValueError for other shapes and words.
    """
    field = np.ascontiguousarray(values, dtype=float)
    offset = LOCATIONS[one_of("location", location, LOCATIONS)]
    widths = np.broadcast_to(np.asarray(box, dtype=float), (3,)) if np.ndim(box) == 0 else box
    flow = StoredFlow(
        [0.0], lambda _: field, widths, origin, offset, interpolation, periodic=periodic, steady=True
    )
    flow.sample(flow.origin + flow.box / 2, 0.0, "velocity")  # says what is wrong with it at once
    return flow
