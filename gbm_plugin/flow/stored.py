"""A flow that was stored as velocity fields on a periodic grid, interpolated in time and space."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..sampling import NEEDS, NUMBERS, FlowEnded, lagrange_weights, one_of
from . import grid

POINTS_IN_TIME = {"linear": 2, "cubic": 4}
LOCATIONS = {"nodes": 0.0, "centres": 0.5}  # where the values sit, in cells from a cell's corner
SAME_TIME = (
    1e-6  # times closer than this part of the interval between fields are one: names of folders are rounded
)
GAP = 1.5  # an interval so much longer than both beside it, and than the usual one, lacks a field


class StoredFlow:
    """Velocity fields at given times, read as they are needed; in memory are only those around the latest time.

    times (T,) [s], increasing, at least two; read(i): the velocity (3, nx, ny, nz) [m/s] at times[i], whose value
    [:, i, j, k] sits at origin + ((i, j, k) + offset) box/(nx, ny, nz): offset 0 for nodes, ½ for cell centres. box,
    origin (3,) [m].
    steady: there is one field only, and it holds at all times.

    periodic: False for a field that ends at its outermost values; box then reaches from the first to the last node
    (offset 0), or over all cells (offset ½). There `inside` says of positions whether they are in it.
    in_time: "cubic" (through four fields, from one side near the ends; through all where there are fewer) or
    "linear". At a stored time the field itself is taken. interpolation in space: "trilinear", with derivatives
    by central differences at the nodes, interpolated alike; or "cubic" or, of a periodic field, "quintic", with the
    interpolant's own derivatives; all as the coupling to OpenFOAM has them. ValueError for an unknown word or bad
    numbers.
    """

    def __init__(
        self,
        times: ArrayLike,
        read: Callable[[int], NDArray],
        box: ArrayLike,
        origin: ArrayLike = (0, 0, 0),
        offset: float = 0.5,
        interpolation: str = "trilinear",
        in_time: str = "cubic",
        periodic: bool = True,
        steady: bool = False,
    ):
        self.times = np.array(times, dtype=float)
        self.box, self.origin = (np.array(v, dtype=float) for v in (box, origin))
        self.offset = float(offset)
        self.interpolation = one_of("interpolation", interpolation, grid.WORDS if periodic else grid.BOUNDED)
        self.in_time = one_of("interpolation in time", in_time, POINTS_IN_TIME)
        self.periodic = bool(periodic)
        self.inside = None if periodic else self._inside
        self._read = read
        self._fields: dict[int, dict[str, NDArray]] = {}
        self._shape: tuple[int, ...] | None = None
        if self.times.ndim != 1 or len(self.times) < 2 - bool(steady):
            raise ValueError(
                f"fields at {self.times.size} times are stored; at least 2 are needed to interpolate"
            )
        if not np.isfinite(self.times).all():
            raise ValueError("the stored times are not all finite")
        wrong = np.flatnonzero(np.diff(self.times) <= 0)
        if len(wrong):
            before, after = self.times[wrong[0] : wrong[0] + 2]
            raise ValueError(f"the stored times must increase, but {before:.9g} is followed by {after:.9g}")
        if self.box.shape != (3,) or self.origin.shape != (3,):
            raise ValueError(
                f"box and origin have shapes {self.box.shape} and {self.origin.shape}; they must be (3,)"
            )
        if not (np.isfinite(self.box).all() and (self.box > 0).all() and np.isfinite(self.origin).all()):
            raise ValueError(
                f"box is {self.box} and origin {self.origin}; widths must be positive, all finite"
            )

    def sample(
        self, positions: ArrayLike, time: float, need: str = "gradient"
    ) -> tuple[NDArray, NDArray | None]:
        """Velocity (..., 3) at positions (..., 3), which may lie outside of a periodic box, and what need asks for.

        need: "velocity" (extra is None), "rotation" (½∇×u, (..., 3)) or "gradient" ((..., 3, 3), [..., i, j] =
        du_i/dx_j). ValueError for a time that is not in the stored range, a position outside of a bounded field or a
        field of another shape, FloatingPointError for a field or position that is not finite.
        """
        one_of("need", need, NEEDS)
        positions = np.asarray(positions, dtype=float)
        if positions.shape[-1:] != (3,):
            raise ValueError(f"positions have shape {positions.shape}; (..., 3) is needed")
        if not np.isfinite(positions).all():
            raise FloatingPointError(f"a position at time {time:g} is not finite")
        numbers, weights = self._stencil(time)
        of_nodes = (
            need if self.interpolation == "trilinear" else "velocity"
        )  # others have slopes of their own
        fields = [self._field(n, of_nodes) for n in numbers]
        if self.inside is not None and not (within := self.inside(positions)).all():
            raise ValueError(f"the flow is not known at {positions[~within][0]}")
        points = positions.reshape(-1, 3)
        velocity, extra = np.zeros(points.shape), np.zeros((len(points), NUMBERS[need] - 3))
        for field, weight in zip(fields, weights, strict=True):
            grid.add_on_grid(self.interpolation, weight, field, points, self._lattice, velocity, extra)
        shape = positions.shape + (3,) * (need == "gradient")
        return velocity.reshape(positions.shape), None if need == "velocity" else extra.reshape(shape)

    @property
    def _cells(self) -> NDArray:
        """Intervals between values that the box is wide in each direction."""
        shape = np.array(self._known_shape[1:])
        return shape if self.periodic or self.offset else shape - 1

    @property
    def _known_shape(self) -> tuple[int, ...]:
        """Of the fields, the first of which is read if none was."""
        if self._shape is None:
            self._field(0, "velocity")
        assert self._shape is not None
        return self._shape

    @property
    def _lattice(self) -> tuple[NDArray, NDArray]:
        """Where the first value in memory sits, and the distances of values."""
        spacing = self.box / self._cells
        return self.origin + (self.offset - (not self.periodic)) * spacing, spacing

    def _inside(self, positions: ArrayLike) -> NDArray:
        """Whether positions (..., 3) are between the values of a bounded field: (...,)."""
        points = (np.asarray(positions) - self.origin) * (self._cells / self.box) - self.offset
        return ((points >= 0) & (points <= np.array(self._known_shape[1:]) - 1)).all(axis=-1)

    def _stencil(self, time: float) -> tuple[list[int], list[float]]:
        """Which fields make that of a time, and their weights. Forgets the fields that are far from it."""
        times = self.times
        if len(times) == 1:
            return [0], [1.0]
        near = int(np.argmin(np.abs(times - time)))
        slack = SAME_TIME * np.diff(times[max(0, near - 1) : near + 2]).min()
        at_field = abs(times[near] - time) <= slack
        if not at_field and not times[0] <= time <= times[-1]:
            raise FlowEnded(
                f"time {time:.9g} is not within the stored fields, from {times[0]:.9g} to {times[-1]:.9g}",
                until=float(times[-1]),
            )
        count = min(POINTS_IN_TIME[self.in_time], len(times))
        before = near if at_field else int(np.searchsorted(times, time)) - 1
        first = int(np.clip(before - (count - 1) // 2, 0, len(times) - count))
        window = range(first, first + count)
        self._fields = {n: fields for n, fields in self._fields.items() if n in window}
        if at_field:
            return [near], [1.0]
        return list(window), lagrange_weights(times[list(window)], time).tolist()

    def kolmogorov_time(self, time: float) -> float:
        """(nu/epsilon)^(1/2) = <|omega|^2>^(-1/2) of isotropic turbulence, at the stored time nearest to this one."""
        rotation = self._field(int(np.argmin(np.abs(self.times - time))), "rotation")[3:]
        square = 4 * float((rotation**2).sum(axis=0).mean())
        return square**-0.5 if square > 0 else np.inf

    def _field(self, number: int, need: str) -> NDArray:
        """The velocity at one of the stored times and, after it, the rotation or gradient at the nodes, if need be."""
        kept = self._fields.setdefault(number, {})
        if "velocity" not in kept:
            velocity = self._velocity(number)
            kept["velocity"] = grid.for_sampling(velocity if self.periodic else grid.extended(velocity))
        if need not in kept:
            velocity, derivative = (
                kept["velocity"],
                {"rotation": grid.rotation, "gradient": grid.gradient}[need],
            )
            both = [velocity, derivative(velocity, self.box / self._cells)]
            kept[need] = grid.for_sampling(np.concatenate(both))
            kept["velocity"] = kept[need][:3]  # the same memory
        return kept[need]

    def _velocity(self, number: int) -> NDArray:
        velocity = np.ascontiguousarray(self._read(number), dtype=float)
        shape, time = velocity.shape, self.times[number]
        least = 1 if self.periodic else grid.LEAST_BOUNDED
        if self._shape is None and len(shape) == 4 and shape[0] == 3 and min(shape[1:]) >= least:
            self._shape = shape
        if shape != self._shape:
            needed = self._shape or f"(3, nx, ny, nz), {least} or more in each direction,"
            raise ValueError(f"the velocity stored at time {time:.9g} has shape {shape}; {needed} is needed")
        if not np.isfinite(velocity.sum()) and not np.isfinite(velocity).all():
            component, *cell = np.argwhere(~np.isfinite(velocity))[0].tolist()
            raise FloatingPointError(
                f"the velocity stored at time {time:.9g} is not finite: component {component} in cell {tuple(cell)}"
            )
        return velocity


def refuse_gaps(times: NDArray, begin: float, end: float, written_every: float = 0.0) -> None:
    """ValueError where a field between begin and end seems to be missing: an interval between two times that is
    longer than those beside it and than most. Times that are written more or less often from some time on are none.

    written_every: the interval at which they were to be written [s], if it is known: what a run that was stopped
    wrote in between makes none of its intervals a gap.
    """
    intervals = np.diff(times)
    usual = max(float(np.median(intervals)), written_every)
    for n, interval in enumerate(intervals):
        if times[n + 1] < begin + SAME_TIME * interval or times[n] > end - SAME_TIME * interval:
            continue
        beside = [intervals[m] for m in (n - 1, n + 1) if 0 <= m < len(intervals)]
        if beside and interval > GAP * max(usual, *beside):
            raise ValueError(
                f"between the times {times[n]:.9g} and {times[n + 1]:.9g} no field is stored, others are "
                f"{usual:.3g} apart: fields are missing; startTime and endTime can choose a part without the gap"
            )
