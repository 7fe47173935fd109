"""What the studies share: copies of the judged case with a scene of their own, and orders of convergence."""

from __future__ import annotations

import itertools
from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np

from ..case.copies import copy_case


def scene_copy(
    case: Path | str,
    copy: Path,
    *,
    cells: int,
    steps: int,
    end_time: float,
    viscosity: float,
    write_every: int,
    texts: Mapping[str, str],
    entries: Mapping[str, Mapping[str, object]] | None = None,
) -> Path:
    """A copy of `case`, with its solver, schemes and settings, that takes `steps` steps to end_time [s] on
    cells^3 with a kinematic viscosity [m2/s]; writes every `write_every` steps. texts: {dictionary: content},
    replaced as a whole; entries: {dictionary: {entry: value}}, changed in place. Raises as `copy_case`."""
    time = {
        "deltaT": end_time / steps,
        "endTime": end_time,
        "writeControl": "timeStep",
        "writeInterval": write_every,
    }
    changed = {
        "system/controlDict": time,
        "system/blockMeshDict": {"n": cells},
        "constant/transportProperties": {"nu": viscosity},
    }
    for name, values in (entries or {}).items():
        changed[name] = {**changed.get(name, {}), **values}
    copy_case(Path(case), copy, changed, texts)
    return copy


FAMILIES = """recordInterval {record};
integrator auto;
tolerance {tolerance:g};
interpolation {interpolation};
families
{{
    stiff {{ count {count}; beads 20; length 1.5; bendingStiffness 1e-2; seed 1; }}
    medium {{ count {count}; beads 20; length 1.5; bendingStiffness 1e-3; seed 2; }}
    soft {{ count {count}; beads 20; length 1.5; bendingStiffness 1e-4; seed 3; }}
}}
"""


def three_families(count: int, record: int, tolerance: float, interpolation: str) -> str:
    """The text of a fiberProperties: fibers that hardly bend, that bend, and that fold in the studies' flows.

    record: steps between records."""
    return FAMILIES.format(count=count, record=record, tolerance=tolerance, interpolation=interpolation)


def checked_cells(cells: Sequence[int], least: int = 8) -> Sequence[int]:
    """The cells, or ValueError where one is odd, too small, or there twice."""
    if not cells or len(set(cells)) < len(cells) or any(n < least or n % 2 for n in cells):
        raise ValueError(f"cells are {tuple(cells)}; allowed: even numbers of at least {least}, each once")
    return cells


def checked_step(time_step: float, longest: float) -> float:
    """The time step [s], or ValueError where it is not positive or too long."""
    if not 0 < time_step <= longest:
        raise ValueError(f"time step is {time_step:g}; allowed: positive, up to {longest:g}")
    return time_step


def observed_orders(rows: Sequence[Mapping], by: str = "cells") -> list[dict]:
    """Orders of all columns `..._error` between each row and the next, in the size `by`; positive where the
    error falls with the cell size (`by` cells) or the step (`by` time_step)."""
    names = [name for name in rows[0] if name.endswith("_error")]
    orders = []
    for coarse, fine in itertools.pairwise(rows):
        refinement = abs(np.log(fine[by] / coarse[by]))
        orders.append({name: float(np.log(coarse[name] / fine[name]) / refinement) for name in names})
    return orders


def rms(u: np.ndarray) -> float:
    """Root mean square of |u| of a field (3, ...)."""
    return float(np.sqrt(np.mean(np.sum(u**2, axis=0))))


def ends_apart(x: np.ndarray, y: np.ndarray, radius: float) -> float:
    """Rms distance of the end beads of the same fibers in two runs, (F, N, 3) each, over their length 2aN."""
    ends = (x - y)[:, [0, -1]]
    return float(np.sqrt(np.mean(np.sum(ends**2, axis=-1)))) / (2 * radius * x.shape[1])


def order_lines(rows: Sequence[Mapping], orders: Sequence[Mapping]) -> list[str]:
    """Rows of errors and the orders between them as text, in columns; other columns `..._seconds` behind."""
    errors = [name for name in rows[0] if name.endswith("_error")]
    seconds = [name for name in rows[0] if name.endswith("_seconds")]
    head = "cells   step [s]" + "".join(f"{e.removesuffix('_error'):>14}" for e in errors)
    lines = [head + "".join(f"{s.removesuffix('_seconds') + ' [s]':>15}" for s in seconds)]
    for row in rows:
        line = f"{row['cells']:5d} {row['time_step']:10.4g}" + "".join(f"{row[e]:14.3e}" for e in errors)
        lines.append(line + "".join(f"{row[s]:15.1f}" for s in seconds))
    lines += ["  order" + 9 * " " + "".join(f"{order[e]:14.2f}" for e in errors) for order in orders]
    return lines
