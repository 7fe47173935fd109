"""What a run takes in time and memory, estimated before it runs: measured costs, scaled to this machine.

The costs are those of one core of the machine on which `gbm study estimate` measured them, and what a transform took
there; a transform here, a tenth of a second, says how this machine compares.
"""

from __future__ import annotations

import math
import os
import time
from dataclasses import dataclass

import numpy as np

from ..fiber.model import AFFORDABLE
from .dictionary import Dictionary
from .disk import needed, writes
from .scene import Family, Scene
from .verdict import sub_steps

# the task by which machines are compared, and its time where these were measured [s of one core]
TASK, TASK_TIME, REPEATS = 64, 3.6e-3, 15

BOX_FOAM = 3.0e-9  # a step, for each cell and log2(cells) [s]
OUTER, PRESSURE = (
    1.6e-6,
    0.25e-6,
)  # of pimpleFoam and pisoFoam: an outer corrector, and each pressure equation in it
STEP = 0.4e-3  # beside the cells, in every step of a solver: its log, its tables
SAMPLE = {"trilinear": 0.1e-6, "cubic": 0.2e-6, "quintic": 0.4e-6}  # a bead; other words, OpenFOAM's own:
SAMPLE_OTHER = 1.0e-6
CACHE, MISSED = (
    24e6,
    {"trilinear": 1e-6, "cubic": 2e-6, "quintic": 6e-6},
)  # bytes of U, beyond which a bead takes more
EXCHANGE, BEAD = 0.3e-3, 0.1e-6  # of a step: to find and send beads
DAEMON, TAKEN = 0.8e-3, 46e-9  # a step of the daemon, and what it does with each bead beside moving it
MOVED = {  # a bead in one step of an integrator: c_0 + c_1 N + c_2 N^2, N beads in its fiber [s]
    ("ab3", "freeDrain"): (22e-9, 0, 0),
    ("implicit", "freeDrain"): (140e-9, 0, 0),
    ("ab3", "rpy"): (60e-9, 16e-9, 0.8e-9),
    ("implicit", "rpy"): (213e-9, 13e-9, 22e-9),
}
ATTEMPTS = 1.5  # steps of implicit and auto in a step of the flow, of all fibers in the mean
START, PREPARED = 3.5, 2e-6  # programs, kernels; initial field and mesh, for each cell [s]
DISK, RECORD = 200e6, 2e-3  # bytes a second into time folders; seconds of a record
PROGRAMS = 380e6  # bytes of solver, daemon and `gbm run` without cells and beads
CELL, CELL_OTHER, BEAD_MEMORY = 900, 1500, 4000  # bytes, at their highest: boxFoam, other solvers, the daemon


@dataclass(frozen=True)
class Cost:
    """Seconds of a run from startTime on an idle machine, on one rank: the parts, of which `fibers` and `coupling` are
    what the flow does not hide; None where nothing was measured. solver: processor time of the solver, which moves
    no fibers but samples for them, hidden or not. memory [bytes] of solver and daemons."""

    start: float
    flow: float | None
    fibers: float
    coupling: float
    writing: float
    total: float | None
    solver: float | None
    memory: float


def cost(scene: Scene, slower: float | None = None) -> Cost:
    """The estimate. slower: than the machine of the costs; None: measured."""
    slower = machine() if slower is None else slower
    steps = round(max(0.0, scene.end_time - scene.start_time) / scene.time_step)
    cells, beads = math.prod(scene.cells or (0,)), sum(f.count * f.beads for f in scene.families)
    step = _flow_step(scene, cells)
    cores = len(os.sched_getaffinity(0))
    daemon = DAEMON + TAKEN * beads + sum(map(_moved, scene.families, [scene] * len(scene.families)))
    sampling = EXCHANGE + beads * (BEAD + _sampled(scene, cells))
    # a thread of boxFoam samples while the next step is computed, and the daemon goes on when it has
    beside = scene.application == "boxFoam" and not scene.coupling.feedback and scene.interpolation in SAMPLE
    room = step or 0.0 if cores > 1 else 0.0
    sampled = min(sampling, room) if beside else 0.0
    hidden = min(daemon, room - sampled)
    disk = needed(scene)
    parts = {
        "start": slower * (START + PREPARED * cells),
        "flow": None if step is None else slower * steps * step,
        "fibers": slower * steps * (daemon - hidden),
        "coupling": slower * steps * (sampling - sampled),
        "writing": writes(scene) * disk["time_folder"] / DISK + RECORD * steps / scene.record_interval,
    }
    total = None if step is None else sum(value for value in parts.values() if value is not None)
    each = CELL if scene.application == "boxFoam" else CELL_OTHER
    solver = None if step is None else slower * steps * (step + sampling)
    return Cost(**parts, total=total, solver=solver, memory=PROGRAMS + each * cells + BEAD_MEMORY * beads)


def machine() -> float:
    """How much slower a core of this machine is than that of the costs: the processor time of a transform."""
    values = np.random.default_rng(0).standard_normal((TASK,) * 3)
    best = math.inf
    for _ in range(REPEATS):
        start = time.process_time()
        np.fft.rfftn(values)
        best = min(best, time.process_time() - start)
    return best / TASK_TIME


def _flow_step(scene: Scene, cells: int) -> float | None:
    """A step of the solver on one core [s]; None of one that was not measured."""
    if not cells:
        return None
    if scene.application == "boxFoam":
        return STEP + BOX_FOAM * cells * math.log2(cells)
    if scene.application not in ("pimpleFoam", "pisoFoam"):
        return None
    name = "PIMPLE" if scene.application == "pimpleFoam" else "PISO"
    solution = Dictionary.read(scene.case, "system/fvSolution").sub(name, {})
    outer = solution.integer("nOuterCorrectors", 1, least=1) if name == "PIMPLE" else 1
    inner = solution.integer("nCorrectors", 1, least=1)
    return STEP + cells * outer * (OUTER + inner * PRESSURE)


def _sampled(scene: Scene, cells: int) -> float:
    """The flow at a bead [s]."""
    missed = MISSED.get(scene.interpolation, 0.0) if 24 * cells > CACHE else 0.0
    return SAMPLE.get(scene.interpolation, SAMPLE_OTHER) + missed


def _moved(f: Family, scene: Scene) -> float:
    """A family in a step of the flow [s], on one core."""
    count = sub_steps(f, scene)
    explicit = f.model.integrator == "ab3" or (f.model.integrator == "auto" and count <= AFFORDABLE)
    c = MOVED["ab3" if explicit else "implicit", f.model.mobility]
    times = count if explicit else ATTEMPTS
    return f.count * f.beads * times * (c[0] + c[1] * f.beads + c[2] * f.beads**2)
