"""What the coupling costs a step of OpenFOAM: waiting for daemons, finding beads, sampling, sending.

On one rank boxFoam computes its next step meanwhile; "held" is for how long the coupling held up the solver.

--processor-time leaves out the time in which OpenFOAM did not run, for a machine that does other things too; of the
daemon the shortest step is then taken. It is for one rank, and adds up all work, whether the solver waited or not.
"""

from __future__ import annotations

import argparse
import os
import re
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import numpy as np

from ...case.copies import copy_case
from ...case.layout import COUPLING_TABLE, daemon_table, log_file, results
from ...case.scene import read_scene
from ...case.share import all_shares
from ...output.tables import read_dat
from ...run.openfoam import run as run_case
from ..study import option
from .step import process_clock

FIBERS = """coupling {{ transport {transport}; daemons {daemons}; }}
recordInterval {never};
interpolation {interpolation};
families {{ bench {{ count {fibers}; beads {beads}; length {length}; bendingStiffness 1e-5; seed 1; }} }}
"""
SLABS = """numberOfSubdomains {ranks};
method simple;
simpleCoeffs {{ n (1 1 {ranks}); delta 0.001; }}
"""
PARTS = ("wait", "location", "sampling", "sending")  # columns of coupling.dat
START = 5  # the first steps are corrected, and compile


def add_arguments(parser: argparse.ArgumentParser) -> None:
    option(parser, run, "case", "OpenFOAM case that is copied (default: this folder)")
    option(parser, run, "cells", "in each direction")
    option(parser, run, "fibers", "how many")
    option(parser, run, "beads", "of each fiber")
    option(parser, run, "steps", "of OpenFOAM")
    option(parser, run, "transport", "how the two sides talk", choices=("socket", "tcp", "file"))
    option(parser, run, "ranks", "of OpenFOAM, in slabs")
    option(parser, run, "daemons", "that share the fibers")
    option(parser, run, "processor_time", "of OpenFOAM, for one rank")


def run(
    case: Path | str,
    cells: int = 64,
    fibers: int = 1000,
    beads: int = 20,
    steps: int = 30,
    transport: str = "socket",
    ranks: int = 1,
    daemons: int = 1,
    processor_time: bool = False,
) -> dict:
    """Median seconds a step (of processor time, the step's mean), of a copy of `case` with this many cells in each
    direction and one family. "share" of the step: what held up the solver; of processor time, all work of the
    coupling.

    "daemon" is the time from a sample's arrival at the slowest daemon to its next positions, which a step of the flow
    hides as long as it is longer. Raises CaseError and RunError as `run.run`.
    """
    if processor_time and ranks > 1:
        raise ValueError("--processor-time is for one rank: ranks that wait use the processor, too")
    case = Path(case)
    word = read_scene(case).interpolation
    with tempfile.TemporaryDirectory(prefix="gbm-bench-") as folder:
        copy = Path(folder) / "case"
        entries = {
            "system/controlDict": {
                "deltaT": 0.32 / cells,
                "endTime": 0.32 / cells * (steps + 0.5),
                "writeInterval": 10 * steps,
            },
            "system/blockMeshDict": {"n": cells},
        }
        sizes = {"fibers": fibers, "beads": beads, "length": 0.1 * beads, "never": 10 * steps}
        texts = {
            "constant/fiberProperties": FIBERS.format(
                transport=transport, daemons=daemons, interpolation=word, **sizes
            ),
            "system/decomposeParDict": SLABS.format(ranks=ranks),
        }
        copy_case(case, copy, entries, texts)
        clock = process_clock(Path(folder), "steady_clock") if processor_time else None
        with _preloaded(clock):
            run_case(copy, parallel=ranks > 1)
        log = log_file(copy, read_scene(copy).application).read_text()
        folder = results(copy)
        table = read_dat(folder, COUPLING_TABLE)
        of_daemons = [read_dat(folder, daemon_table(share)) for share in all_shares(daemons)]
    parts = {name: float(np.median(table[name][START:])) for name in (*PARTS, "held")}
    step = float(np.median(np.diff(table["sentAt"])[START:]))
    typical = np.min if processor_time else np.median
    busy = [typical((d["sentAt"][1:] - d["arrivedAt"][:-1])[START:]) for d in of_daemons]
    if processor_time:
        times = [float(t) for t in re.findall(r"^ExecutionTime = (\S+) s", log, re.MULTILINE)][START:]
        step = (times[-1] - times[0]) / (len(times) - 1)
        parts["held"] = sum(parts[name] for name in PARTS)
    return {
        "cells": cells,
        "fibers": fibers,
        "beads": beads,
        "transport": transport,
        "interpolation": word,
        "ranks": ranks,
        "daemons": daemons,
        "step": step,
        **parts,
        "share": parts["held"] / step,
        "daemon": float(max(busy)),
        "positions_bytes": 24 * fibers * beads,
        "sample_bytes": 48 * fibers * beads,
    }


@contextmanager
def _preloaded(library: Path | None) -> Iterator[None]:
    before = os.environ.get("LD_PRELOAD")
    if library:
        os.environ["LD_PRELOAD"] = str(library)
    try:
        yield
    finally:
        os.environ.pop("LD_PRELOAD", None)
        if before is not None:
            os.environ["LD_PRELOAD"] = before


def rows(result: dict) -> list[dict]:
    """The lines of a CSV file."""
    return [result]


def table(result: dict) -> str:
    """The result of `run` as text."""
    lines = [
        f"{result['cells']}^3 cells, {result['fibers']} fibers x {result['beads']} beads, "
        f"{result['interpolation']}, {result['transport']}, "
        f"{result['ranks']} rank(s), {result['daemons']} daemon(s): step {1e3 * result['step']:.1f} ms"
    ]
    for name in PARTS:
        seconds = result[name]
        lines.append(f"    {name:<16}{1e3 * seconds:8.2f} ms {seconds / result['step']:8.1%}")
    lines.append(f"    {'the solver held':<16}{1e3 * result['held']:8.2f} ms {result['share']:8.1%}")
    lines.append(f"    beside it, the slowest daemon is busy for {1e3 * result['daemon']:.2f} ms")
    return "\n".join(lines)
