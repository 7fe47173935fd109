"""Peers: time of LAMMPS, PyElastica, the paper's AB3 and ours to the same vectors from end to end

The same threads in the cellular flow of eq. (12): isotropic drag 3πμ a unit of length, bending stiffness K^b, from
the same straight lines, for 2 τ; the error is that of the vectors from end to end over the length, rms, against 160
beads of ours. Every program takes the beads, springs and steps that it needs. Programs are installed for the study, and
left out where they cannot be; what they cannot do: beads that turn with the flow and roll on each other, hydrodynamic
interaction, a flow known in samples only.
"""

from __future__ import annotations

import subprocess
from collections.abc import Callable, Iterator, Sequence
from functools import partial

import numpy as np
from numpy.typing import NDArray

from . import programs
from .flows import Carrier, cellular
from .integrators import own_limit
from .march import fastest, march
from .programs import Moved, Threads

PERSISTENCE = 0.4  # l_p/L: the stiffer family of the default case
COUNT, END = 8, 2.0  # fibers; [τ]
EXACT = 160  # beads of the reference
TARGETS = (1e-2, 1e-3)
BEADS = {1e-2: (8, 12, 16), 1e-3: (28, 40, 56)}  # until the target is met
STEPS = {1e-2: 0.2, 1e-3: 0.1}  # of ours [τ]
RATE = 1.0  # compression of the flow [1/τ]


def measure(quick: bool) -> list[dict]:
    """A row for each target and program."""
    carrier = cellular()
    exact = _vectors(
        march(carrier, _fibers(carrier, EXACT), 0.05, END, integrator="implicit", tolerance=1e-4)
    )
    rows = []
    with programs.environment() as place:
        for target in TARGETS[: 1 if quick else None]:
            for name, move in _programs(carrier, target, place):
                rows.append(_first(name, target, move, exact, carrier.length))
            ours = next(r["seconds"] for r in rows if (r["program"], r["target"]) == ("gbm, auto", target))
            for row in rows:
                if row["target"] == target:
                    row["over_ours"] = row["seconds"] / ours
    return rows


def _fibers(carrier: Carrier, beads: int):
    return carrier.fibers(PERSISTENCE, beads, COUNT)


def _programs(carrier: Carrier, target: float, place) -> Iterator[tuple[str, Callable[[int], Moved]]]:
    yield "gbm, auto", partial(_ours, carrier, STEPS[target], "auto")
    yield "AB3, eq. (10)", partial(_ours, carrier, STEPS[target], "ab3")
    yield "AB3, own limit", partial(_own_limit, carrier, STEPS[target])
    if place is not None:
        yield "LAMMPS", lambda beads: programs.lammps(place, _threads(carrier, beads), target)
        yield "PyElastica", lambda beads: programs.pyelastica(place, _threads(carrier, beads), target)


def _first(name: str, target: float, move: Callable[[int], Moved], exact: NDArray, length: float) -> dict:
    """The row of the fewest beads that meet the target, or of the most where none does, or of those that take longer
    than programs.MOST_SECONDS."""
    for beads in BEADS[target]:
        try:
            moved = move(beads)
        except subprocess.TimeoutExpired:
            moved = Moved(np.full_like(exact, np.nan), np.nan, 0, programs.MOST_SECONDS)
        error = float(np.sqrt(((moved.vectors - exact) ** 2).sum(axis=1).mean())) / length
        if not error > target:  # or without an end
            break
    row = {"program": name, "target": target, "beads": beads, "steps": moved.steps, "error": error}
    return row | {"stretch": moved.stretch, "seconds": moved.seconds}


def _ours(carrier: Carrier, step: float, integrator: str, beads: int) -> Moved:
    (outcome,) = fastest([partial(march, carrier, _fibers(carrier, beads), step, END, integrator=integrator)])
    seconds = outcome.seconds + outcome.sampling
    return Moved(_vectors(outcome), 0.0, int(outcome.report["substeps"]), seconds)


def _own_limit(carrier: Carrier, step: float, beads: int) -> Moved:
    with own_limit():
        return _ours(carrier, step, "ab3", beads)


def _threads(carrier: Carrier, beads: int) -> Threads:
    mu, length = carrier.viscosity, carrier.length  # density 1
    tension = 3 * np.pi * mu * RATE * length**2 / 8
    fibers = _fibers(carrier, beads)
    return Threads(fibers.positions, length, carrier.stiffness(PERSISTENCE), mu, tension, END)


def _vectors(outcome) -> NDArray:
    x = outcome.positions
    return 1.5 * x[:, -1] - 0.5 * x[:, -2] - 1.5 * x[:, 0] + 0.5 * x[:, 1]


def lines(rows: Sequence[dict]) -> list[str]:
    """Times are processor time of one thread, of all fibers; stretch: of the worst link."""
    text = ["target  program           N     steps    error  stretch    CPU [s]  over gbm"]
    for r in rows:
        missed = "" if r["error"] <= r["target"] else "  missed" if r["steps"] else "  stopped"
        text.append(
            f"{r['target']:6g}  {r['program']:14s}{r['beads']:5d}{r['steps']:10d}{r['error']:9.1e}{r['stretch']:9.1e}"
            f"{r['seconds']:11.4f}{r['over_ours']:10.1f}{missed}"
        )
    if not any(r["program"] == "LAMMPS" for r in rows):
        text.append("LAMMPS and PyElastica could not be installed")
    return text
