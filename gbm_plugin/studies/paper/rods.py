"""How straight stiff fibers tumble, ⟨ṗ²⟩ν/ε, against theory and literature: a test of the whole chain.

Randomly oriented rods that are short against η have 1/6 + Λ²/10, Λ of their shape: 4/15 thin ones, 1/6 spheres. They
leave their random directions, line up with the vorticity, and settle near 0.09 (Parsa et al. 2012); the variance of
long ones falls as (L/η)^(−4/3) (Parsa & Voth 2014). ṗ² comes from the angles that end-to-end vectors turn between
records, extrapolated to no interval; families count as rods whose <R²>/L² is at least 0.99. The first value is that
of the first records, with the dissipation of that time: only of a run that began in developed turbulence is it one of
the theory. Beside it, where velocity fields are stored: the same of random rods at random places in these fields.
"""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure

from ...report.style import COLOURS, new_figure
from ...statistics.ensemble import fiber_average
from ...statistics.fibers import end_to_end_squared_ratio
from ...statistics.orientation import (
    AXES,
    alignments,
    bead_rod_shape,
    directions,
    first_tumbling,
    random_tumbling,
    rod_tumbling,
    tumbling,
)
from ..fields import fields_of
from ..recorded import TURNING, Family, FinishedRun, Since, add_run_arguments, finished_runs, flow_lines
from ..study import compact, option

SETTLED, SPHERES = 0.09, 1 / 6
STRAIGHT = 0.99  # <R²>/L² of a rod
SHORT, LONG = 10.0, 15.0  # L/η
RANDOM_RODS = 100_000
SHOWN = 5  # families whose course in time is drawn


def add_arguments(parser: argparse.ArgumentParser) -> None:
    add_run_arguments(parser, run)
    option(parser, run, "states", "stored velocity fields to take of each run, at most; 0: none")


def run(
    cases: Sequence[Path],
    since: Since = None,
    records: int = 0,
    families: Sequence[str] = (),
    states: int = 6,
) -> dict:
    """Tumbling of every family of rods at its first records and from `since` on, alignments, slope.

    records: 0 for all of them, since what lies between two is not known.
    """
    found, flows, kinematics, curves = [], [], [], []
    for finished in finished_runs(cases, since, records or 1 << 40, families):
        if not finished.turns:
            apart = finished.spacing / finished.flow.kolmogorov_time
            raise ValueError(
                f"{finished.case}: its records are {apart:.3g} Kolmogorov times apart, and tumbling needs "
                f"them at most {TURNING:g} apart: a smaller recordInterval"
            )
        flows.append(finished.summary())
        aligned = _aligned(finished, states, kinematics)
        for family in finished.followed():
            row, curve = _row(finished, family)
            if row:
                found.append(row | aligned.get(family.name, {}))
                curves.append(curve)
    if not found:
        raise ValueError(
            f"no family is straight: <R²>/L² is below {STRAIGHT:g} in all of {' '.join(map(str, cases))}"
        )
    return {"runs": flows, "rows": found, "fields": kinematics, "slope": _slope(found), "curves": curves}


def _row(finished: FinishedRun, family: Family) -> tuple[dict, dict]:
    first = np.arange(min(4, len(finished.even)))
    some = finished.rows[:: max(1, len(finished.rows) // 20)]
    (ratio,) = finished.measure(family, lambda x: end_to_end_squared_ratio(x, family.radius), rows=some)
    if ratio.mean() < STRAIGHT or family.beads < 3:
        return {}, {}
    flow, times = finished.flow, finished.recording.times[finished.even]
    unit = flow.viscosity / flow.dissipation.value
    (p,) = finished.measure(family, directions, rows=finished.even)
    spacing = float(np.diff(times).mean())
    whole = tumbling(p, spacing) if len(times) > 2 else np.zeros((0, family.count))
    late = whole[times[1:-1] >= finished.since]
    settled = fiber_average(late * unit) if len(late) else None
    coarse = fiber_average(tumbling(p[::2], 2 * spacing) * unit) if len(times) > 5 else None
    begin = first_tumbling(p[first], spacing) if len(first) == 4 else None
    shape = bead_rod_shape(family.beads)
    row = family.row() | {
        "L_over_eta": family.contour / flow.kolmogorov_length,
        "record_interval_over_tau": spacing / flow.kolmogorov_time,
        "R2_over_contour2": float(ratio.mean()),
        "tumbling_random_theory": random_tumbling(shape),
        "tumbling_settled": settled and settled.value,
        "standard_error": settled and settled.error,
        "tumbling_of_every_other_record": coarse and coarse.value,
    }
    if begin is not None:
        now = flow.viscosity / float(
            np.interp(times[0], finished.table["Time"], finished.table["epsilonBudget"])
        )
        row["tumbling_first"] = float(begin.mean() * now)
        row["tumbling_first_error"] = (
            float(begin.std(ddof=1) / np.sqrt(len(begin)) * now) if len(begin) > 1 else None
        )
    scale = np.interp(times[1:-1], finished.table["Time"], finished.table["epsilonBudget"])
    stride = max(1, len(whole) // 120)
    curve = {
        "run": family.run,
        "family": family.name,
        "L_over_eta": row["L_over_eta"],
        "time_over_tau": compact(((times[1:-1] - times[0]) / flow.kolmogorov_time)[::stride]),
        "tumbling": compact((whole.mean(axis=1) * flow.viscosity / scale)[::stride]),
    }
    return row, curve


def _aligned(finished: FinishedRun, states: int, kinematics: list[dict]) -> dict[str, dict]:
    """cos² of each family with the vorticity and the strain at its centres, in the stored fields; beside it, to
    `kinematics`, what random rods in them would do."""
    sums: dict[str, list] = {}
    random = np.random.default_rng(1)
    for field in fields_of(finished, states):
        places = field.origin + random.uniform(0, 1, (RANDOM_RODS, 3)) * field.box
        p = random.normal(size=places.shape)
        p /= np.linalg.norm(p, axis=-1, keepdims=True)
        gradient = field.gradient(places)
        unit = finished.flow.viscosity / field.dissipation
        kinematics.append(
            {
                "run": finished.label,
                "time": field.time,
                "rods": float((rod_tumbling(gradient, p) ** 2).sum(axis=-1).mean() * unit),
                "spheres": float((rod_tumbling(gradient, p, 0.0) ** 2).sum(axis=-1).mean() * unit),
            }
        )
        for family in finished.families:
            x = field.positions(family)
            if x.shape[1] > 2 and end_to_end_squared_ratio(x, family.radius).mean() >= STRAIGHT:
                g = field.gradient(x.mean(axis=1))
                sums.setdefault(family.name, []).append(alignments(directions(x), g))
    found = {}
    for name, parts in sums.items():
        found[name] = {
            f"along_{axis}": float(np.mean([part[axis].mean() for part in parts])) for axis in AXES
        }
        own = np.mean([part["vorticity"] for part in parts], axis=0)  # of each fiber
        found[name]["along_error"] = float(own.std(ddof=1) / np.sqrt(len(own))) if len(own) > 1 else None
    return found


def _slope(found: list[dict]) -> dict | None:
    """Of the settled variance against L/η, of long rods."""
    long = [r for r in found if r["L_over_eta"] >= LONG and r["tumbling_settled"]]
    x, y = (np.log([r[n] for r in long]) for n in ("L_over_eta", "tumbling_settled"))
    if len(set(np.round(x, 6))) < 3:
        return None
    (slope, _), covariance = np.polyfit(x, y, 1, cov="unscaled")
    own = np.array([(r["standard_error"] or 0) / r["tumbling_settled"] for r in long])
    rest = np.sqrt(((y - np.polyval(np.polyfit(x, y, 1), x)) ** 2).sum() / max(len(x) - 2, 1))
    error = np.sqrt(covariance[0, 0]) * max(rest, float(np.sqrt((own**2).mean())))
    return {"slope": float(slope), "error": float(error), "from_L_over_eta": LONG, "families": len(long)}


def rows(result: dict) -> list[dict]:
    """The lines of a CSV file: families, random rods in stored fields, the slope."""
    slope = [{"run": "slope"} | result["slope"]] if result["slope"] else []
    return [*result["rows"], *result["fields"], *slope]


def table(result: dict) -> str:
    """Values as text."""
    lines = flow_lines(result["runs"])
    width = max(len(f"{r['run']} {r['family']}") for r in result["rows"])
    lines.append(
        f"{'⟨ṗ²⟩ν/ε':{width}} {'L/η':>6} {'h/τ':>5} {'random':>7} {'first':>7} {'±':>6} {'settled':>8} {'±':>7} "
        f"{'2h':>7}  cos² with vorticity, stretching, middle, compression"
    )
    for r in result["rows"]:
        first, error = (r.get(name) for name in ("tumbling_first", "tumbling_first_error"))
        along = " ".join(f"{r[f'along_{axis}']:.3f}" for axis in AXES if f"along_{axis}" in r)
        lines.append(
            f"{r['run'] + ' ' + r['family']:{width}} {r['L_over_eta']:6.2f} {r['record_interval_over_tau']:5.2f} "
            f"{r['tumbling_random_theory']:7.4f} {_cell(first, 7, 4)} {_cell(error, 6, 3)} "
            f"{_cell(r['tumbling_settled'], 8, 4)} {_cell(r['standard_error'], 7, 4)} "
            f"{_cell(r['tumbling_of_every_other_record'], 7, 4)}  {along}"
        )
    for name in dict.fromkeys(f["run"] for f in result["fields"]):
        own = [f for f in result["fields"] if f["run"] == name]
        rods, spheres = (float(np.mean([f[n] for f in own])) for n in ("rods", "spheres"))
        lines.append(
            f"{name}: random rods in {len(own)} stored fields {rods:.4f} (theory 4/15 = 0.2667), spheres {spheres:.4f} "
            "(1/6 = 0.1667)"
        )
    if result["slope"]:
        s = result["slope"]
        lines.append(f"L/η ≥ {LONG:g}: variance ∝ (L/η)^({s['slope']:.2f} ± {s['error']:.2f}); theory −4/3")
    return "\n".join(lines)


def _cell(value: float | None, width: int, digits: int) -> str:
    return " " * width if value is None else f"{value:{width}.{digits}f}"


def draw(result: dict) -> Figure:
    """Tumbling since the start, settled values against L/η, alignments."""
    figure = new_figure(12.5, 3.9)
    left, middle, right = figure.subplots(1, 3)
    curves = sorted(result["curves"], key=lambda c: c["L_over_eta"])
    curves = [curves[i] for i in np.unique(np.linspace(0, len(curves) - 1, SHOWN).round().astype(int))]
    for number, curve in enumerate(curves):
        style = {"color": COLOURS[number % len(COLOURS)], "linewidth": 1}
        left.plot(
            curve["time_over_tau"], curve["tumbling"], label=f"L/η = {curve['L_over_eta']:.3g}", **style
        )
    left.axhline(4 / 15, color="k", linestyle="--", linewidth=1)
    left.axhline(SETTLED, color="k", linestyle=":", linewidth=1)
    left.set(xlabel="(t − t$_0$)/τ$_η$", ylabel="⟨ṗ²⟩ν/ε", ylim=(0, 0.3))
    left.legend(fontsize=7, ncols=2)
    shown = [r for r in result["rows"] if r["tumbling_settled"]]
    for number, name in enumerate(dict.fromkeys(r["run"] for r in shown)):
        own = [r for r in shown if r["run"] == name]
        x, y, e = (
            np.array([r[n] or 0 for r in own]) for n in ("L_over_eta", "tumbling_settled", "standard_error")
        )
        middle.errorbar(
            x, y, e, fmt="osD^"[number % 4], color=COLOURS[number % len(COLOURS)], label=name, markersize=5
        )
    if shown:
        x = np.array([r["L_over_eta"] for r in shown])
        level = max(shown, key=lambda r: r["L_over_eta"])
        guide = np.array([min(max(x.min(), 8), x.max()), x.max()])
        power = level["tumbling_settled"] * (guide / level["L_over_eta"]) ** (-4 / 3)
        middle.plot(guide, power, "k--", linewidth=1, label="(L/η)$^{−4/3}$")
        middle.axhline(SETTLED, color="k", linestyle=":", linewidth=1, label="0.09, Parsa et al. 2012")
    middle.set(xscale="log", yscale="log", xlabel="L/η", ylabel="settled ⟨ṗ²⟩ν/ε")
    middle.legend(fontsize=8)
    for number, axis in enumerate(AXES):
        own = sorted((r for r in result["rows"] if f"along_{axis}" in r), key=lambda r: r["L_over_eta"])
        x, y = ([r[n] for r in own] for n in ("L_over_eta", f"along_{axis}"))
        right.plot(x, y, "osD^"[number], markersize=4, color=COLOURS[number], label=axis)
    right.axhline(1 / 3, color="k", linewidth=1, linestyle=":")
    right.set(xlabel="L/η", ylabel="⟨cos²⟩ with", ylim=(0, 1))
    if any("along_vorticity" in r for r in result["rows"]):
        right.set_xscale("log")
        right.legend(fontsize=8)
    else:
        right.set_title("no stored fields from then on")
    return figure
