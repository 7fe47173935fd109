"""Shapes of buckled fibers in cellular flow, found by their bending modes: figure 3 of the paper.

Of each event of `buckling` the shape in which the ends were nearest each other, named as in
`gbm_plugin.statistics.shapes`. Those drawn are, of each kind, the ones in which its mode has the largest share. With
--state, the runs of `buckling` in that folder are read, and go on if they are shorter.
"""

from __future__ import annotations

import argparse
import tempfile
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure
from numpy.typing import NDArray

from ...report.style import COLOURS, new_figure
from ...statistics.shapes import SHAPES, classify
from ..study import option
from ..taylor_green import Scene, run_scenes

DRAWN = 5  # of each kind


def add_arguments(parser: argparse.ArgumentParser) -> None:
    option(parser, run, "sp", "Sperm numbers; the shapes of the first and the last are drawn")
    option(parser, run, "count", "fibers of each")
    option(parser, run, "end", "time of the flow [W/U0]")
    option(parser, run, "beads", "of a fiber")
    option(parser, run, "seed", "of positions and directions")
    option(parser, run, "workers", "processes; 0: as many as processors")
    option(parser, run, "state", "folder that keeps the state (default: none)", type=Path)


def run(
    sp: Sequence[float] = (
        100.0,
        140.0,
        200.0,
        300.0,
        450.0,
        1e3,
        3e3,
        1e4,
        3e4,
        1e5,
        3e5,
        1e6,
        3e6,
        1e7,
        1e8,
    ),
    count: int = 400,
    end: float = 1000.0,
    beads: int = 6,
    seed: int = 1,
    workers: int = 0,
    state: Path | None = None,
) -> dict:
    """How often each shape occurs among the events of each Sperm number, and examples at 450 and the last one."""
    scenes = [Scene(float(number), count=count, beads=beads, seed=seed) for number in sp]
    with tempfile.TemporaryDirectory(prefix="gbm-buckling-") as own:
        runs = run_scenes(scenes, end, state or Path(own), workers, "shapes")
    found, examples = [], {}
    for scene, moved in zip(scenes, runs, strict=True):
        shapes = np.reshape(moved.records.shapes, (-1, beads, 2))
        kinds, shares = classify(shapes)
        counts = np.bincount(kinds, minlength=len(SHAPES))
        fractions = counts / max(len(shapes), 1)
        row = {"sperm_number": scene.sperm_number, "events": len(shapes)}
        found.append(row | {name: float(value) for name, value in zip(SHAPES, fractions, strict=True)})
        examples[f"{scene.sperm_number:g}"] = _purest(shapes, kinds, shares)
    shown = [key for key in ("450", f"{sp[-1]:g}") if key in examples]
    return {
        "count": count,
        "end": end,
        "seed": seed,
        "rows": found,
        "examples": {k: examples[k] for k in shown},
    }


def _purest(shapes: NDArray, kinds: NDArray, shares: NDArray) -> dict[str, list]:
    """Of each kind, up to DRAWN shapes (N, 2)."""
    chosen = {}
    for place, name in enumerate(SHAPES):
        own = np.flatnonzero(kinds == place)
        best = own[np.argsort(-shares[own])[:DRAWN]]
        chosen[name] = shapes[best].tolist()
    return chosen


def _level(shape: NDArray) -> NDArray:
    """(2, N) of a shape (N, 2), its centre at the origin, its ends level."""
    x, y = shape[-1] - shape[0]
    turn = np.array([[x, y], [-y, x]]) / np.hypot(x, y)
    return turn @ (shape - shape.mean(axis=0)).T


def rows(result: dict) -> list[dict]:
    """The lines of a CSV file."""
    return result["rows"]


def table(result: dict) -> str:
    """The fractions as text."""
    lines = ["        Sp    events" + "".join(f"{name:>9}" for name in SHAPES)]
    for r in result["rows"]:
        cells = "".join(f"{r[name]:9.3f}" for name in SHAPES)
        lines.append(f"{r['sperm_number']:10.4g} {r['events']:9d}{cells}")
    return "\n".join(lines)


def draw(result: dict) -> Figure:
    """Examples of each shape, and the fractions against Sp."""
    examples = result["examples"]
    figure = new_figure(9.0, 2.2 * len(examples) + 3.2)
    panels = figure.subfigures(2, 1, height_ratios=[2.2 * max(len(examples), 1), 3.2])
    if examples:
        grid = panels[0].subplots(len(examples), len(SHAPES), squeeze=False)
        for line, (number, kinds) in zip(grid, examples.items(), strict=True):
            for axes, name in zip(line, SHAPES, strict=True):
                for place, shape in enumerate(kinds[name]):
                    x, y = _level(np.array(shape))
                    axes.plot(x, y + 0.3 * place, "o-", markersize=3)
                axes.set(
                    aspect="equal",
                    xlim=(-0.25, 0.25),
                    ylim=(-0.25, 0.3 * DRAWN),
                    title=f"{name}, Sp = {number}",
                )
                axes.set_axis_off()
    axes = panels[1].subplots()
    numbers = [r["sperm_number"] for r in result["rows"]]
    for colour, name in zip(COLOURS, SHAPES, strict=False):
        axes.semilogx(
            numbers, [r[name] for r in result["rows"]], "o-", color=colour, markersize=4, label=name
        )
    axes.set(xlabel="Sp", ylabel="share of events", ylim=(0, None))
    axes.legend(ncol=len(SHAPES))
    return figure
