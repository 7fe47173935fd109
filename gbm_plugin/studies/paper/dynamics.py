"""How fibers move in turbulence: memory, tumbling, buckling, self-contact, alignment, where they are.

Per family: integral times of the end-to-end vector and of the mean curvature; ⟨ṗ²⟩ of the end-to-end direction; rate at
which straight fibers buckle (R/L falls below 0.8, per unit of the time spent above it); share of the time in which a
fiber touches itself, beads at least three links apart nearer than 2a, and in which it is folded over one bead (two
links apart). At the velocity fields that the run stored: cos² between the end-to-end vector and the vorticity and the
strain's axes at the centre, and the mean ω² and S² at the beads over those at random places, where
tracers have 1.
"""

from __future__ import annotations

import argparse
from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure
from numpy.typing import NDArray

from ...report.style import COLOURS, MARKERS, new_figure
from ...statistics.contacts import closest_approach
from ...statistics.ensemble import correlation, fiber_average, integral_scale
from ...statistics.fibers import end_to_end, mean_curvature
from ...statistics.orientation import AXES, alignments, directions, tumbling, vorticity
from ..fields import fields_of
from ..recorded import Family, FinishedRun, Since, add_run_arguments, finished_runs, flow_lines
from ..study import compact, option

STRAIGHT = 0.8  # R/L, the paper's limit of buckling
SHOWN = 200.0  # L/l_p, beyond which a family is not drawn
TRACERS = 200_000  # random places, of which the box's means are those
LAGS = 60  # kept of a correlation


def add_arguments(parser: argparse.ArgumentParser) -> None:
    add_run_arguments(parser, run)
    option(parser, run, "states", "stored velocity fields to take of each run, at most; 0: none")


def run(
    cases: Sequence[Path],
    since: Since = None,
    records: int = 600,
    families: Sequence[str] = (),
    states: int = 12,
) -> dict:
    """A row for each family, and its correlations."""
    found, curves, flows, fields = [], [], [], []
    for finished in finished_runs(cases, since, records, families):
        flows.append(finished.summary())
        sampled, taken = _sampled(finished, states)
        fields.append({"run": finished.label, "fields": taken})
        for family in finished.followed():
            row = family.row() | {"L_over_eta": family.contour / finished.flow.kolmogorov_length}
            if family.beads > 2:
                own, curve = _moved(finished, family)
                row |= own
                curves.append(curve)
            found.append(row | sampled.get(family.name, {}))
    return {"runs": flows, "fields": fields, "rows": found, "curves": curves}


def _moved(finished: FinishedRun, family: Family) -> tuple[dict, dict]:
    """What positions alone tell."""
    diameter, tau = 2 * family.radius, finished.flow.kolmogorov_time
    vectors, bent, near, folded = finished.measure(
        family,
        end_to_end,
        lambda x: mean_curvature(x, family.radius),
        lambda x: closest_approach(x, 3) < diameter,
        lambda x: _folded(x) < diameter,
    )
    most = len(vectors) // 2
    memory = correlation(vectors, most)
    bending = correlation((bent - bent.mean())[..., None], most)
    row = {
        "record_interval_over_tau": finished.spacing / tau,
        "time_of_R_over_tau": integral_scale(memory) * finished.spacing / tau,
        "time_of_curvature_over_tau": integral_scale(bending) * finished.spacing / tau,
    }
    p = vectors / np.linalg.norm(vectors, axis=-1, keepdims=True)
    if finished.turns and len(p) > 2:
        row |= _averaged("tumbling", tumbling(p, finished.spacing) * tau**2)
    row |= _averaged("self_contact", near) | _averaged("folded", folded)
    row |= _rate(
        "buckling", np.linalg.norm(vectors, axis=-1) / family.contour < STRAIGHT, finished.spacing / tau
    )
    row |= _rate("contact", near, finished.spacing / tau)
    stride = max(1, most // LAGS)
    curve = {
        "run": family.run,
        "family": family.name,
        "L_over_l_p": _number(family.stretch),
        "lag_over_tau": compact((np.arange(most + 1) * finished.spacing / tau)[::stride]),
        "R": compact(memory[::stride]),
        "curvature": compact(bending[::stride]),
    }
    return row, curve


def _number(value: float) -> float | None:
    """A number for JSON, which has none that is infinite."""
    return float(value) if np.isfinite(value) else None


def _folded(positions: NDArray) -> NDArray:
    """Smallest distance between beads that are exactly two links apart."""
    return np.linalg.norm(positions[..., 2:, :] - positions[..., :-2, :], axis=-1).min(axis=-1)


def _averaged(name: str, values: NDArray) -> dict:
    average = fiber_average(values)
    return {name: average.value, f"{name}_error": average.error}


def _rate(name: str, state: NDArray, interval: float) -> dict:
    """How often the state (T, F) is entered, per time spent out of it; the error is that of a ratio of sums over
    fibers."""
    entered = (state[1:] & ~state[:-1]).sum(axis=0).astype(float)
    outside = (~state[:-1]).sum(axis=0) * interval
    if not outside.sum():
        return {
            f"{name}_events": int(entered.sum()),
            f"{name}_rate_times_tau": None,
            f"{name}_rate_error": None,
        }
    rate = entered.sum() / outside.sum()
    fibers = len(entered)
    spread = np.sqrt(((entered - rate * outside) ** 2).sum() * fibers / max(fibers - 1, 1)) / outside.sum()
    return {
        f"{name}_events": int(entered.sum()),
        f"{name}_rate_times_tau": float(rate),
        f"{name}_rate_error": float(spread),
    }


def _sampled(finished: FinishedRun, states: int) -> tuple[dict[str, dict], int]:
    """Alignments at the centres, ω² and S² at the beads, of each family by its name; and in how many fields."""
    sums: dict[str, list[dict[str, NDArray]]] = {}
    taken = 0
    for field in fields_of(finished, states):
        taken += 1
        enstrophy, strain = (float(part.mean()) for part in _squares(field.at_random(TRACERS)))
        for family in finished.families:
            x = field.positions(family)
            part = _at_beads(field.gradient, x, enstrophy, strain)
            if family.beads > 2:
                part |= {
                    f"along_{a}": v
                    for a, v in alignments(directions(x), field.gradient(x.mean(axis=1))).items()
                }
            sums.setdefault(family.name, []).append(part)
    found = {}
    for name, parts in sums.items():
        found[name] = {}
        for quantity in parts[0]:
            found[name] |= _averaged(quantity, np.stack([part[quantity] for part in parts]))
    return found, taken


def _at_beads(gradient: Callable, positions: NDArray, enstrophy: float, strain: float) -> dict[str, NDArray]:
    """Means over the beads of each fiber (F,)."""
    omega2, s2 = _squares(gradient(positions))
    return {
        "enstrophy_over_box": (omega2 / enstrophy).mean(axis=-1),
        "strain_over_box": (s2 / strain).mean(axis=-1),
        "in_vortices": (omega2 > 2 * s2).mean(axis=-1),
    }


def _squares(gradient: NDArray) -> tuple[NDArray, NDArray]:
    """ω² and S_ij S_ij (...) [1/s²]."""
    symmetric = (gradient + gradient.swapaxes(-1, -2)) / 2
    return (vorticity(gradient) ** 2).sum(axis=-1), (symmetric**2).sum(axis=(-1, -2))


def rows(result: dict) -> list[dict]:
    """The lines of a CSV file."""
    return result["rows"]


def table(result: dict) -> str:
    """The rows as text; times in Kolmogorov times."""
    lines = flow_lines(result["runs"])
    lines += [f"{f['run']}: {f['fields']} stored fields" for f in result["fields"]]
    width = max(len(f"{r['run']} {r['family']}") for r in result["rows"])
    head = f"{'family':{width}} {'L/l_p':>7} {'T_R':>6} {'T_κ':>6} {'⟨ṗ²⟩τ²':>8} {'buckling':>9} {'±':>7}"
    lines.append(f"{head} {'contact':>8} {'±':>7} {'folded':>7}  cos²: {' '.join(AXES)}; ω², S² over the box")
    for r in result["rows"]:
        cells = [
            _cell(r["L_over_l_p"], 7, "g"),
            _cell(r.get("time_of_R_over_tau"), 6, ".1f"),
            _cell(r.get("time_of_curvature_over_tau"), 6, ".1f"),
            _cell(r.get("tumbling"), 8, ".4f"),
            _cell(r.get("buckling_rate_times_tau"), 9, ".4f"),
            _cell(r.get("buckling_rate_error"), 7, ".4f"),
            _cell(r.get("self_contact"), 8, ".4f"),
            _cell(r.get("self_contact_error"), 7, ".4f"),
            _cell(r.get("folded"), 7, ".4f"),
            " ".join(_cell(r.get(f"along_{axis}"), 6, ".3f") for axis in AXES),
            _cell(r.get("enstrophy_over_box"), 6, ".3f"),
            _cell(r.get("strain_over_box"), 6, ".3f"),
        ]
        lines.append(f"{r['run'] + ' ' + r['family']:{width}} {' '.join(cells)}")
    return "\n".join(lines)


def _cell(value: float | None, width: int, form: str) -> str:
    if value is None:
        return " " * width
    return f"{value:{width}.3g}" if form == "g" else f"{value:{width}{form}}"


def draw(result: dict) -> Figure:
    """Correlations, their times, buckling, contact, alignment, sampling."""
    figure = new_figure(12.5, 7.2)
    panels = figure.subplots(2, 3)
    curves = sorted(
        (c for c in result["curves"] if c["L_over_l_p"] is not None), key=lambda c: c["L_over_l_p"]
    )
    for number, place in enumerate(np.unique(np.linspace(0, len(curves) - 1, 5).round().astype(int))):
        if curves:
            c = curves[place]
            label = f"L/l$_p$ = {c['L_over_l_p']:.2g}"
            panels[0, 0].plot(c["lag_over_tau"], c["R"], color=COLOURS[number], label=label)
            panels[0, 0].plot(c["lag_over_tau"], c["curvature"], ":", color=COLOURS[number])
    panels[0, 0].set(xlabel="lag/τ$_η$", title="R (lines), mean curvature (dots)", ylabel="correlation")
    panels[0, 0].axhline(0, color="k", linewidth=0.7)
    if curves:
        panels[0, 0].legend(fontsize=8)
    bent = [r for r in result["rows"] if r["L_over_l_p"] is not None and r["L_over_l_p"] < SHOWN]
    _scatter(panels[0, 1], bent, "L_over_l_p", "time_of_R_over_tau", "L/l$_p$", "integral time of R/τ$_η$")
    _scatter(panels[0, 2], bent, "L_over_l_p", "buckling_rate_times_tau", "L/l$_p$", "buckling rate × τ$_η$")
    _scatter(panels[1, 0], bent, "L_over_l_p", "self_contact", "L/l$_p$", "share of time in self-contact")
    for number, axis in enumerate(AXES):
        own = [r for r in result["rows"] if r.get(f"along_{axis}") is not None]
        x, y = ([r[n] for r in own] for n in ("L_over_eta", f"along_{axis}"))
        panels[1, 1].plot(x, y, MARKERS[number], color=COLOURS[number], markersize=4, label=axis)
    panels[1, 1].axhline(1 / 3, color="k", linewidth=1, linestyle=":")
    panels[1, 1].set(xlabel="L/η", ylabel="⟨cos²⟩ of R with", ylim=(0, 1))
    for number, (name, label) in enumerate((("enstrophy_over_box", "ω²"), ("strain_over_box", "S²"))):
        own = [r for r in result["rows"] if r.get(name) is not None]
        style = {
            "fmt": MARKERS[number],
            "color": COLOURS[number],
            "markersize": 4,
            "label": label,
            "elinewidth": 1,
        }
        x, y, e = ([r[n] or 0 for r in own] for n in ("L_over_eta", name, f"{name}_error"))
        panels[1, 2].errorbar(x, y, e, **style)
    panels[1, 2].axhline(1, color="k", linewidth=1, linestyle=":")
    panels[1, 2].set(xlabel="L/η", ylabel="mean at beads over that of the box")
    for axes in panels[1, 1:]:
        if any(r.get("along_vorticity") is not None for r in result["rows"]):
            axes.set_xscale("log")
            axes.legend(fontsize=8)
        else:
            axes.set_title("no stored fields from then on")
    return figure


def _scatter(axes, own: list[dict], x: str, y: str, xlabel: str, ylabel: str) -> None:
    """A point for each family, a colour for each K^b, open where l_p < 2a."""
    own = [r for r in own if r.get(y) is not None]
    stiffnesses = sorted({r["bending_stiffness"] for r in own if r["l_p_over_2a"] >= 1})
    runs = list(dict.fromkeys(r["run"] for r in own))
    for r in own:
        resolved = r["l_p_over_2a"] >= 1
        colour = COLOURS[stiffnesses.index(r["bending_stiffness"]) % len(COLOURS)] if resolved else "0.6"
        style = {"marker": MARKERS[runs.index(r["run"]) % len(MARKERS)], "linestyle": "", "markersize": 5}
        axes.plot(r[x], r[y], color=colour, fillstyle="full" if resolved else "none", **style)
    axes.set(xlabel=xlabel, ylabel=ylabel, ylim=(0, None))
    if own:
        axes.set_xscale("log")
