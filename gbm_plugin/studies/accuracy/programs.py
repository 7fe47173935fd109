"""Other programs that move threads in a cellular flow, in an environment of their own that is thrown away.

LAMMPS: chains of beads, springs and angles, overdamped (fix brownian at no temperature: explicit Euler steps), the flow
a force of atom-style variables. PyElastica: Cosserat rods with little mass, the flow an external drag on their nodes.
Neither turns beads with the flow, nor lets them roll on each other, nor has one a flow that changes but by callbacks.
"""

from __future__ import annotations

import os
import re
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

PACKAGES = ("lammps[mpi]", "pyelastica")
MOST_SECONDS = 120.0  # of one run of a program


@dataclass(frozen=True)
class Threads:
    """Threads in u = (sin x cos y, −cos x sin y, 0): their straight chains of beads (F, N, 3), length, K^b, viscosity
    μ, greatest tension to be expected, and how long they move."""

    positions: NDArray
    length: float
    stiffness: float
    viscosity: float
    tension: float
    end: float

    @property
    def spacing(self) -> float:
        """Between neighbours."""
        return self.length / self.positions.shape[1]

    @property
    def ends(self) -> NDArray:
        """(F, 2, 3) of the contours, half a bead beyond the last centres."""
        x = self.positions
        return np.stack([1.5 * x[:, 0] - 0.5 * x[:, 1], 1.5 * x[:, -1] - 0.5 * x[:, -2]], axis=1)


@dataclass(frozen=True)
class Moved:
    """Vectors (F, 3) from end to end at the last time, largest stretch of a link, steps, processor time of the
    loop over them [s]."""

    vectors: NDArray
    stretch: float
    steps: int
    seconds: float


@contextmanager
def environment() -> Iterator[Path | None]:
    """The folder of a new environment with the programs, or None where they cannot be installed."""
    with tempfile.TemporaryDirectory(prefix="gbm-peers-") as folder:
        place = Path(folder)
        commands = [
            [sys.executable, "-m", "venv", folder],
            [place / "bin/python", "-m", "pip", "install", "--quiet", *PACKAGES],
        ]
        try:
            for command in commands:
                subprocess.run(command, check=True, capture_output=True, timeout=600)
        except (OSError, subprocess.SubprocessError):
            yield None
        else:
            yield place


def _run(place: Path, command: list, **options) -> str:
    """What a program of the environment says."""
    libraries = {"LD_LIBRARY_PATH": str(place / "lib"), "OMP_NUM_THREADS": "1", "NUMBA_NUM_THREADS": "1"}
    done = subprocess.run(
        command,
        check=True,
        capture_output=True,
        text=True,
        timeout=MOST_SECONDS,
        env=os.environ | libraries,
        **options,
    )
    return done.stdout


LAMMPS = """units lj
atom_style angle
atom_modify map yes sort 0 0.0
boundary f f f
pair_style none
comm_modify cutoff {cutoff!r}
bond_style harmonic
angle_style cosine
read_data chains.data
neigh_modify delay 1000000000 every 1000000000 check no
mass 1 1.0
bond_coeff 1 {half_spring!r} {spacing!r}
angle_coeff 1 {bend!r}
variable fx atom {drag!r}*sin(x)*cos(y)
variable fy atom -{drag!r}*cos(x)*sin(y)
fix flow all addforce v_fx v_fy 0.0
fix move all brownian 1.0 1 gamma_t {drag!r} rng none
timestep {step!r}
thermo {steps}
run {steps}
write_dump all custom end.txt id x y z modify sort id format float %.15g
"""


def lammps(place: Path, threads: Threads, stretch: float, share: float = 0.8) -> Moved:
    """Chains whose springs give by `stretch` of their length under the expected tension, in steps of a share of those
    at which Euler's method becomes unstable."""
    fibers, beads, _ = threads.positions.shape
    d, drag = threads.spacing, 3 * np.pi * threads.viscosity * threads.spacing
    spring, bend = threads.tension / (stretch * d), threads.stiffness / d
    fastest = (4 * spring + 16 * bend / d**2) / drag
    steps = int(np.ceil(threads.end * fastest / (2 * share)))
    words = {"cutoff": 8 * d, "half_spring": spring / 2, "spacing": d, "bend": bend, "drag": drag}
    words |= {"step": threads.end / steps, "steps": steps}
    with tempfile.TemporaryDirectory(prefix="gbm-lammps-") as folder:
        (Path(folder) / "chains.data").write_text(_chains(threads.positions))
        (Path(folder) / "in.chains").write_text(LAMMPS.format(**words))
        command = [place / "bin/lmp", "-in", "in.chains", "-log", "none"]
        said = _run(place, command, cwd=folder)
        last = np.loadtxt(Path(folder) / "end.txt", skiprows=9)[:, 1:].reshape(fibers, beads, 3)
    loop, used = re.search(r"Loop time of (\S+)", said), re.search(r"([\d.]+)% CPU use", said)
    assert loop and used
    seconds = float(loop[1]) * float(used[1]) / 100
    moved = Threads(
        last, *(getattr(threads, name) for name in ("length", "stiffness", "viscosity")), 0.0, 0.0
    )
    gaps = np.linalg.norm(np.diff(last, axis=1), axis=2) / d
    return Moved(np.diff(moved.ends, axis=1)[:, 0], float(abs(gaps - 1).max()), steps, seconds)


def _chains(positions: NDArray) -> str:
    """A data file of LAMMPS."""
    fibers, beads, _ = positions.shape
    first = beads * np.arange(fibers)[:, None] + 1
    bonds = (first + np.arange(beads - 1)).ravel()
    angles = (first + np.arange(beads - 2)).ravel()
    low, high = float(positions.min()) - 20, float(positions.max()) + 20
    lines = ["chains", "", f"{fibers * beads} atoms", f"{len(bonds)} bonds", f"{len(angles)} angles"]
    lines += ["1 atom types", "1 bond types", "1 angle types"]
    lines += [f"{low!r} {high!r} {c}lo {c}hi" for c in "xyz"] + ["", "Atoms", ""]
    for n, x in enumerate(positions.reshape(-1, 3)):
        lines.append(f"{n + 1} {n // beads + 1} 1 " + " ".join(repr(float(c)) for c in x))
    lines += ["", "Bonds", ""] + [f"{n + 1} 1 {a} {a + 1}" for n, a in enumerate(bonds)]
    lines += ["", "Angles", ""] + [f"{n + 1} 1 {a} {a + 1} {a + 2}" for n, a in enumerate(angles)]
    return "\n".join(lines) + "\n"


ELASTICA = """
import sys, time
import numpy as np
from numba import njit
import elastica as ea

given = np.load(sys.argv[1])
ends, (length, stiffness, drag, radius, mass, end, steps, elements) = given["ends"], given["numbers"]
elements, steps = int(elements), int(steps)

@njit(cache=True)
def push(x, v, lengths, drag, out):
    for n in range(x.shape[1]):
        size = 0.0
        if n > 0:
            size += 0.5 * lengths[n - 1]
        if n < lengths.shape[0]:
            size += 0.5 * lengths[n]
        out[0, n] += drag * size * (np.sin(x[0, n]) * np.cos(x[1, n]) - v[0, n])
        out[1, n] += drag * size * (-np.cos(x[0, n]) * np.sin(x[1, n]) - v[1, n])
        out[2, n] -= drag * size * v[2, n]

class Drag(ea.NoForces):
    def apply_forces(self, system, time=0.0):
        push(system.position_collection, system.velocity_collection, system.rest_lengths, drag,
             system.external_forces)

class Simulator(ea.BaseSystemCollection, ea.Forcing):
    pass

def made():
    simulator, rods = Simulator(), []
    for start, stop in ends:
        along = (stop - start) / np.linalg.norm(stop - start)
        across = np.cross(along, np.eye(3)[np.argmin(abs(along))])
        area = np.pi * radius**2
        rod = ea.CosseratRod.straight_rod(elements, start, along, across / np.linalg.norm(across), length, radius,
            mass / area, youngs_modulus=4 * stiffness / (np.pi * radius**4))
        simulator.append(rod)
        simulator.add_forcing_to(rod).using(Drag)
        x = rod.position_collection
        middle = (0.5 * (x[:, 1:] + x[:, :-1])).T
        flow = lambda p: np.array([np.sin(p[0]) * np.cos(p[1]), -np.cos(p[0]) * np.sin(p[1]), 0 * p[0]])
        u = flow(x)
        # as a rigid rod of isotropic drag moves
        w = np.full(x.shape[1], 1.0); w[0] = w[-1] = 0.5; w /= w.sum()
        centre, s = (w * x).sum(1), np.linspace(-length / 2, length / 2, x.shape[1])
        mean, turn = (w * u).sum(1), (w * s * u).sum(1) / (w * s * s).sum()
        turn -= along * (along @ turn)
        rod.velocity_collection[:] = mean[:, None] + turn[:, None] * s
        spin = np.cross(along, turn)
        rod.omega_collection[:] = np.einsum("ijn,j->in", rod.director_collection, spin)
        rods.append(rod)
    simulator.finalize()
    return simulator, rods

stepper = ea.PositionVerlet()
def move(count):
    simulator, rods = made()
    now, step = np.float64(0.0), np.float64(end / steps)
    begin = time.process_time()
    for _ in range(count):
        now = stepper.step(simulator, now, step)
    return time.process_time() - begin, rods

move(3)
seconds, rods = move(steps)
stretch = max(abs(rod.lengths / rod.rest_lengths - 1).max() for rod in rods)
np.savez(sys.argv[2], ends=[rod.position_collection[:, [0, -1]].T for rod in rods], stretch=stretch, seconds=seconds)
"""


def pyelastica(place: Path, threads: Threads, stretch: float, share: float = 0.3) -> Moved:
    """Rods that stretch by so much under the expected tension, whose mass makes them lag by half of it in unit time, in
    steps of a share of the shortest time in which a wave crosses an element or a section."""
    radius = np.sqrt(4 * threads.stiffness * stretch / threads.tension)
    drag = 3 * np.pi * threads.viscosity
    mass = drag * stretch / 2  # of a unit of length
    speed = np.sqrt(threads.tension / stretch / mass)
    elements = threads.positions.shape[1]
    fastest = max(speed / threads.spacing, speed / radius, drag / mass)
    steps = int(np.ceil(threads.end * fastest / share))
    numbers = [threads.length, threads.stiffness, drag, radius, mass, threads.end, steps, elements]
    with tempfile.TemporaryDirectory(prefix="gbm-elastica-") as folder:
        given, found = Path(folder) / "given.npz", Path(folder) / "found.npz"
        (Path(folder) / "rods.py").write_text(ELASTICA)
        np.savez(given, ends=threads.ends, numbers=numbers)
        _run(place, [place / "bin/python", Path(folder) / "rods.py", given, found])
        with np.load(found) as result:
            ends, most, seconds = (result[name] for name in ("ends", "stretch", "seconds"))
    return Moved(np.diff(ends, axis=1)[:, 0], float(most), steps, float(seconds))
