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
from numba import njit, vectorize
from numpy.typing import ArrayLike, NDArray

CRITERION = 0.8  # of the end-to-end distance over the contour between the end beads' centres
OUTSIDE = np.iinfo(np.int64).min
REGION = ["int64(float64, float64, float64, float64)"]  # of x̃, ỹ and the end-to-end vector in the plane


@njit
def _number(i, j):
    """One number for each pair of whole numbers."""
    return (np.int64(i) << 32) + np.int64(j)


@vectorize(REGION, cache=True)
def strain(x, y, ends_x, ends_y):
    """(F,) regions where strain dominates rotation at x̃, ỹ (F,): cos(x̃ + ỹ) cos(x̃ − ỹ) > 0."""
    i, j = np.rint((x + y) / np.pi), np.rint((x - y) / np.pi)
    return _number(i, j) if (i + j) % 2 == 0 else OUTSIDE


@vectorize(REGION, cache=True)
def square(x, y, ends_x, ends_y):
    """(F,) squares of side W/2 around the stagnation points: |x̃ − mπ|, |ỹ − nπ| < π/4."""
    i, j = np.rint(x / np.pi), np.rint(y / np.pi)
    return _number(i, j) if max(abs(x - np.pi * i), abs(y - np.pi * j)) < np.pi / 4 else OUTSIDE


@vectorize(REGION, cache=True)
def compression(x, y, ends_x, ends_y):
    """(F,) where the strain at the centre shortens the end-to-end vector: cos x̃ cos ỹ (e_x² − e_y²) < 0."""
    rate = np.cos(x) * np.cos(y) * (ends_x * ends_x - ends_y * ends_y)
    return _number(np.rint(x / np.pi), np.rint(y / np.pi)) if rate < 0 else OUTSIDE


REGIONS = {"strain": strain, "square": square, "compression": compression}


@njit(cache=True)
def _count(region, ratio, criterion, before, tracks, events, bent, running, finished):
    """One sample of all fibers: see Tracks."""
    for f in range(len(region)):
        changed, straight = region[f] != before[f], ratio[f] >= criterion
        finished[f] = bent[f] and changed
        if changed:
            bent[f] = False
            running[f] = region[f] != OUTSIDE and straight
            tracks[f] += running[f]
            before[f] = region[f]
        if running[f] and not straight:
            running[f] = False
            bent[f] = True
            events[f] += 1


class Tracks:
    """Tracks and events of F fibers, counted sample by sample.

    tracks, events: (F,) counts so far; bent: (F,) whether a fiber is in a track that has become an event. A
    fiber that is in a region at the first sample counts once it has left. A track under way at the end is one.
    """

    def __init__(self, fibers: int, criterion: float = CRITERION):
        self.criterion = criterion
        self.tracks, self.events = np.zeros(fibers, np.int64), np.zeros(fibers, np.int64)
        self.bent, self._running = np.zeros(fibers, bool), np.zeros(fibers, bool)  # buckled, and not yet
        self._region: NDArray | None = None

    def observe(self, region: NDArray[np.int64], ratio: ArrayLike) -> NDArray[np.bool_]:
        """Take a sample: the region of each fiber, its end-to-end distance over its length, (F,) each.

        Returns which fibers have left (F,) a track that was an event.
        """
        if self._region is None:
            self._region = np.array(region, np.int64)
        finished = np.zeros(len(self.tracks), bool)
        own = (self._region, self.tracks, self.events, self.bent, self._running)
        _count(region, np.asarray(ratio, float), self.criterion, *own, finished)
        return finished

    def forget(self, fibers: NDArray[np.bool_], region: NDArray[np.int64]) -> None:
        """The given fibers (F,) have been replaced by new ones, in these regions (F,)."""
        self.bent[fibers] = self._running[fibers] = False
        self._region[fibers] = region[fibers]

    def state(self) -> dict[str, NDArray]:
        """Everything that a restart needs, after the first sample."""
        own = {"tracks": self.tracks, "events": self.events, "bent": self.bent, "running": self._running}
        return own | {"region": self._region}

    def restore(self, state) -> None:
        """Take back what state() gave."""
        self.tracks, self.events, self.bent = (np.array(state[n]) for n in ("tracks", "events", "bent"))
        self._running, self._region = np.array(state["running"]), np.array(state["region"])


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
