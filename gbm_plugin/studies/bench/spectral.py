"""Time per right-hand side of the spectral solver, beside fluidsim's ns3d and nine full real transforms.

The rotational form of a pseudo-spectral code needs nine transforms: their time alone is a scale for any of
them. fluidsim runs in a process of its own (it may live in another environment); the contestants take turns,
so that what else the machine does meets all of them, and the best of their turns is compared. fluidsim works
in double precision: it is the measure for both of ours.
"""

import argparse
import os
import subprocess
import sys
import time
from collections.abc import Callable

import numpy as np
from scipy.fft import rfftn

from gbm_plugin.spectral import SpectralSolver
from gbm_plugin.spectral.transform import repeat

from ..study import option

PEER = """
import os, sys, time
import numpy as np
n, threads = int(sys.argv[1]), int(sys.argv[2])
answers = os.fdopen(os.dup(1), "w")
os.dup2(2, 1)  # what libraries print goes elsewhere
from fluidsim.solvers.ns3d.solver import Simul
import fluidsim
def simulation(fft):
    p = Simul.create_default_params()
    p.output.HAS_TO_SAVE = False
    p.oper.nx = p.oper.ny = p.oper.nz = n
    p.oper.Lx = p.oper.Ly = p.oper.Lz = 2 * np.pi
    p.oper.coef_dealiasing = 2 / 3
    p.oper.type_fft = fft
    p.nu_2 = 1e-3
    p.init_fields.type = "noise"
    return Simul(p)
found = {}
for fft in ["fft3d.with_fftw3d"] * (threads == 1) + ["fft3d.with_pyfftw"]:
    try:
        found[fft] = simulation(fft)
    except Exception as error:
        print(fft, error, file=sys.stderr)
if not found:
    sys.exit("no transform library for fluidsim")
def once(s):
    start = time.perf_counter()
    s.tendencies_nonlin(s.state.state_spect)
    return time.perf_counter() - start
for s in found.values():
    once(s)
fft = min(found, key=lambda f: min(once(found[f]) for _ in range(3)))
print(fluidsim.__version__, fft, file=answers, flush=True)
for line in sys.stdin:
    print(once(found[fft]), file=answers, flush=True)
"""


class Fluidsim:
    """fluidsim in another process, one right-hand side per call."""

    def __init__(self, python: str, cells: int, threads: int):
        self._process = subprocess.Popen(
            [python, "-c", PEER, str(cells), str(threads)],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=subprocess.DEVNULL,
            text=True,
            env=os.environ | {"OMP_NUM_THREADS": str(threads)},
        )
        self.name = self._process.stdout.readline().strip()

    def __bool__(self) -> bool:
        return bool(self.name)

    def __call__(self) -> float:
        self._process.stdin.write("\n")
        self._process.stdin.flush()
        return float(self._process.stdout.readline())

    def close(self) -> None:
        self._process.stdin.close()
        self._process.wait()


def add_arguments(parser: argparse.ArgumentParser) -> None:
    option(parser, run, "cells", "in each direction")
    option(parser, run, "threads", "of the solver")
    option(parser, run, "repeats", "of which the best counts")
    option(parser, run, "fluidsim_python", "interpreter that has fluidsim", metavar="PYTHON")


def run(cells: int = 128, threads: int = 1, repeats: int = 9, fluidsim_python: str = sys.executable) -> dict:
    """Times in seconds, shares and bytes, for double and single precision.

    fluidsim_python: the interpreter that can import fluidsim; where none can, its time is None.
    """
    ours = {precision: _right_hand_side(cells, threads, precision) for precision in ("double", "single")}
    contestants: dict[str, Callable[[], float]] = {}
    for precision, (solver, rhs) in ours.items():
        contestants[precision] = rhs
        contestants[f"{precision}, transforms alone"] = _transforms_alone(solver)
        contestants[f"{precision}, nine full transforms"] = _full_transforms(cells, threads, precision)
    peer = Fluidsim(fluidsim_python, cells, threads)
    if peer:
        contestants["fluidsim"] = peer
    best = dict.fromkeys(contestants, np.inf)
    for _ in range(repeats):
        for name, once in contestants.items():
            best[name] = min(best[name], once())
    peer.close()
    result = {
        "cells": cells,
        "threads": threads,
        "fluidsim": peer.name or None,
        "fluidsim_time": best.get("fluidsim"),
    }
    for precision, (solver, _) in ours.items():
        result[precision] = {
            "time": best[precision],
            "transform_share": best[f"{precision}, transforms alone"] / best[precision],
            "nine_full_transforms": best[f"{precision}, nine full transforms"],
            "bytes_per_point": solver.operators.memory() / cells**3,
            "times_faster_than_fluidsim": best["fluidsim"] / best[precision] if peer else None,
        }
    return result


def rows(result: dict) -> list[dict]:
    """The lines of a CSV file."""
    return [{"cells": result["cells"], "precision": p} | result[p] for p in ("double", "single")]


def table(result: dict) -> str:
    """The result of `run` as text."""
    head = (
        f"{'':10s}{'ms':>8s}{'in FFTs':>9s}{'9 real FFTs, ms':>17s}{'bytes/point':>13s}{'fluidsim/this':>15s}"
    )
    lines = [f"one right-hand side at {result['cells']}^3, {result['threads']} thread(s)", head]
    for precision in ("double", "single"):
        r = result[precision]
        ratio = r["times_faster_than_fluidsim"]
        line = f"{precision:10s}{1e3 * r['time']:8.1f}{r['transform_share']:9.0%}"
        line += f"{1e3 * r['nine_full_transforms']:17.1f}{r['bytes_per_point']:13.0f}"
        lines.append(line + (f"{ratio:15.2f}" if ratio else f"{'-':>15s}"))
    if result["fluidsim"]:
        lines.append(f"fluidsim {result['fluidsim']}, double: {1e3 * result['fluidsim_time']:.1f} ms")
    else:
        lines.append("fluidsim was not found")
    return "\n".join(lines)


def _right_hand_side(cells: int, threads: int, precision: str) -> tuple[SpectralSolver, Callable]:
    solver = SpectralSolver(cells, 1e-3, time_step=1e-3, threads=threads, precision=precision)
    solver.set_velocity(np.random.default_rng(0).standard_normal((3, cells, cells, cells), dtype=np.float32))
    u, out = solver.coefficients, solver.operators.zeros()
    return solver, _timed(lambda: solver.operators.nonlinear(u, out))


def _transforms_alone(solver: SpectralSolver) -> Callable[[], float]:
    """All transforms of one right-hand side, of columns that lie in the cache."""
    operators = solver.operators
    blocks, groups = len(operators._works[0].x), operators._works[0].lines.shape[1]
    along_x = 8 * len(solver.modes.rows) * blocks
    along_y, along_z = 8 * solver.cells * blocks, 4 * solver.cells * groups
    for work in operators._works:
        work.x[:] = work.y[:] = 0

    def part(work, start, stop):
        repeat(work.x[0], work.y[0, 0], work.forward, stop - start)

    return _timed(lambda: operators._share(along_x + along_y + along_z, part))


def _full_transforms(cells: int, threads: int, precision: str) -> Callable[[], float]:
    field = np.zeros((cells,) * 3, "float64" if precision == "double" else "float32")
    return _timed(lambda: [rfftn(field, workers=threads) for _ in range(9)])


def _timed(work: Callable) -> Callable[[], float]:
    def once() -> float:
        start = time.perf_counter()
        work()
        return time.perf_counter() - start

    once()
    return once
