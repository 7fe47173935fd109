"""Runs of boxFoam without fibers, and the differences that it should have, written once more in NumPy."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from gbm_plugin.output.field import read_velocity

from conftest import divide, make_case, set_entry, solver_log, start_solver

FIRST = {2: (1 / 2,), 4: (2 / 3, -1 / 12), 6: (3 / 4, -3 / 20, 1 / 60)}
SECOND = {2: (1,), 4: (4 / 3, -1 / 12), 6: (3 / 2, -3 / 20, 1 / 90)}
NO_FORCE = "// nothing\n"


def difference(u: np.ndarray, axis: int, order: int, h: float) -> np.ndarray:
    """The central difference along an axis of a periodic lattice."""
    pairs = enumerate(FIRST[order], start=1)
    return sum(a * (np.roll(u, -m, axis) - np.roll(u, m, axis)) for m, a in pairs) / h


def divergence(u: np.ndarray, order: int, h: float) -> np.ndarray:
    return sum(difference(u[i], i, order, h) for i in range(3))


def laplacian_symbol(theta: float, order: int) -> float:
    """-h^2 times the eigenvalue of the second difference for a wave of this phase from cell to cell."""
    return sum(2 * c * (1 - np.cos(m * theta)) for m, c in enumerate(SECOND[order], start=1))


def box_case(
    path: Path, *, order: int = 6, nu: float = 0.01, steps: int = 10, ranks: int = 1, **options
) -> Path:
    """A case for boxFoam, written at its end only unless asked otherwise."""
    options = {"fv_options": NO_FORCE, "write_every": steps} | options
    make_case(path, steps=steps, application="boxFoam", viscosity=nu, **options)
    control = path / "system/controlDict"
    control.write_text(control.read_text().split("functions")[0])
    set_entry(path / "system/fvSchemes", "differences", f"central{order}")
    if ranks > 1:
        divide(path, ranks, (1, 1, ranks))
    return path


def run(path: Path, ranks: int = 1) -> str:
    """Run the case's solver to its end; its log."""
    status = start_solver(path, ranks).wait()
    text = solver_log(path).read_text()
    assert status == 0, text[-2000:]
    return text


def velocity(path: Path, time: str, n: int) -> np.ndarray:
    return read_velocity(path, time, (n, n, n))


def centres(n: int) -> np.ndarray:
    """Cell centres (3, n, n, n) of the box of width 2 pi."""
    x = (np.arange(n) + 0.5) * 2 * np.pi / n
    return np.stack(np.meshgrid(x, x, x, indexing="ij"))
