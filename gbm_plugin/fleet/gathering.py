"""Statistics of the fibers of a run, gathered while it goes on, where constant/fiberProperties asks for them."""

from __future__ import annotations

import logging
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from ..arrays import check_arrays, read_arrays
from ..case.scene import Scene
from ..case.share import Share, all_shares, shared_files
from ..files import replaced
from ..output.restarts import keep_earlier
from ..output.statistics import statistics_name, write_statistics
from ..statistics.running import MOST, Running, merged

log = logging.getLogger(__name__)

STATE = "uniform/statistics.npz"  # in a time folder, beside the state of the fibers
ASKED = ("since", "interval", "lags")
HEADER = {"steps": ("i", (range(MOST),)), "times": ("f", (range(MOST),))}


class Gathering:
    """A sample of all families every so many steps, from a time on."""

    def __init__(self, scene: Scene, folder: Path, share: Share):
        self.asked, self.share = scene.statistics, share
        self.families = {f.name: Running(f.count, f.beads, f.radius, self.asked.lags) for f in scene.families}
        self._parts = {f.name: (f.first, f.count, f.total) for f in scene.families}
        self._slack = 1e-3 * scene.time_step
        self.steps: list[int] = []
        self.times: list[float] = []
        self._path = keep_earlier(folder / statistics_name(share))

    def take(self, step: int, time: float, positions: Sequence[np.ndarray]) -> None:
        """The present step, positions (F, N, 3) [m] of each family, where a sample is due."""
        early = time < self.asked.since - self._slack or step % self.asked.interval
        if early or (self.steps and step <= self.steps[-1]):  # a restart sees its first step again
            return
        self.steps.append(step)
        self.times.append(time)
        for running, x in zip(self.families.values(), positions, strict=True):
            running.observe(x)

    def write(self) -> None:
        """The file of the results."""
        if self.steps:
            write_statistics(self._path, self.times, self.families)

    def save(self, folder: Path) -> None:
        """All that a restart needs, into a time folder."""
        arrays = {f"{name}/{key}": a for name, r in self.families.items() for key, a in r.state().items()}
        asked = {name: getattr(self.asked, name) for name in ASKED}
        path = self._state(folder)
        path.parent.mkdir(parents=True, exist_ok=True)
        with replaced(path, "wb") as file:
            np.savez(file, steps=np.array(self.steps, int), times=np.array(self.times), **asked, **arrays)

    def restore(self, folder: Path) -> None:
        """Go on from what `save` left there, whatever daemons shared the fibers; one line where there is nothing of
        these fibers."""
        path = Path(STATE)
        paths = shared_files((folder / path).parent, path.stem, path.suffix)
        if not paths:
            log.info("statistics of the fibers begin: %s has none", folder)
            return
        try:
            shares = all_shares(len(paths))
            self._restore([self._read(p, share) for p, share in zip(paths, shares, strict=True)], shares)
        except ValueError as error:
            log.warning("statistics of the fibers begin anew: %s: %s", paths[0], error)

    def _restore(self, states: list[dict], shares: list[Share]) -> None:
        restored = {}
        for name, (first, count, total) in self._parts.items():
            end, parts = first + count, [share.part(total) for share in shares]
            held = [n for n, part in enumerate(parts) if part.start < end and first < part.stop]
            own = states if self.share.number == 1 else [states[n] for n in held]
            offset = 0 if self.share.number == 1 else parts[held[0]].start
            prefix = f"{name}/"
            own = [{k.removeprefix(prefix): v for k, v in s.items() if k.startswith(prefix)} for s in own]
            running = Running(count, *(getattr(self.families[name], n) for n in ("beads", "radius", "lags")))
            running.restore(merged(own, slice(first - offset, end - offset), pooled=self.share.number == 1))
            restored[name] = running
        self.families = restored
        self.steps, self.times = states[0]["steps"].tolist(), states[0]["times"].tolist()

    def _read(self, path: Path, share: Share) -> dict[str, np.ndarray]:
        forms = dict(HEADER)
        for name, (_, _, total) in self._parts.items():
            part, like = share.part(total), self.families[name]
            of_part = Running(part.stop - part.start, like.beads, like.radius, like.lags)
            forms |= {f"{name}/{key}": form for key, form in of_part.forms().items()}
        state = read_arrays(path, [*forms, *ASKED], path.stat().st_size)
        for name in ASKED:
            if name not in state or state[name] != getattr(self.asked, name):
                raise ValueError("another from, interval or lags was asked for")
        check_arrays(state, forms)
        return state

    def _state(self, folder: Path) -> Path:
        path = folder / STATE
        return path.with_name(self.share.name(path.stem, path.suffix))
