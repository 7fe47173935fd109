"""Buckling events of fibers that pass through compression regions, as in section 3.2 of the paper.

A track begins where a fiber's centre of mass enters a region from outside while its ends are at least 0.8 of
the contour apart; it is an event if they come closer before the centre leaves. P = events/tracks. The tracks
of one fiber follow each other along one path, so that only fibers are independent: the error of P is that of
a ratio of sums over fibers (Cochran, Sampling Techniques, sec. 6.4), not that of independent tracks.

Regions are given in the cellular flow of eq. (12) in its own coordinates x̃ = πx/W, whose stagnation points
lie at multiples of π. A region function has the number of the region that a fiber is in, or OUTSIDE. Regions
that touch at a corner, as those of `strain` do, are different ones.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

CRITERION = 0.8  # of the end-to-end distance over the contour between the end beads' centres
OUTSIDE = np.iinfo(np.int64).min


def strain(x: NDArray, y: NDArray, ends: NDArray) -> NDArray[np.int64]:
    """(F,) regions where strain dominates rotation at x̃, ỹ (F,): cos(x̃ + ỹ) cos(x̃ − ỹ) > 0."""
    i, j = np.rint((x + y) / np.pi), np.rint((x - y) / np.pi)
    return np.where((i + j) % 2 == 0, _number(i, j), OUTSIDE)


def square(x: NDArray, y: NDArray, ends: NDArray) -> NDArray[np.int64]:
    """(F,) squares of side W/2 around the stagnation points: |x̃ − mπ|, |ỹ − nπ| < π/4."""
    i, j = np.rint(x / np.pi), np.rint(y / np.pi)
    inside = np.maximum(np.abs(x - np.pi * i), np.abs(y - np.pi * j)) < np.pi / 4
    return np.where(inside, _number(i, j), OUTSIDE)


def compression(x: NDArray, y: NDArray, ends: NDArray) -> NDArray[np.int64]:
    """(F,) where the strain at the centre shortens the end-to-end vector (F, 2): cos x̃ cos ỹ (e_x² − e_y²) < 0."""
    rate = np.cos(x) * np.cos(y) * (ends[:, 0] ** 2 - ends[:, 1] ** 2)
    return np.where(rate < 0, _number(np.rint(x / np.pi), np.rint(y / np.pi)), OUTSIDE)


REGIONS = {"strain": strain, "square": square, "compression": compression}


def _number(i: NDArray, j: NDArray) -> NDArray[np.int64]:
    """One number for each pair of whole numbers."""
    return (i.astype(np.int64) << 32) + j.astype(np.int64)


class Tracks:
    """Tracks and events of F fibers, counted sample by sample.

    tracks, events: (F,) counts so far; bent: (F,) whether a fiber is in a track that has become an event. A
    fiber that is in a region at the first sample counts once it has left. A track under way at the end is one.
    """

    def __init__(self, fibers: int, criterion: float = CRITERION):
        self.criterion = criterion
        self.tracks, self.events = np.zeros(fibers, int), np.zeros(fibers, int)
        self.bent, self._open = np.zeros(fibers, bool), np.zeros(fibers, bool)
        self._region: NDArray | None = None

    def observe(self, region: NDArray[np.int64], ratio: ArrayLike) -> NDArray[np.bool_]:
        """Take a sample: the region of each fiber, its end-to-end distance over its length, (F,) each.

        Returns which fibers have left (F,) a track that was an event.
        """
        before = region if self._region is None else self._region
        changed = region != before
        straight = np.asarray(ratio) >= self.criterion
        begun = changed & (region != OUTSIDE) & straight
        finished = self.bent & changed
        self._open = np.where(changed, begun, self._open)
        buckled = self._open & ~straight
        self._open &= straight
        self.bent = (self.bent & ~changed) | buckled
        self.tracks += begun
        self.events += buckled
        self._region = region
        return finished

    def forget(self, fibers: NDArray[np.bool_]) -> None:
        """The given fibers are replaced by new ones: what they were in counts no more."""
        self.bent[fibers] = self._open[fibers] = False
        if self._region is not None:
            self._region = np.where(fibers, OUTSIDE, self._region)

    def state(self) -> dict[str, NDArray]:
        """Everything that a restart needs, after the first sample."""
        own = {"tracks": self.tracks, "events": self.events, "bent": self.bent, "open": self._open}
        return own | {"region": self._region}

    def restore(self, state) -> None:
        """Take back what state() gave."""
        self.tracks, self.events, self.bent = (np.array(state[n]) for n in ("tracks", "events", "bent"))
        self._open, self._region = np.array(state["open"]), np.array(state["region"])


@dataclass(frozen=True)
class Probability:
    """P = events/tracks, its standard error from the spread between fibers, and that of independent tracks."""

    value: float
    error: float
    binomial_error: float
    tracks: int
    events: int


def probability(events: ArrayLike, tracks: ArrayLike) -> Probability:
    """Buckling probability of fibers with so many events and tracks, (F,) each; NaN without tracks.

    error = sqrt(F/(F − 1) Σ (e_f − P t_f)²)/Σ t_f. Raises ValueError for counts that are none.
    """
    events, tracks = np.asarray(events, float), np.asarray(tracks, float)
    if events.shape != tracks.shape or events.ndim != 1 or (events < 0).any() or (events > tracks).any():
        raise ValueError("events and tracks must be (F,) counts, of events at most as many as of tracks")
    total, fibers = tracks.sum(), len(tracks)
    if total == 0:
        return Probability(np.nan, np.nan, np.nan, 0, 0)
    value = events.sum() / total
    square = ((events - value * tracks) ** 2).sum() * fibers / max(fibers - 1, 1)
    binomial = np.sqrt(value * (1 - value) / total)
    error = float(np.sqrt(square) / total)
    return Probability(float(value), error, float(binomial), int(total), int(events.sum()))


def difference(one: tuple[ArrayLike, ArrayLike], other: tuple[ArrayLike, ArrayLike]) -> tuple[float, float]:
    """P of one minus P of the other, events and tracks (F,) each, and its standard error.

    The fibers of both are taken in pairs, as they start alike: what they have in common does not count as error.
    NaN where one has no tracks.
    """
    parts, values = [], []
    for events, tracks in (one, other):
        events, tracks = np.asarray(events, float), np.asarray(tracks, float)
        if tracks.sum() == 0:
            return np.nan, np.nan
        values.append(events.sum() / tracks.sum())
        parts.append((events - values[-1] * tracks) / tracks.sum())
    apart = parts[0] - parts[1]
    return float(values[0] - values[1]), float(
        np.sqrt((apart**2).sum() * len(apart) / max(len(apart) - 1, 1))
    )
