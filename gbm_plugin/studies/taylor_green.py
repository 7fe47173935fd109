"""Fibers in the cellular Taylor–Green flow of section 3, their tracks counted while they move.

Units: vortex width W, flow velocity U₀ and viscosity μ are 1, the compression rate is S = πU₀/W. A scene has
one Sperm number Sp = μSL⁴/K^b. Its fibers are moved in slices of time with the whole state in a file after
each, so that a run goes on where it was killed, and several processes share many scenes.
"""

from __future__ import annotations

import hashlib
import itertools
import json
import multiprocessing
import os
import time
from collections.abc import Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass, field
from multiprocessing.connection import Connection, wait
from pathlib import Path

import numpy as np
from numba import njit
from numpy.typing import NDArray

from ..fiber import Fibers, Stepper
from ..flow import TaylorGreen
from ..statistics.buckling import OUTSIDE, REGIONS, Tracks
from ..threads import limited_to
from .study import steps

RATE = np.pi  # S = πU₀/W
SLICE = 25.0  # W/U₀ between checkpoints
RECORD = 1.0  # W/U₀ between records of the centres
MOST_SHAPES = 20_000  # kept of a scene
NORMALISATIONS = ("2a(N-1)", "2aN")  # of end-to-end distances
DEFAULT = ("strain", NORMALISATIONS[0])  # region and normalisation of what is measured
MOST_SUBSTEPS = 3  # of a step by ab3 within eq. (10), beyond which implicit is faster
STEPS = {"ab3": 0.025, "implicit": 0.05}  # W/U₀: see docs/results/buckling


@dataclass(frozen=True)
class Scene:
    """One Sperm number: count fibers of `beads` beads, contour length 2aN = length × W.

    integrator "best": ab3, or implicit where the fibers are stiff. time_step 0: that of the integrator [W/U₀].
    start "plane": anywhere, in the plane of the flow; "isotropic"; a tilt [degrees] turns those of "plane" out
    of it. reseed: after so long without a region [W/U₀] a fiber is replaced by a new one; 0: never.
    """

    sperm_number: float
    count: int = 400
    beads: int = 6
    length: float = 0.4
    mobility: str = "rpy"
    strain_coupling: bool = False
    bending_torque: str = "consistent"
    curvature_law: str = "sine"
    repulsion: float = 0.0
    integrator: str = "best"
    time_step: float = 0.0
    tolerance: float = 1e-2
    start: str = "plane"
    tilt: float = 0.0
    reseed: float = 0.0
    seed: int = 1

    def __post_init__(self):
        if not (np.isfinite(self.sperm_number) and self.sperm_number > 0):
            raise ValueError(f"the Sperm number is {self.sperm_number}; it must be finite and positive")
        for name, least in (("count", 1), ("beads", 3)):
            if getattr(self, name) < least:
                raise ValueError(f"{name} is {getattr(self, name)}; it must be at least {least}")
        if self.length <= 0 or self.time_step < 0 or self.tolerance <= 0 or self.reseed < 0:
            raise ValueError("length, tolerance must be positive; time_step, reseed not negative")
        for name, allowed in (("start", ("plane", "isotropic")), ("integrator", ("best", "ab3", "implicit"))):
            if getattr(self, name) not in allowed:
                raise ValueError(f"{name} is {getattr(self, name)!r}; allowed are {', '.join(allowed)}")

    @property
    def bending_stiffness(self) -> float:
        """K^b [μU₀W³]."""
        return RATE * self.length**4 / self.sperm_number

    @property
    def method(self) -> tuple[str, float]:
        """Integrator and step [W/U₀]."""
        integrator = self.integrator
        if integrator == "best":
            step = self.time_step or STEPS["ab3"]
            substeps = step * self.bending_stiffness * (self.beads / self.length) ** 4  # eq. (10)
            integrator = "ab3" if substeps <= MOST_SUBSTEPS else "implicit"
        return integrator, self.time_step or STEPS[integrator]

    def positions(self, count: int, random: np.random.Generator) -> NDArray:
        """(count, N, 3) new straight fibers."""
        centres = np.zeros((count, 3))
        centres[:, :2] = 2 * random.random((count, 2))
        angle = 2 * np.pi * random.random(count)
        rise = np.full(count, np.sin(np.radians(self.tilt)))
        if self.start == "isotropic":
            rise = 2 * random.random(count) - 1
        flat = np.sqrt(1 - rise**2)
        directions = np.stack([flat * np.cos(angle), flat * np.sin(angle), rise], axis=-1)
        offsets = self.length / self.beads * (np.arange(self.beads) - (self.beads - 1) / 2)
        return centres[:, None] + offsets[:, None] * directions[:, None]

    def fibers(self, positions: NDArray) -> Fibers:
        """The family of these positions."""
        words = {"bending_torque": self.bending_torque, "curvature_law": self.curvature_law}
        fibers = Fibers(positions, self.bending_stiffness, 1.0, **words)
        fibers.radius = self.length / (
            2 * self.beads
        )  # not to the rounding of positions: restarts are to the bit
        return fibers

    def stepper(self, positions: NDArray, start: float) -> Stepper:
        """A stepper for fibers at these positions from time start on."""
        options = {"mobility": self.mobility, "strain_coupling": self.strain_coupling}
        options |= {"tolerance": self.tolerance, "repulsion": self.repulsion}
        return Stepper(self.fibers(positions), start, self.method[0], **options)

    def contour(self, normalisation: str) -> float:
        """What an end-to-end distance is divided by."""
        return self.length * (1 - 1 / self.beads if normalisation == NORMALISATIONS[0] else 1.0)

    @property
    def file(self) -> str:
        """A name of its own for the state."""
        digest = hashlib.sha256(repr(self).encode()).hexdigest()[:12]
        return f"sp{self.sperm_number:g}_{self.mobility}_{self.beads}_{digest}.npz"


@dataclass
class Records:
    """What a run keeps beside its counts: times (T,), centres (T, F, 2) and ratios (T, F) of end-to-end
    distances at them; of each event in a region of strain its shape where it was bent most, relative to the
    stagnation point (E, N, 2)."""

    times: list = field(default_factory=list)
    centres: list = field(default_factory=list)
    ratios: list = field(default_factory=list)
    shapes: list = field(default_factory=list)


@njit(cache=True)
def _measure(positions):
    """(5, F): x̃ and ỹ of the centres, the end-to-end vector in the plane, its length."""
    found = np.zeros((5, positions.shape[0]))
    for f in range(positions.shape[0]):
        for i in range(positions.shape[1]):
            found[0, f] += np.pi * positions[f, i, 0] / positions.shape[1]
            found[1, f] += np.pi * positions[f, i, 1] / positions.shape[1]
        for c in range(2):
            found[2 + c, f] = positions[f, -1, c] - positions[f, 0, c]
        found[4, f] = np.hypot(found[2, f], found[3, f])
    return found


@njit(cache=True)
def _keep_deepest(positions, x, y, distance, bent, finished, deepest, shape):
    """Keep the shape in which the ends of each bent fiber were nearest, relative to its stagnation point."""
    for f in range(len(bent)):
        if finished[f] or not bent[f]:
            deepest[f] = np.inf
        if bent[f] and distance[f] < deepest[f]:
            deepest[f] = distance[f]
            for i in range(positions.shape[1]):
                shape[f, i, 0] = positions[f, i, 0] - np.rint(x[f] / np.pi)
                shape[f, i, 1] = positions[f, i, 1] - np.rint(y[f] / np.pi)


class Run:
    """A scene under way.

    tracks: {(region, normalisation): Tracks}; visited: (F,) the last time in a region of strain [W/U₀], NaN for
    never; crossed: (F,) the last time at which the centre went from one vortex to the next; seconds: processor
    time so far.
    """

    def __init__(self, scene: Scene):
        self.scene, self.flow = scene, TaylorGreen(1.0, 1.0)
        self.random = np.random.default_rng(scene.seed)
        self.stepper = scene.stepper(scene.positions(scene.count, self.random), 0.0)
        self.tracks = {pair: Tracks(scene.count) for pair in itertools.product(REGIONS, NORMALISATIONS)}
        self.visited, self.crossed = np.full(scene.count, np.nan), np.zeros(scene.count)
        self.reseeded = np.zeros(scene.count, int)
        self.seconds, self.records = 0.0, Records()
        self._vortex: NDArray | None = None
        self._deepest = np.full(scene.count, np.inf)
        self._shape = np.zeros((scene.count, scene.beads, 2), np.float32)
        self._sample()

    @property
    def time(self) -> float:
        """[W/U₀]"""
        return self.stepper.time

    def advance(self, end: float) -> None:
        """Up to time end [W/U₀], in steps that divide what is left."""
        began = time.process_time()
        start, step = self.time, self.scene.method[1]
        count = max(1, round((end - start) / step))
        every = max(1, round(RECORD / step))
        for n in range(1, count + 1):
            stop = end if n == count else start + n * (end - start) / count
            self._step(stop - self.time)
            if n % every == 0:
                self._record()
        if self.scene.reseed:
            self._replace()
        self.seconds += time.process_time() - began

    def _step(self, step: float) -> None:
        self.stepper.advance(step)
        while self.stepper.provisional:
            self._observe(self.stepper.positions)
            self.stepper.correct()
        self._sample()

    def _observe(self, positions: NDArray) -> None:
        self.stepper.observe(self.time, *self.flow.sample(positions, self.time, self.stepper.need))

    def _sample(self) -> None:
        """The flow at the beads, and where the fibers are."""
        positions = self.stepper.positions
        self._observe(positions)
        x, y, *ends, distance = _measure(positions)
        for name, find in REGIONS.items():
            region = find(x, y, *ends)
            for norm in NORMALISATIONS:
                finished = self.tracks[name, norm].observe(region, distance / self.scene.contour(norm))
                if (name, norm) == DEFAULT:
                    if finished.any() and len(self.records.shapes) < MOST_SHAPES:
                        self.records.shapes.extend(self._shape[finished])
                    bent = self.tracks[DEFAULT].bent
                    _keep_deepest(positions, x, y, distance, bent, finished, self._deepest, self._shape)
                    self.visited[region != OUTSIDE] = self.time
        vortex = np.floor(x / np.pi) * 2.0**24 + np.floor(y / np.pi)
        if self._vortex is not None:
            self.crossed[vortex != self._vortex] = self.time
        self._vortex = vortex

    def _record(self) -> None:
        positions = self.stepper.positions[..., :2]
        distance = np.linalg.norm(positions[:, -1] - positions[:, 0], axis=-1)
        self.records.times.append(self.time)
        self.records.centres.append(positions.mean(axis=1).astype(np.float32))
        self.records.ratios.append((distance / self.scene.contour(NORMALISATIONS[0])).astype(np.float32))

    def _replace(self) -> None:
        """New fibers for those that have been in no region for `reseed`."""
        last = np.nan_to_num(self.visited, nan=0.0)
        old = self.time - last >= self.scene.reseed
        if not old.any():
            return
        positions = self.stepper.positions
        positions[old] = self.scene.positions(int(old.sum()), self.random)
        self.stepper = self.scene.stepper(positions, self.time)
        x, y, *ends, _ = _measure(positions)
        for (name, _), tracks in self.tracks.items():
            tracks.forget(old, REGIONS[name](x, y, *ends))
        self.visited[old], self.reseeded[old] = self.time, self.reseeded[old] + 1
        self._vortex = None
        self._sample()

    def save(self, folder: Path) -> None:
        """Write the state, whole or not at all."""
        records = {f"records_{name}": np.array(list_) for name, list_ in vars(self.records).items()}
        own = ("visited", "crossed", "reseeded", "seconds", "_vortex", "_deepest", "_shape")
        state = {f"own_{name}": getattr(self, name) for name in own} | records
        state |= {f"stepper_{name}": value for name, value in self.stepper.state().items()}
        for number, tracks in enumerate(self.tracks.values()):
            state |= {f"tracks{number}_{name}": value for name, value in tracks.state().items()}
        state["random"] = np.array(json.dumps(self.random.bit_generator.state))
        state["positions"] = self.stepper.positions
        folder.mkdir(parents=True, exist_ok=True)
        partial = folder / f"{self.scene.file}.partial"
        with open(partial, "wb") as file:
            np.savez(file, **state)
        os.replace(partial, folder / self.scene.file)

    @classmethod
    def load(cls, scene: Scene, folder: Path) -> Run:
        """The run of a scene as it was saved last, or at its start."""
        run = cls(scene)
        if not (folder / scene.file).exists():
            return run
        with np.load(folder / scene.file) as stored:
            state = dict(stored)

        def part(prefix: str) -> dict[str, NDArray]:
            return {n.removeprefix(prefix): v for n, v in state.items() if n.startswith(prefix)}

        run.stepper = scene.stepper(state["positions"], float(state["stepper_time"]))
        run.stepper.restore(part("stepper_"))
        for number, tracks in enumerate(run.tracks.values()):
            tracks.restore(part(f"tracks{number}_"))
        for name, value in part("own_").items():
            setattr(run, name, float(value) if value.ndim == 0 else value)
        run.records = Records(**{name: list(values) for name, values in part("records_").items()})
        run.random.bit_generator.state = json.loads(str(state["random"]))
        return run


def run_scenes(
    scenes: Sequence[Scene], end: float, folder: Path, workers: int = 0, title: str = "fibers"
) -> list[Run]:
    """All scenes up to time end [W/U₀], each on from its state in the folder; a bar says how long it will take.

    workers: processes of one thread each; 0: as many as there are processors. Raises ValueError where a state
    is already beyond the end, and what a scene raises.
    """
    runs = [Run.load(scene, folder) for scene in scenes]
    for run in runs:
        if run.time > end * (1 + 1e-9):
            raise ValueError(f"{folder / run.scene.file} is of time {run.time:g}, beyond the end {end:g}")
    left = {run.scene: _slices(run.time, end) for run in runs}
    total = sum(map(len, left.values()))
    workers = min(workers or len(os.sched_getaffinity(0)), sum(map(bool, left.values())))
    done = _here(left, folder) if workers < 2 else _elsewhere(left, folder, workers)
    for _ in steps(done, total, title):
        pass
    return [Run.load(scene, folder) for scene in scenes]


def _slices(start: float, end: float) -> list[float]:
    """The times at which the slices from start to end are over."""
    first = int(np.floor(start / SLICE + 1e-9)) + 1
    inner = [n * SLICE for n in range(first, int(np.ceil(end / SLICE - 1e-9)))]
    return [*inner, end] if end > start * (1 + 1e-9) else []


def _advance(scene: Scene, folder: Path, until: float) -> None:
    run = Run.load(scene, folder)
    run.advance(until)
    run.save(folder)


def _here(left: dict[Scene, list[float]], folder: Path) -> Iterator[None]:
    for scene, slices in left.items():
        for until in slices:
            _advance(scene, folder, until)
            yield


def _elsewhere(left: dict[Scene, list[float]], folder: Path, workers: int) -> Iterator[None]:
    """Slices by other processes, the costliest scenes first. The processes end with this one, however it ends."""
    cost = {scene: (scene.method[0] == "implicit", scene.bending_stiffness, scene.beads) for scene in left}
    waiting = sorted((scene for scene in left if left[scene]), key=cost.__getitem__)
    context = multiprocessing.get_context("spawn")
    busy: dict[Connection, Scene] = {}
    processes = []
    try:
        for _ in range(workers):
            ours, theirs = context.Pipe()
            processes.append(context.Process(target=_serve, args=(theirs,), daemon=True))
            processes[-1].start()
            theirs.close()
            busy[ours] = waiting.pop()
            ours.send((busy[ours], folder, left[busy[ours]].pop(0)))
        while busy:
            for pipe in wait(list(busy)):
                try:
                    failure = pipe.recv()
                except EOFError:
                    raise RuntimeError("a process that moves fibers ended without a word") from None
                if failure is not None:
                    raise failure
                scene = busy.pop(pipe)
                if left[scene]:
                    busy[pipe] = scene
                elif waiting:
                    busy[pipe] = waiting.pop()
                if pipe in busy:
                    pipe.send((busy[pipe], folder, left[busy[pipe]].pop(0)))
                yield
    finally:
        for process in processes:
            process.terminate()
            process.join()


def _serve(pipe: Connection) -> None:
    """A process that takes slices until its pipe is closed."""
    with suppress(EOFError, KeyboardInterrupt), limited_to(1):
        while True:
            task = pipe.recv()
            try:
                _advance(*task)
                pipe.send(None)
            except (ValueError, OSError, ArithmeticError) as failure:
                pipe.send(failure)
