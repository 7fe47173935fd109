"""Table 1 of the paper beside finished runs of its flows, with standard errors and spectra.

A run is the folder of one (a case, or CASE/spectral), whose energies are in the table of its forcing and whose L,
skewness, flatness and E(k) come from the velocity fields that it stored; or what `gbm study flow-one` keeps, NAME.csv
with NAME_spectrum.csv beside it (and a column `box` where that is not 2π). It stands beside that flow of Table 1 whose
ε is nearest.
"""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure
from matplotlib.ticker import NullFormatter

from ...case.dictionary import Dictionary
from ...case.layout import time_folders, velocity_file
from ...case.mesh import read_box
from ...output.field import read_velocity
from ...output.tables import read_forcing
from ...report.style import new_figure
from ...statistics.ensemble import Estimate, fiber_average
from ...statistics.series import TimeSeries
from ...statistics.turbulence import energy_spectrum, field_statistics
from ..recorded import run_label
from ..study import option, steps

KEPT = tuple(Path(f"docs/results/spectral_flow_I_{n}.csv") for n in (64, 128))
# quantity: its name in the series, and what Table 1 says of Flow I and Flow II
QUANTITIES = {
    "ε": ("dissipation", "0.0015", "0.34"),
    "power": ("power", "", ""),
    "η": ("kolmogorov_length", "0.0286", "0.007"),
    "Re_λ": ("taylor_reynolds", "51", "97"),
    "λ": ("taylor_length", "0.23 (0.40 from its ν, ε, Re_λ)", "0.17 (0.143 from its ν, ε, Re_λ)"),
    "L = (π/2u'²)∫E/k dk": ("integral_length", "0.7", "0.7"),
    "u'": ("velocity_rms", "", ""),
    "u'³/ε": ("dissipation_length", "", ""),
    "skewness of ∂u/∂x": ("velocity_skewness", "", ""),
    "flatness of ∂u/∂x": ("velocity_flatness", "", ""),
}
SETTLED = (150.0, 20.0)  # the start of the averages of KEPT [s]
FLOWS = {"I": 0.0015, "II": 0.34}  # ε
TURNOVERS = 3.0  # L/u' without which no series has an error: the swing of less looks like a trend
OF_FIELDS = ("integral_length", "velocity_skewness", "velocity_flatness")


def add_arguments(parser: argparse.ArgumentParser) -> None:
    text = "folders of runs, or CSV files of gbm study flow-one (default: the kept ones of Flow I)"
    parser.add_argument("runs", nargs="*", type=Path, default=KEPT, metavar="RUN", help=text)
    option(parser, run, "settle", "start of the averages of each run [s]", nargs="+", type=float)
    option(parser, run, "states", "stored fields to take of each folder, at most")


def run(runs: Sequence[Path] = KEPT, settle: Sequence[float] = (), states: int = 24) -> dict:
    """Means with standard errors of every run. FileNotFoundError where there is none, ValueError where the starts of
    the averages are not one for each run; those of the kept runs are known."""
    if tuple(runs) == tuple(KEPT):
        settle = settle or SETTLED
    if len(settle) != len(runs):
        found = " ".join(Path(p).name for p in runs)
        raise ValueError(
            f"--settle has {len(settle)} numbers for {len(runs)} runs, {found}: give the start of the averages of each"
        )
    found = []
    for path, start in zip(runs, settle, strict=True):
        path = Path(path)
        if path.is_dir():
            found.append(_of_folder(path, start, states))
        elif path.is_file():
            found.append(_of_series(path, start))
        else:
            raise FileNotFoundError(f"there is neither a folder of a run nor a file {path}")
    return {"runs": found}


def _of_series(path: Path, settle: float) -> dict:
    """What `gbm study flow-one` keeps."""
    series, cells = TimeSeries.read(path), int(path.stem.rpartition("_")[2])
    late = series["time"] >= settle
    columns = {q: series[column][late] for q, (column, *_) in QUANTITIES.items()}
    spectrum = np.loadtxt(path.with_name(path.stem + "_spectrum.csv"), delimiter=",", skiprows=1)
    box = float(series["box"][0]) if "box" in series.columns else 2 * np.pi
    return _summary(path.stem, cells, series["time"][late], columns, spectrum, int(late.sum()), box)


def _of_folder(case: Path, settle: float, most: int) -> dict:
    """The table of the forcing, and the stored fields."""
    table, mesh = read_forcing(case), read_box(case)
    if mesh is None or len(set(mesh.cells)) > 1:
        raise ValueError(f"{case}: a cube of equal cells is needed")
    viscosity = Dictionary.read(case, "constant/transportProperties").number("nu", above=0)
    late = table["Time"] >= settle - 1e-9
    if late.sum() < 2:
        raise ValueError(f"{case} has fewer than two rows from t = {settle:g} on")
    epsilon, rms = table["epsilonBudget"][late], table["uPrime"][late]
    taylor = np.sqrt(15 * viscosity * rms**2 / epsilon)
    columns = {
        "dissipation": epsilon,
        "power": table["power"][late],
        "kolmogorov_length": (viscosity**3 / epsilon) ** 0.25,
        "taylor_reynolds": rms * taylor / viscosity,
        "taylor_length": taylor,
        "velocity_rms": rms,
        "dissipation_length": rms**3 / epsilon,
    }
    names = [
        name
        for time, name in sorted(time_folders(case).items())
        if time >= settle - 1e-9 and velocity_file(case / name)
    ]
    if len(names) > most:
        names = [names[i] for i in np.linspace(0, len(names) - 1, most).round().astype(int)]
    fields, spectra = {name: [] for name in OF_FIELDS}, []
    for name in steps(names, len(names), f"{case}: fields"):
        u = read_velocity(case, name, mesh.cells)
        values = field_statistics(u, mesh.size, viscosity)
        for column, found in fields.items():
            found.append(values[column])
        k, e = energy_spectrum(u, mesh.size)
        spectra.append(e)
    columns |= {name: np.array(values) for name, values in fields.items() if values}
    spectrum = np.column_stack([k, np.mean(spectra, axis=0)]) if spectra else np.zeros((0, 2))
    own = {q: columns[column] for q, (column, *_) in QUANTITIES.items() if column in columns}
    return _summary(
        run_label(case), mesh.cells[0], table["Time"][late], own, spectrum, len(names), mesh.size[0]
    )


def _summary(name, cells, times, columns, spectrum, fields, box=2 * np.pi) -> dict:
    """Means with errors of the columns, which are equidistant in time each."""
    means = {q: fiber_average(values[:, None]) for q, values in columns.items()}
    epsilon, spacing = means["ε"], float(np.diff(times).mean())
    duration = float(times[-1] - times[0]) + spacing
    length = means.get("L = (π/2u'²)∫E/k dk", means["u'³/ε"]).value
    turnovers = duration * means["u'"].value / length
    if turnovers < TURNOVERS:
        means = {q: replace(m, error=None, correlation_time=None) for q, m in means.items()}
        epsilon = means["ε"]
    correlation = None if epsilon.correlation_time is None else epsilon.correlation_time * spacing
    thin = slice(None, None, max(1, len(times) // 2000))
    return {
        "name": name,
        "cells": cells,
        "box": box,
        "beside": min(FLOWS, key=lambda flow: abs(np.log(epsilon.value / FLOWS[flow]))),
        "means": {
            q: {"mean": m.value, "standard_error": m.error, "text": _text(m)} for q, m in means.items()
        },
        "duration": duration,
        "turnovers": turnovers,
        "correlation_times": correlation and duration / correlation,
        "fields": fields,
        "k_max_eta": (cells - 1) // 3 * 2 * np.pi / box * means["η"].value,
        "spectrum": spectrum[spectrum[:, 0] > 0].tolist(),
        "series": {"time": times[thin].tolist(), "dissipation": columns["ε"][thin].tolist()},
    }


def _text(mean: Estimate) -> str:
    return str(mean) if mean.error else f"{mean.value:.4g} (too short)"


def rows(result: dict) -> list[dict]:
    """The lines of a CSV file."""
    return [
        {"run": run["name"], "cells": run["cells"], "quantity": q}
        | {n: mean[n] for n in ("mean", "standard_error")}
        for run in result["runs"]
        for q, mean in run["means"].items()
    ]


def table(result: dict) -> str:
    """A table in Markdown."""
    columns = []
    for number, flow in enumerate(FLOWS, start=1):
        own = [r for r in result["runs"] if r["beside"] == flow]
        if own:
            columns.append([f"paper, flow {flow}", *(q[number] for q in QUANTITIES.values()), *[""] * 3])
            columns += [_column(r) for r in own]
    heads = ["", *QUANTITIES, "time averaged", "fields", "k_max η"]
    lines = [f"| {' | '.join(row)} |" for row in zip(heads, *columns, strict=True)]
    return "\n".join([lines[0], "|---" * (len(columns) + 1) + "|", *lines[1:]])


def _column(r: dict) -> list[str]:
    span = f"{r['duration']:.4g} = {r['turnovers']:.3g} L/u'"
    if r["correlation_times"]:
        span += f" = {r['correlation_times']:.0f} integral times of ε"
    box = "" if abs(r["box"] - 2 * np.pi) < 1e-6 else f", box {r['box']:g}"
    means = [r["means"].get(q, {}).get("text", "") for q in QUANTITIES]
    return [f"{r['cells']}³{box}", *means, span, str(r["fields"]), f"{r['k_max_eta']:.2f}"]


def draw(result: dict) -> Figure:
    """Dissipation in time, and compensated spectra."""
    figure = new_figure(10, 4)
    left, right = figure.subplots(1, 2)
    for r in result["runs"]:
        label = f"{r['name']}, {r['cells']}³"
        left.plot(r["series"]["time"], r["series"]["dissipation"], linewidth=0.8, label=label)
        if not r["spectrum"]:
            continue
        k, e = np.array(r["spectrum"]).T
        epsilon, eta = r["means"]["ε"]["mean"], r["means"]["η"]["mean"]
        kept = k <= r["k_max_eta"] / eta
        right.loglog(k[kept] * eta, (e * k ** (5 / 3))[kept] / epsilon ** (2 / 3), ".-", label=label)
    left.set(xlabel="t", ylabel="ε", ylim=(0, None))
    right.axhline(1.6, color="k", linewidth=0.8, linestyle=":")
    right.set(xlabel="kη", ylabel=r"$E(k)\, k^{5/3} \varepsilon^{-2/3}$", ylim=(1e-2, 5))
    right.xaxis.set_minor_formatter(NullFormatter())
    for axes in (left, right):
        axes.legend()
    return figure
