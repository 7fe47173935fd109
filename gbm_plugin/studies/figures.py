"""The figures of the studies that validate."""

from __future__ import annotations

import numpy as np
from matplotlib.figure import Figure

from ..report.style import COLOURS, LINES, new_figure


def convergence_figure(rows: list[dict]) -> Figure:
    """Errors of `validate` against the number of cells per edge, with second order, and against time spent."""
    figure = new_figure(8.8, 3.9)
    left, right = figure.subplots(1, 2, sharey=True)
    _errors(left, rows, "cells")
    left.set(ylabel="error against the spectral solver")
    _errors(right, rows, "openfoam_seconds")
    right.set(xlabel="seconds of the OpenFOAM run")
    return figure


def orders_figure(rows: list[dict], temporal_rows: list[dict]) -> Figure:
    """Errors against the number of cells per edge, and against the time step."""
    figure = new_figure(8.8, 3.9)
    left, right = figure.subplots(1, 2)
    _errors(left, rows, "cells")
    left.set(ylabel="error against the analytic flow")
    _errors(right, temporal_rows, "time_step")
    right.set(ylabel="difference from half the step")
    return figure


def _errors(axes, rows: list[dict], by: str) -> None:
    """All columns `..._error` against the column `by`; second order for cells, second and third for a step."""
    x = np.array([row[by] for row in rows], dtype=float)
    names = [name for name in rows[0] if name.endswith("_error")]
    for number, name in enumerate(names):
        style = dict(marker="o", markersize=4, color=COLOURS[number], linestyle=LINES[number % len(LINES)])
        axes.loglog(x, [row[name] for row in rows], label=name.removesuffix("_error"), **style)
    largest = max(rows[0][name] for name in names)
    for order, line in {"cells": ((-2, "-"),), "time_step": ((2, "-"), (3, "--"))}.get(by, ()):
        label = {2: "second order", 3: "third order"}[abs(order)]
        axes.loglog(x, 1.3 * largest * (x / x[0]) ** order, line, color="0.5", linewidth=1, label=label)
    if by in ("cells", "time_step"):
        axes.set(xlabel="cells per edge" if by == "cells" else "time step [s]")
        axes.set_xticks(x, [f"{value:g}" for value in x])
        axes.minorticks_off()
        axes.legend(fontsize=8)


def stationary_figure(runs: list[dict]) -> Figure:
    """Averages of several runs: E(k), and for each family the density of the mean curvature, with standard errors.

    runs: as those of the result of validation/stationary.py.
    """
    families = list(runs[0]["curvature"])
    figure = new_figure(4.6 * (1 + len(families)) - 2, 4.0)
    first, *rest = figure.subplots(1, 1 + len(families), width_ratios=[1.3] + [1] * len(families))
    for number, run in enumerate(runs):
        style = dict(color=COLOURS[number], linestyle=LINES[number % len(LINES)], linewidth=1.4)
        style |= dict(label=f"{run['engine']} {run['cells']}³", elinewidth=1, marker=".")
        curve = run["spectrum"]
        k, mean, error = (np.array(curve[name]) for name in ("k", "mean", "error"))
        first.errorbar(k, mean, np.minimum(error, 0.9 * mean), **style)
        for axes, family in zip(rest, families, strict=True):
            curve = run["curvature"][family]
            edges = np.array(curve["edges"])
            axes.errorbar(0.5 * (edges[1:] + edges[:-1]), curve["mean"], curve["error"], **style)
    first.set(xscale="log", yscale="log", xlabel="k [rad/m]", ylabel="E(k) [m³/s²]")
    first.legend(loc="lower left")
    for axes, family in zip(rest, families, strict=True):
        axes.set(xlabel="mean curvature × L", title=family, ylim=(0, None))
    rest[0].set(ylabel="probability density")
    return figure


def replay_figure(rows: list[dict]) -> Figure:
    """Distances of `validate --study replay` against the interval between fields and against bytes on disk."""
    figure = new_figure(8.8, 3.9)
    left, right = figure.subplots(1, 2, sharey=True)
    names = [name for name in rows[0] if name.endswith("_distance")]
    for words, line, order in (("linear", "--", 2), ("cubic", "-", 4)):
        own = [row for row in rows if row["in_time"] == words and row["every"] > 1]
        intervals = np.array([row["interval_over_tau"] for row in own])
        sizes = [row["bytes_per_time"] / 1e6 for row in own]
        for number, name in enumerate(names):
            distances = [row[name] for row in own]
            style = dict(marker="o", markersize=4, color=COLOURS[number], linestyle=line)
            left.loglog(intervals, distances, label=f"{name.removesuffix('_distance')}, {words}", **style)
            right.loglog(sizes, distances, **style)
        first = 0.5 * min(own[0][name] for name in names)
        slope = first * (intervals / intervals[0]) ** order
        shown = slope <= max(row[name] for row in own for name in names)
        left.loglog(intervals[shown], slope[shown], color="0.5", linewidth=1, linestyle=line)
    left.set(xlabel="interval between fields / τ$_η$", ylabel="distance of end beads / L")
    left.legend(fontsize=8, handlelength=3.5)
    right.set(xlabel="velocity fields on disk [MB per unit time]")
    return figure
