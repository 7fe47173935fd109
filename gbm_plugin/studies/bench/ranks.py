"""What the coupling costs on several ranks and with several daemons, beside a model of it.

Constants, nanoseconds per bead of sampling, finding, sending and of a daemon's step, come from one rank with one
daemon and two numbers of fibers; the model then predicts the other runs:

    coupling = fixed + B (location + sending)/H + B sampling/R      H = min(daemons, ranks) ranks serve daemons
    daemon   = fixed + B daemon/D
    step     = flow + coupling + max(0, daemon - flow)

with B beads, R ranks, D daemons, and flow, the step without fibers' cost, as measured with few fibers on R ranks. A
daemon is a bottleneck from B = D (flow - fixed)/daemon on. On one rank boxFoam computes its step while a thread does
what the coupling is, and a daemon goes on when it has its sample:

    step     = max(flow, coupling + daemon)

Where processes outnumber cores they share these, which the model does not know.
"""

from __future__ import annotations

import argparse
from pathlib import Path

from ...case.scene import read_scene
from ..study import option
from . import coupling
from .coupling import PARTS

BEADS = 20
FEW, MANY = 1000, 20_000  # fibers


def measure(case: Path, cells: int, fibers: int, ranks: int, daemons: int, turns: int) -> dict:
    """The turn with the shortest step."""
    runs = [coupling.run(case, cells, fibers, BEADS, 20, ranks=ranks, daemons=daemons) for _ in range(turns)]
    return min(runs, key=lambda r: r["step"])


def constants(few: dict, many: dict) -> dict[str, tuple[float, float]]:
    """Fixed seconds and seconds per bead of each part, from two runs on one rank."""
    beads = [r["fibers"] * r["beads"] for r in (few, many)]
    result = {}
    for name in ("location", "sampling", "sending", "daemon"):
        slope = max(0.0, (many[name] - few[name]) / (beads[1] - beads[0]))
        result[name] = (max(0.0, few[name] - slope * beads[0]), slope)
    return result


def predict(
    c: dict, flow: float, beads: int, ranks: int, daemons: int, beside: bool = False
) -> dict[str, float]:
    """Seconds of the coupling, of a daemon, and of the whole step; beside: the solver does not wait for it."""
    served = min(ranks, daemons)
    coupling = sum(c[name][0] for name in ("location", "sampling", "sending"))
    coupling += beads * ((c["location"][1] + c["sending"][1]) / served + c["sampling"][1] / ranks)
    daemon = c["daemon"][0] + beads * c["daemon"][1] / daemons
    step = max(flow, coupling + daemon) if beside else flow + coupling + max(0.0, daemon - flow)
    return {"coupling": coupling, "daemon": daemon, "step": step}


def add_arguments(parser: argparse.ArgumentParser) -> None:
    option(parser, run, "case", "OpenFOAM case that is copied (default: this folder)")
    option(parser, run, "cells", "in each direction")
    option(parser, run, "turns", "of each run, of which the fastest counts")


def run(case: Path | str, cells: int = 64, turns: int = 2) -> dict:
    """Measured and predicted seconds of all runs, and the constants of the model. Raises as `coupling.run`."""

    def turn(fibers: int, ranks: int, daemons: int) -> dict:
        return measure(Path(case), cells, fibers, ranks, daemons, turns)

    threaded = read_scene(case).application == "boxFoam"
    few = {ranks: turn(FEW, ranks, 1) for ranks in (1, 2, 4)}
    many = {(r, d): turn(MANY, r, d) for r, d in ((1, 1), (1, 2), (2, 1), (2, 2), (4, 1), (4, 2), (4, 4))}
    c = constants(few[1], many[1, 1])
    found = []
    for r in [*few.values(), *many.values()]:
        base = few[r["ranks"]]
        flow = base["step"] - base["held"]
        beside = threaded and r["ranks"] == 1
        predicted = predict(c, flow, r["fibers"] * r["beads"], r["ranks"], r["daemons"], beside)
        coupling_time = sum(r[name] for name in PARTS if name != "wait")
        found.append(r | {"coupling": coupling_time} | {f"{k}_model": v for k, v in predicted.items()})
    limits = {}
    for ranks, r in few.items():
        flow = r["step"] - r["held"]
        busy = list(c) if threaded and ranks == 1 else ["daemon"]
        fixed, each = (sum(c[name][i] for name in busy) for i in (0, 1))
        limits[ranks] = {"flow": flow, "fibers": max(0.0, flow - fixed) / each / BEADS}
    return {"constants": c, "rows": found, "limits": limits}


def rows(result: dict) -> list[dict]:
    """The lines of a CSV file."""
    return result["rows"]


def table(result: dict) -> str:
    """The result of `run` as text."""
    lines = ["constants, ms and ns per bead:"]
    lines += [f"    {n:<10}{1e3 * a:8.2f}{1e9 * b:8.0f}" for n, (a, b) in result["constants"].items()]
    lines += [
        "| ranks | daemons | fibers | coupling: ms, model | daemon: ms, model | step: ms, model |",
        "|---|---|---|---|---|---|",
    ]
    for r in result["rows"]:
        text = " | ".join(
            f"{1e3 * r[n]:.1f}, {1e3 * r[f'{n}_model']:.1f}" for n in ("coupling", "daemon", "step")
        )
        lines.append(f"| {r['ranks']} | {r['daemons']} | {r['fibers']} | {text} |")
    for ranks, r in result["limits"].items():
        lines.append(
            f"{ranks} rank(s): a step of {1e3 * r['flow']:.0f} ms; "
            f"one daemon keeps up with {r['fibers']:.0f} fibers of {BEADS}"
        )
    return "\n".join(lines)
