"""What the coupling costs a step of OpenFOAM: waiting, derivative of U, location and interpolation, sending."""

from __future__ import annotations

import shutil
import tempfile
from pathlib import Path

import numpy as np

from ..case.openfoam import utility
from ..output.dat import read_dat
from ..run import run as run_case

FIBERS = """FoamFile {{ version 2.0; format ascii; class dictionary; object fiberProperties; }}
coupling {{ transport {transport}; }}
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
        copy.mkdir()
        for part in ("0.orig", "constant", "system"):
            shutil.copytree(case / part, copy / part, ignore=shutil.ignore_patterns("polyMesh"))
        changes = {
            "system/controlDict": {"deltaT": 0.005, "endTime": 0.005 * steps, "writeInterval": 10 * steps},
            "system/blockMeshDict": {"n": cells},
        }
        for name, entries in changes.items():
            for entry, value in entries.items():
                words = ("-disableFunctionEntries", "-entry", entry, "-set", str(value))
                utility(copy, "foamDictionary", str(copy / name), *words)
        text = FIBERS.format(
            transport=transport, fibers=fibers, beads=beads, length=0.1 * beads, never=10 * steps
        )
        (copy / "constant/fiberProperties").write_text(text)
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
