"""What the cells of a flow do to the statistics of its fibers: the same families in the same flow, coarser and finer.

The runs begin with the same fibers in the same field and force, and part as turbulence does; they are compared with
the last one, the finest, at their common times from --from on. The error of a difference is that of the average of the
differences fiber by fiber, correlated in time and between fibers as they are (`ensemble`): what chance makes of it is
in it. ṗ²τ² is of straight families, by the τ of each run in that time.
"""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure
from numpy.typing import NDArray

from ...report.style import COLOURS, new_figure
from ...statistics.ensemble import fiber_average
from ...statistics.fibers import end_to_end_squared_ratio, mean_curvature
from ...statistics.orientation import directions, tumbling
from ..recorded import Family, FinishedRun
from ..study import steps

STRAIGHT = 0.99  # <R²>/L² of a family whose tumbling is compared
TITLES = {"R2": "⟨R²⟩/L²", "curvature": "⟨κ̄⟩L", "tumbling": "⟨ṗ²⟩τ²"}


def add_arguments(parser: argparse.ArgumentParser) -> None:
    text = "folders of the runs, the finest last"
    parser.add_argument("cases", nargs="+", type=Path, metavar="CASE", help=text)
    parser.add_argument("--from", dest="since", type=float, default=0.0, metavar="T", help="[s] (default: 0)")
    text = "families whose names match one of these patterns (default: all)"
    parser.add_argument("--families", nargs="+", default=(), metavar="PATTERN", help=text)


def run(cases: Sequence[Path], since: float = 0.0, families: Sequence[str] = ()) -> dict:
    """Averages of each run, and their differences to the finest. ValueError where the runs have not the same fibers, or
    hardly a time in common."""
    if len(cases) < 2:
        raise ValueError("two runs or more are needed to compare them")
    runs = [FinishedRun(case, since, 1 << 40, families) for case in cases]
    try:
        places = _common([r.times for r in runs])
        for r, own in zip(runs, places, strict=True):
            r.rows, r.times = r.rows[own], r.times[own]
        shapes = [[(f.name, f.count, f.beads) for f in r.families] for r in runs]
        if any(other != shapes[0] for other in shapes):
            raise ValueError(f"{' and '.join(map(str, cases))} have not the same families")
        found = []
        for number in steps(range(len(shapes[0])), len(shapes[0]), "families"):
            found += _compared(runs, number)
        return {"runs": [_span(r) for r in runs], "rows": found}
    finally:
        for r in runs:
            r.close()


def _common(times: list[NDArray]) -> list[NDArray]:
    """The places in each of the times that all have, to the rounding of many added steps."""
    keys = [np.rint(t / 1e-6).astype(np.int64) for t in times]
    both = keys[0]
    for other in keys[1:]:
        both = np.intersect1d(both, other)
    if len(both) < 4:
        raise ValueError(f"the runs have {len(both)} times of records in common; at least 4 are needed")
    return [np.searchsorted(k, both) for k in keys]


def _span(r: FinishedRun) -> dict:
    span = {"run": r.label, "from": float(r.times[0]), "to": float(r.times[-1]), "records": len(r.times)}
    return span | {"dissipation": _dissipation(r), "viscosity": r.flow.viscosity}


def _dissipation(r: FinishedRun) -> float:
    """ε in the time compared."""
    time, slack = r.table["Time"], 1e-9
    return float(
        r.table["epsilonBudget"][(time >= r.times[0] - slack) & (time <= r.times[-1] + slack)].mean()
    )


def _compared(runs: list[FinishedRun], number: int) -> list[dict]:
    values = [_values(r, r.families[number]) for r in runs]
    found = []
    for quantity in TITLES:
        if any(quantity not in v for v in values):
            continue
        finest = values[-1][quantity]
        for r, v in zip(runs, values, strict=True):
            average = fiber_average(v[quantity])
            row = {"quantity": quantity, "average": average.value, "standard_error": average.error}
            if r is not runs[-1]:
                apart = fiber_average(v[quantity] - finest)
                row |= {"difference": apart.value, "difference_error": apart.error}
            found.append(r.families[number].row() | row)
    return found


def _values(r: FinishedRun, family: Family) -> dict[str, NDArray]:
    """(T, F) each."""
    (ratio,) = r.measure(family, lambda x: end_to_end_squared_ratio(x, family.radius))
    found = {"R2": ratio}
    if family.beads > 2:
        (bent,) = r.measure(family, lambda x: mean_curvature(x, family.radius))
        found["curvature"] = bent * family.contour
        spacing = np.diff(r.times)
        if r.turns and ratio.mean() > STRAIGHT and np.ptp(spacing) < 1e-3 * spacing.mean():
            (p,) = r.measure(family, directions)
            found["tumbling"] = tumbling(p, float(spacing.mean())) * r.flow.viscosity / _dissipation(r)
    return found


def rows(result: dict) -> list[dict]:
    """The lines of a CSV file."""
    return result["rows"]


def table(result: dict) -> str:
    """Averages and differences as text."""
    lines = [
        f"{r['run']}: t = {r['from']:g} to {r['to']:g} s, {r['records']} records, ε = {r['dissipation']:.4g}"
        for r in result["runs"]
    ]
    width = max(len(f"{r['run']} {r['family']}") for r in result["rows"])
    lines.append(f"{'':{width}} {'quantity':>10} {'average':>9} {'±':>8} {'difference':>11} {'±':>8}")
    for r in result["rows"]:
        apart = f"{r['difference']:11.3g} {r['difference_error'] or 0:8.2g}" if "difference" in r else ""
        lines.append(
            f"{r['run'] + ' ' + r['family']:{width}} {r['quantity']:>10} {r['average']:9.4g} "
            f"{r['standard_error'] or 0:8.2g} {apart}"
        )
    for quantity, title in TITLES.items():
        scores = [_score(r) for r in result["rows"] if "difference" in r and r["quantity"] == quantity]
        if scores:
            rms = np.sqrt(np.mean(np.square(scores)))
            lines.append(f"{title}: differences over their errors, rms of {len(scores)}: {rms:.2f}")
    return "\n".join(lines)


def _score(row: dict) -> float:
    return row["difference"] / row["difference_error"] if row["difference_error"] else 0.0


def draw(result: dict) -> Figure:
    """Each quantity of the coarser runs over that of the finest, against L/l_p or, of rods, the length."""
    figure = new_figure(12.5, 3.9)
    for axes, (quantity, title) in zip(figure.subplots(1, 3), TITLES.items(), strict=True):
        own = [r for r in result["rows"] if r["quantity"] == quantity]
        finest = {r["family"]: r["average"] for r in own if "difference" not in r}
        for number, name in enumerate(dict.fromkeys(r["run"] for r in own if "difference" in r)):
            shown = [r for r in own if r["run"] == name and r["L_over_l_p"] and finest[r["family"]]]
            x = [r["length_2aN" if quantity == "tumbling" else "L_over_l_p"] for r in shown]
            y = [r["average"] / finest[r["family"]] for r in shown]
            e = [(r["difference_error"] or 0) / abs(finest[r["family"]]) for r in shown]
            axes.errorbar(x, y, e, fmt="osD^"[number % 4], color=COLOURS[number], markersize=4, label=name)
        axes.axhline(1, color="k", linewidth=0.8, linestyle=":")
        axes.set(
            xscale="log",
            xlabel="L [m]" if quantity == "tumbling" else "L/l$_p$",
            ylabel=f"{title} over the finest",
        )
        axes.legend(fontsize=7)
    return figure
