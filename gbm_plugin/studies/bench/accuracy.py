"""What an accuracy costs: every choice of a scene, its error beside its time.

Each part measures one choice (--only names some). Errors are over the fiber length, times are processor
time of one thread, all ratios are of one run; * marks the default, + what nothing else beats in both.
"""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from importlib import import_module
from types import ModuleType

import numpy as np
from matplotlib.figure import Figure

from ...report.style import new_figure
from ...threads import limited_to
from ..study import option, steps

PARTS = ("integrators", "beads", "mobility", "sampling", "step", "engines", "peers")


def _part(name: str) -> ModuleType:
    return import_module(f"gbm_plugin.studies.accuracy.{name}")


def add_arguments(parser: argparse.ArgumentParser) -> None:
    option(parser, run, "only", f"parts of {', '.join(PARTS)} (default: all)", choices=PARTS, metavar="PART")
    option(parser, run, "quick", "fewer and smaller cases, within two minutes")


def run(only: Sequence[str] = PARTS, quick: bool = False) -> dict:
    """{part: rows}."""
    with limited_to(1):
        return {name: _part(name).measure(quick) for name in steps(only, len(only), "accuracy")}


def rows(result: dict) -> list[dict]:
    """The lines of a CSV file, of all parts."""
    return [{"part": name} | row for name, found in result.items() for row in found]


def draw(result: dict) -> Figure:
    """A panel for each part that has a picture."""
    drawn = [name for name in result if hasattr(_part(name), "draw")]
    columns = min(2, len(drawn))
    figure = new_figure(5.2 * columns, 4.2 * -(-len(drawn) // columns))
    panels = np.ravel(figure.subplots(-(-len(drawn) // columns), columns, squeeze=False))
    for axes, name in zip(panels, drawn, strict=False):
        _part(name).draw(axes, result[name])
    for axes in panels[len(drawn) :]:
        axes.set_axis_off()
    return figure


def table(result: dict) -> str:
    """One table for each part."""
    text = []
    for name, found in result.items():
        part = _part(name)
        text += [(part.__doc__ or "").partition("\n")[0], *part.lines(found), ""]
    return "\n".join(text[:-1])
