"""What a run gathered of its fibers on the fly: averages with errors, densities, correlation times.

Of runs whose constant/fiberProperties has `statistics { ... }`; no recording is needed. Lengths are in L = 2a(N−1).
"""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from fnmatch import fnmatch
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure

from ...case.layout import results
from ...output.statistics import Gathered, read_statistics
from ...report.style import COLOURS, LINES, new_figure
from ...statistics.ensemble import integral_scale
from ...statistics.running import Running
from ..recorded import run_label

WIDER = 4
TITLES = {"R2": "R²/L²", "Rg": "R$_g$/L", "curvature": "mean curvature × L"}


def add_arguments(parser: argparse.ArgumentParser) -> None:
    text = "folders with postProcessing: a case, or CASE/spectral (default: the working folder)"
    parser.add_argument("cases", nargs="*", type=Path, default=[Path(".")], metavar="CASE", help=text)
    text = "families whose names match one of these patterns, as 'K1e-5*' (default: all)"
    parser.add_argument("--families", nargs="+", default=(), metavar="PATTERN", help=text)


def run(cases: Sequence[Path], families: Sequence[str] = ()) -> dict:
    """Of every such family of every run. FileNotFoundError where nothing was gathered, ValueError without a family."""
    found, densities, spans = [], [], []
    for case in cases:
        gathered, label = read_statistics(results(case)), run_label(Path(case))
        spans.append({"run": label, "from": float(gathered.times[0]), "to": float(gathered.times[-1])})
        spans[-1]["samples"] = len(gathered.times)
        for name, family in gathered.families.items():
            if families and not any(fnmatch(name, pattern) for pattern in families):
                continue
            found.append({"run": label, "family": name} | _row(gathered, family))
            densities.append({"run": label, "family": name} | _densities(family))
    if not found:
        raise ValueError(f"no family is named {' '.join(families)}")
    return {"runs": spans, "rows": found, "densities": densities}


def _row(gathered: Gathered, family: Running) -> dict:
    row = {"count": family.fibers, "beads": family.beads, "length_2aN": 2 * family.radius * family.beads}
    for quantity, average in family.averages.items():
        mean, moments = average.estimate(), average.moments()
        row |= {quantity: mean.value, f"{quantity}_error": mean.error}
        row[f"{quantity}_rms"] = float(np.sqrt(max(moments[1] - moments[0] ** 2, 0.0)))
    row["turning_time"] = integral_scale(family.correlations["R"].value()) * gathered.spacing
    if "curvature" in family.correlations:
        row["bending_time"] = integral_scale(family.curvature_correlation()) * gathered.spacing
    return row


def _densities(family: Running) -> dict:
    """In bins four times as wide, which are smooth enough to be looked at."""
    found = {}
    for quantity, a in family.averages.items():
        counts, edges = a.counts.reshape(-1, WIDER).sum(axis=1), a.edges[::WIDER]
        density = counts / (counts.sum() * np.diff(edges))
        found[quantity] = {"edges": edges.tolist(), "density": density.tolist()}
    return found


def rows(result: dict) -> list[dict]:
    """The lines of a CSV file."""
    return result["rows"]


def table(result: dict) -> str:
    """Averages as text."""
    lines = [
        f"{r['run']}: t = {r['from']:g} to {r['to']:g} s, {r['samples']} samples" for r in result["runs"]
    ]
    width = max(len(f"{r['run']} {r['family']}") for r in result["rows"])
    lines.append(f"{'family':{width}} {'<R²>/L²':>9} {'±':>7} {'R_g/L':>8} {'±':>7} {'κ̄L':>8} {'±':>7}")
    for r in result["rows"]:
        cells = ["" if r.get(n) is None else f"{r[n]:.4g}" for q in TITLES for n in (q, f"{q}_error")]
        sizes = (9, 7, 8, 7, 8, 7)
        texts = " ".join(f"{c:>{s}}" for c, s in zip(cells, sizes, strict=True))
        lines.append(f"{r['run'] + ' ' + r['family']:{width}} {texts}")
    return "\n".join(lines)


def draw(result: dict) -> Figure:
    """The densities of each quantity, a line for each family."""
    figure = new_figure(12.5, 3.9)
    for axes, (quantity, title) in zip(figure.subplots(1, 3), TITLES.items(), strict=True):
        own = [d for d in result["densities"] if quantity in d]
        for number, d in enumerate(own):
            edges, density = (np.array(d[quantity][n]) for n in ("edges", "density"))
            style = {
                "color": COLOURS[number % len(COLOURS)],
                "linestyle": LINES[number // len(COLOURS) % len(LINES)],
            }
            axes.stairs(density, edges, label=f"{d['run']} {d['family']}", linewidth=1, **style)
        axes.set(xlabel=title, ylabel="density", yscale="log")
    axes.set(xscale="log", xlim=(1e-3, None))
    axes.legend(fontsize=5, ncols=2)
    return figure
