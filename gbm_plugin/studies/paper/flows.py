"""Table 1 of the paper beside the long runs that are kept: Flow I and linear forcing at several resolutions.

Reads what `gbm study flow-one` keeps, <name>_<cells>.csv and their spectra, in one folder.
"""

from __future__ import annotations

import argparse
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure
from matplotlib.ticker import NullFormatter

from ...report.style import new_figure
from ...statistics.series import TimeSeries
from ..study import option

# quantity: its name in the series, and what Table 1 says of Flow I
QUANTITIES = {
    "ε": ("dissipation", "0.0015"),
    "power": ("power", ""),
    "η": ("kolmogorov_length", "0.0286"),
    "Re_λ": ("taylor_reynolds", "51"),
    "λ": ("taylor_length", "0.23 (0.40 from its ν, ε, Re_λ)"),
    "L = (π/2u'²)∫E/k dk": ("integral_length", "0.7"),
    "u'": ("velocity_rms", ""),
    "u'³/ε": ("dissipation_length", ""),
    "skewness of ∂u/∂x": ("velocity_skewness", ""),
    "flatness of ∂u/∂x": ("velocity_flatness", ""),
}


def add_arguments(parser: argparse.ArgumentParser) -> None:
    option(parser, run, "folder", "where the runs are kept")
    option(parser, run, "name", "of the runs, without cells and suffix")
    option(parser, run, "settle", "start of the averages of each run, coarsest first [s]")


def run(
    folder: Path = Path("docs/results"),
    name: str = "spectral_flow_I",
    settle: tuple[float, ...] = (150.0, 20.0),
) -> dict:
    """Means with standard errors of every kept run. FileNotFoundError where there is none, ValueError where the
    starts of the averages are not one for each run."""
    paths = [p for p in folder.glob(f"{name}_*.csv") if p.stem.rpartition("_")[2].isdigit()]
    paths.sort(key=lambda p: int(p.stem.rpartition("_")[2]))
    if not paths:
        raise FileNotFoundError(f"no {name}_<cells>.csv in {folder}: gbm study flow-one makes them")
    if len(settle) != len(paths):
        found = " ".join(p.name for p in paths)
        raise ValueError(
            f"--settle has {len(settle)} numbers for {len(paths)} runs, {found}: give one for each"
        )
    return {"name": name, "runs": [_averages(path, start) for path, start in zip(paths, settle, strict=True)]}


def _averages(path: Path, settle: float) -> dict:
    series, cells = TimeSeries.read(path), int(path.stem.rpartition("_")[2])
    means = {q: series.mean(column, settle) for q, (column, _) in QUANTITIES.items()}
    spectrum = np.loadtxt(path.with_name(path.stem + "_spectrum.csv"), delimiter=",", skiprows=1)
    epsilon = means["ε"]
    return {
        "cells": cells,
        "means": {q: {"mean": m.value, "standard_error": m.error, "text": str(m)} for q, m in means.items()},
        "duration": epsilon.duration,
        "correlation_times": epsilon.duration / epsilon.correlation_time,
        "k_max_eta": (cells - 1) // 3 * means["η"].value,
        "spectrum": spectrum[spectrum[:, 0] > 0].tolist(),
        "series": {"time": series["time"].tolist(), "dissipation": series["dissipation"].tolist()},
    }


def rows(result: dict) -> list[dict]:
    """The lines of a CSV file."""
    return [
        {"cells": run["cells"], "quantity": q} | mean
        for run in result["runs"]
        for q, mean in run["means"].items()
    ]


def table(result: dict) -> str:
    """A table in Markdown."""
    runs = result["runs"]
    head = ["", "paper, Table 1", *(f"{r['cells']}³" for r in runs)]
    lines = [f"| {' | '.join(head)} |", "|---" * len(head) + "|"]
    for q, (_, paper) in QUANTITIES.items():
        lines.append(f"| {q} | {paper} | {' | '.join(r['means'][q]['text'] for r in runs)} |")
    spans = [f"{r['duration']:.0f} = {r['correlation_times']:.0f} integral times of ε" for r in runs]
    lines.append(f"| time averaged | | {' | '.join(spans)} |")
    lines.append(f"| k_max η | | {' | '.join(format(r['k_max_eta'], '.2f') for r in runs)} |")
    return "\n".join(lines)


def draw(result: dict) -> Figure:
    """Dissipation in time, and compensated spectra."""
    figure = new_figure(10, 4)
    left, right = figure.subplots(1, 2)
    for r in result["runs"]:
        left.plot(r["series"]["time"], r["series"]["dissipation"], linewidth=0.8, label=f"{r['cells']}³")
        k, e = np.array(r["spectrum"]).T
        epsilon, eta = r["means"]["ε"]["mean"], r["means"]["η"]["mean"]
        kept = k <= (r["cells"] - 1) // 3
        right.loglog(
            k[kept] * eta, (e * k ** (5 / 3))[kept] / epsilon ** (2 / 3), ".-", label=f"{r['cells']}³"
        )
    left.set(xlabel="t", ylabel="ε", ylim=(0, None))
    right.axhline(1.6, color="k", linewidth=0.8, linestyle=":")
    right.set(xlabel="kη", ylabel=r"$E(k)\, k^{5/3} \varepsilon^{-2/3}$", ylim=(1e-2, 5))
    right.xaxis.set_minor_formatter(NullFormatter())
    for axes in (left, right):
        axes.legend()
    return figure
