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
from ..sampling import NUMBERS
from .dictionary import Dictionary
from .disk import needed, writes
from .layout import SPECTRAL
from .plan import need
from .scene import Family, Scene
from .solver import sub_cycles
from .verdict import GOOD, Verdict, graded, sub_steps

# the task by which machines are compared, and its time where these were measured [s of one core]
TASK, TASK_TIME, REPEATS = 64, 3.6e-3, 15

# a step of a flow [s]: its log and its tables, and for each cell
STEP = 0.4e-3
BOX_FOAM = 5.4e-8  # in proportion to the cells: large transforms are better used than small ones
OUTER, PRESSURE = 1.6e-6, 0.25e-6  # pimpleFoam, pisoFoam: an outer corrector, a pressure equation in it
# of the spectral solver: a step; one of the fields at the nodes that are sampled
MODES, FIELD = 2.7e-8, 6.3e-9
RUNGE_KUTTA = 6  # right-hand sides more, in the first steps of the spectral solver

# velocity and rotation at a bead [s], by the interpolation
AT_CELLS = {"trilinear": 0.1e-6, "cubic": 0.2e-6, "quintic": 0.4e-6}  # our own; and OpenFOAM's own,
AT_CELLS_OTHER, WHOLE = 1.0e-6, 0.15e-6  # which make fields of points and vorticity, for each cell
AT_NODES = {"trilinear": 0.2e-6, "cubic": 0.4e-6, "quintic": 0.75e-6}  # and, a mode, of the sum of them:
AT_NODES_EXACT = 0.7e-9
# bytes of the fields, beyond which they are not in the cache, and a bead takes more
CACHE, MISSED = 24e6, {"trilinear": 1e-6, "cubic": 2e-6, "quintic": 6e-6}

# a step of the fibers [s]: of the coupling, to find and send beads; of a daemon, or of one process with the flow,
# beside moving them; of each family; and to keep what comes of a bead
EXCHANGE, BEAD = 0.3e-3, 0.1e-6
DAEMON, ALONE, FAMILY, TAKEN = 1.2e-3, 0.4e-3, 0.1e-3, 46e-9
LANES = 8  # fibers that are moved at once
# a bead in one step of an integrator [s]: by itself, with each other bead of its fiber, and its part of the
# elimination, N^2 of a dense system of N beads; beyond the cache the elimination waits for its matrix
MOVED = {
    ("ab3", "freeDrain"): (30e-9, 0, 0),
    ("implicit", "freeDrain"): (150e-9, 0, 0),
    ("ab3", "rpy"): (30e-9, 12e-9, 0.4e-9),
    ("implicit", "rpy"): (150e-9, 12e-9, 9e-9),
}
WAITS = 3.0
PATIENCE = 0.1  # of the coupling timeout, that a step of the fibers may take: some take ten times the mean
ATTEMPTS = 1.5  # steps of implicit and auto in a step of the flow, of all fibers in the mean

START, START_ALONE = 2.0, 1.5  # programs and kernels, of two sides and of one
PREPARED, PREPARED_ALONE = 4e-6, 1e-6  # initial field and mesh, for each cell; without a mesh
DISK, RECORD = 200e6, 2e-3  # bytes a second into time folders; seconds of a record

# bytes at their highest: of programs without cells and beads, a cell, a bead, and N^2 of a fiber of N beads with rpy
PROGRAMS, PROGRAM = 380e6, 250e6
CELL = {"boxFoam": 900, SPECTRAL: 120}
CELL_OTHER, BEAD_MEMORY = 1500, 4000
MATRICES = {"ab3": 64 * 26, "implicit": 64 * 44}  # in every thread, of every family


@dataclass(frozen=True)
class Cost:
    """Seconds of a run from startTime on an idle machine, on one rank: the parts, of which `fibers` and `coupling` are
    what the flow does not hide; None where nothing was measured. solver, daemon: processor time of the two sides,
    hidden or not: of the flow and its samples, and of the fibers. memory [bytes] of all."""

    start: float
    flow: float | None
    fibers: float
    coupling: float
    writing: float
    total: float | None
    solver: float | None
    daemon: float
    memory: float


def cost(scene: Scene, slower: float | None = None) -> Cost:
    """The estimate. slower: than the machine of the costs; None: measured."""
    slower = machine() if slower is None else slower
    steps = scene.steps
    cells, beads = math.prod(scene.cells or (0,)), sum(f.count * f.beads for f in scene.families)
    flow = _flow(scene, cells, steps)
    step = None if flow is None else flow / max(steps, 1)
    alone = scene.application == SPECTRAL
    daemon = (
        (ALONE if alone else DAEMON) + TAKEN * beads + sum(FAMILY + _moved(f, scene) for f in scene.families)
    )
    sampling = _sampled(scene, cells, beads)
    hidden, sampled = _hidden(scene, step or 0.0, daemon, sampling)
    begin = START_ALONE + PREPARED_ALONE * cells if alone else START + PREPARED * cells
    disk = needed(scene)
    parts = {
        "start": slower * begin,
        "flow": None if flow is None else slower * flow,
        "fibers": slower * steps * (daemon - hidden),
        "coupling": slower * steps * (sampling - sampled),
        "writing": writes(scene) * disk["time_folder"] / DISK + RECORD * steps / scene.record_interval,
    }
    total = None if flow is None else sum(value for value in parts.values() if value is not None)
    solver = None if flow is None else slower * (flow + steps * sampling)
    return Cost(
        **parts,
        total=total,
        solver=solver,
        daemon=slower * steps * daemon,
        memory=_memory(scene, cells, beads),
    )


def patience(scene: Scene, takes: Cost) -> list[Verdict]:
    """Of fibers so dear that the solver, which waits for them, may take the daemon for lost."""
    steps = scene.steps
    if scene.application == SPECTRAL or not steps:
        return []
    longest, step = scene.coupling.timeout, takes.daemon / steps
    asked = f"a step of the fibers [s]; {scene.application} waits {longest:g} s"
    change = f"timeout {math.ceil(10 * step)} (fiberProperties, coupling), or fewer beads"
    found = graded("s/step", step, (PATIENCE * longest, longest), asked, change)
    return [] if found.grade == GOOD else [found]


def machine() -> float:
    """How much slower a core of this machine is than that of the costs: the processor time of a transform."""
    values = np.random.default_rng(0).standard_normal((TASK,) * 3)
    best = math.inf
    for _ in range(REPEATS):
        start = time.process_time()
        np.fft.rfftn(values)
        best = min(best, time.process_time() - start)
    return best / TASK_TIME


def _flow(scene: Scene, cells: int, steps: int) -> float | None:
    """So many steps of the solver on one core [s]; None of one that was not measured."""
    if not cells:
        return None
    if scene.application == SPECTRAL:
        rates = steps * sub_cycles(scene.case) + RUNGE_KUTTA
        return STEP * steps + MODES * cells * rates
    if scene.application == "boxFoam":
        return steps * (STEP + BOX_FOAM * cells)
    if scene.application not in ("pimpleFoam", "pisoFoam"):
        return None
    name = "PIMPLE" if scene.application == "pimpleFoam" else "PISO"
    solution = Dictionary.read(scene.case, "system/fvSolution").sub(name, {})
    outer = solution.integer("nOuterCorrectors", 1, least=1) if name == "PIMPLE" else 1
    inner = solution.integer("nCorrectors", 1, least=1)
    return steps * (STEP + cells * outer * (OUTER + inner * PRESSURE))


def _sampled(scene: Scene, cells: int, beads: int) -> float:
    """The flow at all beads [s], in a step."""
    word = scene.interpolation
    missed = MISSED.get(word, 0.0)
    if scene.application != SPECTRAL:
        bead = AT_CELLS.get(word, AT_CELLS_OTHER) + (missed if 24 * cells > CACHE else 0.0)
        return EXCHANGE + beads * (BEAD + bead) + (0.0 if word in AT_CELLS else WHOLE * cells)
    numbers = NUMBERS[need(scene)]
    part = numbers / NUMBERS["rotation"]
    if word == "exact":
        return part * beads * AT_NODES_EXACT * 4 / 27 * cells
    bead = AT_NODES.get(word, 0.0) + (missed if 8 * numbers * cells > CACHE else 0.0)
    return numbers * FIELD * cells + part * beads * bead


def _hidden(scene: Scene, step: float, daemon: float, sampling: float) -> tuple[float, float]:
    """How much of the fibers and of the coupling [s] goes on beside a step of the flow."""
    if scene.application == SPECTRAL or len(os.sched_getaffinity(0)) == 1:
        return 0.0, 0.0
    # a thread of boxFoam samples while the next step is computed, and the daemon goes on when it has
    beside = (
        scene.application == "boxFoam" and not scene.coupling.feedback and scene.interpolation in AT_CELLS
    )
    sampled = min(sampling, step) if beside else 0.0
    return min(daemon, step - sampled), sampled


def _moved(f: Family, scene: Scene) -> float:
    """A family in a step of the flow [s], on one core."""
    count = sub_steps(f, scene)
    explicit = f.model.integrator == "ab3" or (f.model.integrator == "auto" and count <= AFFORDABLE)
    bead, other, elimination = MOVED["ab3" if explicit else "implicit", f.model.mobility]
    if _matrices(f) > CACHE / LANES:
        elimination *= WAITS
    fibers = LANES * math.ceil(f.count / LANES)
    times = count if explicit else ATTEMPTS
    return fibers * f.beads * times * (bead + other * f.beads + elimination * f.beads**2)


def _matrices(f: Family) -> float:
    """Bytes of the dense systems of eight fibers, with rpy."""
    size = MATRICES["ab3" if f.model.integrator == "ab3" else "implicit"] * f.beads**2
    return size if f.model.mobility == "rpy" else 0.0


def _memory(scene: Scene, cells: int, beads: int) -> float:
    programs = PROGRAM if scene.application == SPECTRAL else PROGRAMS
    matrices = len(os.sched_getaffinity(0)) * sum(map(_matrices, scene.families))
    cell = CELL.get(scene.application, CELL_OTHER)
    return programs + cell * cells + BEAD_MEMORY * beads + matrices
