"""Error of the buckling probability against time spent: integrator, step, tolerance and bead number.

All methods move the same fibers for so short a time that most paths stay together; a difference in P is then that of
the method, with the error of paired fibers, and not of chance. The reference is ab3 at an eighth of the default step.
Methods on the front have no other that is both faster and nearer to the reference, |ΔP| and its error taken together.
Processor time.
"""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from matplotlib.figure import Figure

from ...report.style import COLOURS, new_figure
from ...statistics.buckling import difference, probability
from ..study import option, steps
from ..taylor_green import DEFAULT, STEPS, Run, Scene

AB3 = (0.1, 0.05, 0.025, 0.0125)  # steps [W/U₀]
IMPLICIT = (0.2, 0.1, 0.05, 0.025)
TOLERANCES = (1e-1, 1e-2, 1e-3)  # of implicit


def add_arguments(parser: argparse.ArgumentParser) -> None:
    option(parser, run, "sp", "Sperm numbers")
    option(parser, run, "beads", "of fibers of the same length")
    option(parser, run, "count", "fibers")
    option(parser, run, "end", "time of the flow [W/U0]")
    option(parser, run, "seed", "of positions and directions")


def run(
    sp: Sequence[float] = (45.0, 450.0),
    beads: Sequence[int] = (6, 12),
    count: int = 400,
    end: float = 8.0,
    seed: int = 1,
) -> dict:
    """P, its difference from the reference and the time of every method, for each Sperm and bead number."""
    cases = [Scene(float(s), count=count, beads=n, seed=seed) for s in sp for n in beads]
    methods = [("ab3", step, 1e-2) for step in AB3]
    methods += [("implicit", step, tolerance) for step in IMPLICIT for tolerance in TOLERANCES]
    work = [(scene, method) for scene in cases for method in [("ab3", STEPS["ab3"] / 8, 1e-2), *methods]]
    found: list[dict] = []
    for scene, (integrator, step, tolerance) in steps(iter(work), len(work), "methods"):
        moved = Run(replace(scene, integrator=integrator, time_step=step, tolerance=tolerance))
        moved.advance(end)
        tracks = moved.tracks[DEFAULT]
        if step == STEPS["ab3"] / 8:
            reference = moved
        others = reference.tracks[DEFAULT]
        apart, error = difference((tracks.events, tracks.tracks), (others.events, others.tracks))
        p = probability(tracks.events, tracks.tracks)
        paths = np.linalg.norm(moved.stepper.positions - reference.stepper.positions, axis=-1).max(axis=-1)
        row = {"sperm_number": scene.sperm_number, "beads": scene.beads, "integrator": integrator}
        row |= {"time_step": step, "tolerance": tolerance if integrator == "implicit" else None}
        row |= {"seconds": moved.seconds, "probability": p.value, "tracks": p.tracks, "error": abs(apart)}
        row |= {"error_of_error": error, "median_path_error": float(np.median(paths)) / scene.length}
        row |= {
            "reference": moved is reference,
            "default": scene.method == (integrator, step) and tolerance == 1e-2,
        }
        found.append(row)
    for row in found:
        row["on_front"] = _on_front(row, found)
    return {"count": count, "end": end, "seed": seed, "rows": found}


def _on_front(row: dict, found: list[dict]) -> bool:
    """Whether nothing of the same fibers is both faster and certainly as near to the reference: |ΔP| and its error
    together are what a method is sure of."""
    same = [r for r in found if (r["sperm_number"], r["beads"]) == (row["sperm_number"], row["beads"])]
    sure = row["error"] + row["error_of_error"]
    better = (r for r in same if r["seconds"] < row["seconds"] and r["error"] + r["error_of_error"] < sure)
    return not row["reference"] and next(better, None) is None


def rows(result: dict) -> list[dict]:
    """The lines of a CSV file."""
    return result["rows"]


def table(result: dict) -> str:
    """All methods as text; * marks the default, + the front."""
    lines = [
        f"{result['count']} fibers, {result['end']:g} W/U0; * default, + front",
        "      Sp  beads  integrator   step  tolerance  seconds        P    error       ±   path/L",
    ]
    for r in result["rows"]:
        tolerance = "" if r["tolerance"] is None else f"{r['tolerance']:g}"
        mark = (
            ("*" if r["default"] else "") + ("+" if r["on_front"] else "") + ("ref" if r["reference"] else "")
        )
        lines.append(
            f"{r['sperm_number']:8.4g} {r['beads']:6d}  {r['integrator']:9} {r['time_step']:8.5f} {tolerance:>7} "
            f"{r['seconds']:9.2f} {r['probability']:8.4f} {r['error']:8.4f} {r['error_of_error']:7.4f} "
            f"{r['median_path_error']:8.1e} {mark}"
        )
    return "\n".join(lines)


def draw(result: dict) -> Figure:
    """Error against time, a panel for each Sperm and bead number."""
    keys = list(dict.fromkeys((r["sperm_number"], r["beads"]) for r in result["rows"]))
    figure = new_figure(4.2 * min(len(keys), 2), 3.6 * -(-len(keys) // 2))
    panels = np.ravel(figure.subplots(-(-len(keys) // 2), min(len(keys), 2), squeeze=False))
    for axes, (number, beads) in zip(panels, keys, strict=False):
        own = [r for r in result["rows"] if (r["sperm_number"], r["beads"]) == (number, beads)]
        curves = [("ab3", None), *(("implicit", tolerance) for tolerance in TOLERANCES)]
        for colour, (integrator, tolerance) in zip(COLOURS, curves, strict=False):
            line = [r for r in own if (r["integrator"], r["tolerance"]) == (integrator, tolerance)]
            line = [r for r in line if not r["reference"]]
            label = integrator if tolerance is None else f"{integrator}, {tolerance:g}"
            x, y, e = ([r[name] for r in line] for name in ("seconds", "error", "error_of_error"))
            axes.errorbar(x, y, e, marker="o", markersize=4, color=colour, label=label, linewidth=1)
        chosen = [r for r in own if r["default"]]
        axes.plot(
            [r["seconds"] for r in chosen], [r["error"] for r in chosen], "ks", markersize=9, fillstyle="none"
        )
        axes.set(
            xscale="log",
            title=f"Sp = {number:g}, N = {beads}",
            xlabel="processor time [s]",
            ylabel="error of P",
        )
    panels[0].legend(fontsize=8)
    return figure
