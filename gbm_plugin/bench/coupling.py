"""What the coupling costs a step of OpenFOAM: waiting, derivative of U, location and interpolation, sending."""

from __future__ import annotations

import tempfile
from pathlib import Path

import numpy as np

from ..case.copies import copy_case
from ..output.dat import read_dat
from ..run import run as run_case

FIBERS = """coupling {{ transport {transport}; }}
recordInterval {never};
families {{ bench {{ count {fibers}; beads {beads}; length {length}; bendingStiffness 1e-5; seed 1; }} }}
"""


def run(
    case: Path | str,
    cells: int = 64,
    fibers: int = 1000,
    beads: int = 20,
    steps: int = 30,
    transport: str = "socket",
) -> dict:
    """Median seconds a step, of a copy of `case` with this many cells in each direction and one family.

    Raises CaseError and RunError as `run.run`.
    """
    case = Path(case)
    with tempfile.TemporaryDirectory(prefix="gbm-bench-") as folder:
        copy = Path(folder) / "case"
        entries = {
            "system/controlDict": {"deltaT": 0.005, "endTime": 0.005 * steps, "writeInterval": 10 * steps},
            "system/blockMeshDict": {"n": cells},
        }
        sizes = {"fibers": fibers, "beads": beads, "length": 0.1 * beads, "never": 10 * steps}
        words = FIBERS.format(transport=transport, **sizes)
        copy_case(case, copy, entries, {"constant/fiberProperties": words})
        run_case(copy)
        table = read_dat(copy / "postProcessing/fibers", "coupling.dat")
    late = slice(5, None)  # the first steps are corrected, and compile
    parts = {
        name: float(np.median(table[name][late]))
        for name in ("wait", "derivative", "interpolation", "sending")
    }
    step = float(np.median(np.diff(table["sentAt"])[late]))
    return {
        "cells": cells,
        "fibers": fibers,
        "beads": beads,
        "transport": transport,
        "step": step,
        **parts,
        "share": sum(parts.values()) / step,
    }


def table(result: dict) -> str:
    """The result of `run` as text."""
    lines = [
        f"{result['cells']}^3 cells, {result['fibers']} fibers x {result['beads']} beads, {result['transport']}: "
        f"step {1e3 * result['step']:.1f} ms"
    ]
    for name in ("wait", "derivative", "interpolation", "sending"):
        seconds = result[name]
        lines.append(f"    {name:<16}{1e3 * seconds:8.2f} ms {seconds / result['step']:8.1%}")
    lines.append(
        f"    {'coupling':<16}{1e3 * result['step'] * result['share']:8.2f} ms {result['share']:8.1%}"
    )
    return "\n".join(lines)
