"""How straight fibers are against their length in persistence lengths, and what γ is: figure 10 of the paper.

<R²>/L² of each family with L/l_p, l_p = (K^b)^(1/4)/(μρε)^(1/8), and the worm-like chain of eq. (19) with γ fitted
inside the persistence length, as the text defines it. L is the contour length 2a(N−1) between the centres of the end
beads. Families whose l_p is shorter than a bead are left out. The fit is repeated with each choice changed that
somebody else may have made: normalisation, window, N, K^b, the estimate of ε, eq. (6) and eq. (19) as printed.
"""

from __future__ import annotations

import argparse
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from matplotlib import colormaps
from matplotlib.figure import Figure
from numpy.typing import NDArray

from ...report.style import COLOURS, MARKERS, new_figure
from ...statistics.ensemble import fiber_average, jackknife_error
from ...statistics.fibers import end_to_end_squared_ratio
from ...statistics.wormlike import (
    RANGE,
    Transition,
    fit,
    fit_transition,
    persistence_lengths,
    squared_ratio,
)
from ..recorded import Family, Since, add_run_arguments, finished_runs, flow_lines, same_flow

PAPER, EXPERIMENT = 3.0, 2.0
BENT = 5.0  # L/l_p from which a family is bent for sure
# L/l_p at which a free-draining fiber begins to buckle under compression at the rms longitudinal rate (ε/15ν)^(1/2):
# 3πμSL⁴/K^b = 123.5 (docs/results/buckling.md), l_p⁴ = K^b (ν/ε)^(1/2)/μ
BUCKLING = (123.5 * 15**0.5 / (3 * np.pi)) ** 0.25
NOT_BENT = 1 - 1e-9  # <R²>/L² from which rounding alone may differ from 1
LEAST = 1.0  # L/l_p of a family that can tell γ: below, it is a rod


def add_arguments(parser: argparse.ArgumentParser) -> None:
    add_run_arguments(parser, run)


@dataclass(frozen=True)
class Point:
    """A family in the fit: its <R²>/L² with error, and what else may be said of the same measurement."""

    family: Family
    ratio: float
    error: float
    gradient_factor: float  # of l_p, with ε from gradients
    forcing: str

    @property
    def fitted(self) -> bool:
        return self.family.resolved and LEAST <= self.family.stretch < np.inf

    @property
    def whole(self) -> float:
        """(N−1)/N: of lengths by 2aN."""
        return 1 - 1 / self.family.beads


def run(
    cases: Sequence[Path],
    since: Since = None,
    records: int = 400,
    families: Sequence[str] = (),
) -> dict:
    """<R²>/L² of all families of all runs, and γ with all its variants."""
    points, flows, measured = [], [], []
    for finished in finished_runs(cases, since, records, families):
        flows.append(finished.summary())
        gradient = finished.flow.gradient
        factor = (finished.flow.dissipation.value / gradient) ** 0.125 if gradient > 0 else 1.0
        for family in finished.followed():
            (values,) = finished.measure(family, lambda x, a=family.radius: end_to_end_squared_ratio(x, a))
            average = fiber_average(values)
            point = Point(family, average.value, average.error or 0.0, factor, finished.flow.forcing)
            points.append(point)
            lengths = {"L_over_eta": family.contour / finished.flow.kolmogorov_length}
            lengths["L_over_large"] = family.contour / finished.flow.large_length
            measured.append(_row(point) | lengths)
    fits = list(_fits([p for p in points if p.family.stiffness > 0]))
    return {
        "runs": flows,
        "rows": measured,
        "fits": fits,
        "transition": _transition(measured),
        "trend": _trend(measured),
        "twice": _twice(flows, measured),
    }


def _twice(flows: list[dict], measured: list[dict]) -> list[dict]:
    """Families that two runs of one flow have, by their name, length and stiffness: what two engines make of one
    fiber, and by how many standard errors they differ."""
    found = []
    for place, one in enumerate(flows):
        for other in flows[place + 1 :]:
            if not same_flow(one, other):
                continue
            second = {_fiber(r): r for r in measured if r["run"] == other["run"]}
            for r in measured:
                if r["run"] != one["run"] or _fiber(r) not in second or not r["fitted"]:
                    continue
                s = second[_fiber(r)]
                error = float(np.hypot(r["standard_error"], s["standard_error"]))
                off = s["R2_over_contour2"] - r["R2_over_contour2"]
                found.append(
                    {
                        "of": f"{other['run']} and {one['run']}",
                        "family": r["family"],
                        "difference": off,
                        "its_error": error,
                        "errors": off / error if error else None,
                    }
                )
    return found


def _fiber(row: dict) -> tuple:
    return row["family"], row["beads"], f"{row['length_2aN']:.6g}", row["bending_stiffness"]


def _transition(measured: list[dict]) -> dict | None:
    """What the families do instead: the curve that their buckling makes."""
    own = [r for r in measured if r["fitted"]]
    try:
        found = fit_transition([r["L_over_l_p"] for r in own], [r["R2_over_contour2"] for r in own])
    except ValueError:
        return None
    return {
        "plateau": found.plateau,
        "middle": found.middle,
        "steepness": found.steepness,
        "errors": list(found.errors),
        "scatter": found.scatter,
        "buckling_in_rms_strain": BUCKLING,
        "families": len(own),
    }


def _trend(measured: list[dict]) -> dict | None:
    """Exponents of γ ∝ (L/ℓ)^a (L/l_p)^b over the families that are bent, ℓ = u'³/ε: both 0 if eq. (19) with l_p were
    all. Errors by leaving out one family after the other; rms of ln γ, and what it is with η in the place of ℓ."""
    bent = [r for r in measured if r["fitted"] and r["gamma"] and r["L_over_l_p"] >= BENT]
    if len(bent) < 5:
        return None
    y = np.log([r["gamma"] for r in bent])

    def solve(scale: str, chosen: NDArray) -> tuple[NDArray, float]:
        x = np.array([[np.log(r[scale]), np.log(r["L_over_l_p"]), 1.0] for r in bent])
        found = np.linalg.lstsq(x[chosen], y[chosen], rcond=None)[0]
        return found[:2], float(np.sqrt(np.mean((y - x @ found) ** 2)))

    every = np.arange(len(y))
    error = jackknife_error([solve("L_over_large", every != i)[0] for i in every])
    whole, rms = solve("L_over_large", every >= 0)
    return {
        "families": len(bent),
        "exponent_of_L_over_large": float(whole[0]),
        "error_of_L_over_large": float(error[0]),
        "exponent_of_L_over_l_p": float(whole[1]),
        "error_of_L_over_l_p": float(error[1]),
        "rms": rms,
        "rms_with_eta": solve("L_over_eta", every >= 0)[1],
    }


def _row(point: Point) -> dict:
    family, ratio = point.family, point.ratio
    own = error = None
    if ratio < NOT_BENT and 0 < family.stretch < np.inf:
        own = family.stretch / persistence_lengths(ratio)
        above, below = (persistence_lengths(min(ratio + s * point.error, NOT_BENT)) for s in (0.5, -0.5))
        error = abs(family.stretch / above - family.stretch / below) if point.error else None
    return family.row() | {
        "R2_over_contour2": ratio,
        "standard_error": point.error,
        "R2_over_2aN2": ratio * point.whole**2,
        "gamma": own,
        "gamma_error": error,
        "fitted": point.fitted,
    }


def _fits(points: list[Point]) -> Iterator[dict]:
    """γ of all that was measured, and of its parts and variants."""
    usual = [p for p in points if p.fitted]
    yield from _fitted("all", usual)
    runs = list(dict.fromkeys(p.family.run for p in points))
    if len(runs) > 1:
        for name in runs:
            yield from _fitted(f"run {name}", [p for p in usual if p.family.run == name])
    forcings = list(dict.fromkeys(p.forcing for p in points))
    if len(forcings) > 1:
        for name in forcings:
            yield from _fitted(f"forcing {name}", [p for p in usual if p.forcing == name])
    yield from _fitted("lengths 2aN", usual, whole=True)
    yield from _fitted("L/l_p up to 5", [p for p in usual if p.family.stretch <= 5])
    yield from _fitted("L/l_p from 5 on", [p for p in usual if p.family.stretch >= 5])
    yield from _fitted("L/l_p from 5 to 10", [p for p in usual if 5 <= p.family.stretch < 10])
    yield from _fitted("L/l_p from 10 on", [p for p in usual if p.family.stretch >= 10])
    twins = _with_other_beads([p for p in points if LEAST <= p.family.stretch < np.inf])
    for beads in sorted({p.family.beads for p in twins}):
        yield from _fitted(f"N = {beads}, of one fiber", [p for p in twins if p.family.beads == beads])
    for stiffness in sorted({p.family.stiffness for p in usual}):
        yield from _fitted(f"K^b = {stiffness:g}", [p for p in usual if p.family.stiffness == stiffness])
    yield from _fitted("each family alike", usual, alike=True)
    yield from _fitted("with l_p < 2a", [p for p in points if LEAST <= p.family.stretch < np.inf])
    yield from _fitted("ε from gradients", usual, gradient=True)
    yield from _fitted("eq. (19) as printed, γ in front", usual, prefactor=True)
    for word in sorted({p.family.model.get("bendingTorque", "") for p in usual}):
        own = [p for p in usual if p.family.model.get("bendingTorque", "") == word]
        if len(own) < len(usual):
            yield from _fitted(f"bendingTorque {word}", own)
    whole = next(_fitted("all", usual), None)
    if whole:
        for name, power in (
            ("eq. (6) as printed, by algebra", 2**0.25),
            ("ε twice as large, by algebra", 2**0.125),
        ):
            error = whole["error"] and whole["error"] * power
            yield whole | {"variant": name, "gamma": whole["gamma"] * power, "error": error}
        for name, gamma in (("the paper's", PAPER), ("the experiment's", EXPERIMENT)):
            rms = _misfit(usual, gamma)
            yield {
                "variant": f"γ = {gamma:g}, {name}",
                "gamma": gamma,
                "error": None,
                "points": len(usual),
            } | {"scatter": rms}


def _with_other_beads(points: list[Point]) -> list[Point]:
    """Those of a fiber (length and K^b) that the same run has with other numbers of beads too."""
    found: dict[tuple, list[Point]] = {}
    for p in points:
        found.setdefault((p.family.run, f"{p.family.length:.6g}", p.family.stiffness), []).append(p)
    return [p for own in found.values() if len({p.family.beads for p in own}) > 2 for p in own]


def _fitted(
    variant: str,
    points: list[Point],
    whole: bool = False,
    gradient: bool = False,
    alike: bool = False,
    prefactor: bool = False,
) -> Iterator[dict]:
    if not points:
        return
    x = np.array([p.family.stretch / (p.whole if whole else 1) for p in points])
    x = x / np.array([p.gradient_factor for p in points]) if gradient else x
    y = np.array([p.ratio * (p.whole**2 if whole else 1) for p in points])
    e = np.array([p.error for p in points])
    found = fit(x, y, 0.1 * y if alike else e, prefactor)
    if not prefactor and not 1.01 * RANGE[0] < found.gamma < 0.99 * RANGE[1]:
        return  # all straight: any large γ is as good
    yield {
        "variant": variant,
        "gamma": found.gamma,
        "error": found.error,
        "scatter": found.scatter,
        "points": found.points,
    }


def _misfit(points: list[Point], gamma: float) -> float:
    """The rms of ln <R²>/L² from the curve of a γ."""
    off = [np.log(p.ratio / squared_ratio(p.family.stretch / gamma)) for p in points]
    return float(np.sqrt(np.mean(np.square(off))))


def rows(result: dict) -> list[dict]:
    """The lines of a CSV file: the families, then the fits."""
    trend = [{"run": "trend"} | result["trend"]] if result["trend"] else []
    own = result["transition"]
    transition = [{"run": "transition"} | {k: v for k, v in own.items() if k != "errors"}] if own else []
    fits = [{"run": "fit"} | line for line in result["fits"]]
    return [
        *result["rows"],
        *fits,
        *({"run": "twice"} | pair for pair in result["twice"]),
        *transition,
        *trend,
    ]


def table(result: dict) -> str:
    """Flows, families and fits as text."""
    lines = flow_lines(result["runs"])
    width = max(len(f"{r['run']} {r['family']}") for r in result["rows"])
    lines.append(f"{'family':{width}} {'L/l_p':>7} {'l_p/2a':>7} {'<R²>/L²':>9} {'±':>8} {'γ':>7} {'±':>6}")
    for r in result["rows"]:
        name = f"{r['run']} {r['family']}"
        stretch = f"{r['L_over_l_p']:7.3g}" if r["L_over_l_p"] is not None else "      ∞"
        own = "" if r["gamma"] is None else f"{r['gamma']:7.3g}"
        error = "" if r["gamma_error"] is None else f"{r['gamma_error']:6.2g}"
        lines.append(
            f"{name:{width}} {stretch} {r['l_p_over_2a']:7.3g} {r['R2_over_contour2']:9.4f} "
            f"{r['standard_error']:8.2g} {own:>7} {error:>6}{'' if r['fitted'] else '  not fitted'}"
        )
    lines += ["", f"{'γ of':34} {'γ':>7} {'±':>7} {'rms of ln':>10} {'families':>9}"]
    for line in result["fits"]:
        error = "" if line["error"] is None else f"{line['error']:7.2g}"
        lines.append(
            f"{line['variant']:34} {line['gamma']:7.3f} {error:>7} {line['scatter']:10.3f} {line['points']:9d}"
        )
    for name in dict.fromkeys(pair["of"] for pair in result["twice"]):
        own = np.array([p["errors"] for p in result["twice"] if p["of"] == name and p["errors"] is not None])
        lines.append(
            f"{name}: {len(own)} families, ⟨R²⟩/L² differs by {np.sqrt((own**2).mean()):.2f} standard errors (rms), by "
            f"{np.abs(own).max():.1f} at most, by {own.mean():+.2f} on average"
        )
    if t := result["transition"]:
        e = t["errors"]
        lines.append(
            f"⟨R²⟩/L² = P + (1 − P)/(1 + (L/x₀l_p)^n): P = {t['plateau']:.3f} ± {e[0]:.3f}, x₀ = {t['middle']:.2f} ± "
            f"{e[1]:.2f}, n = {t['steepness']:.1f} ± {e[2]:.1f}, rms of ln {t['scatter']:.3f}; a fiber in the rms "
            f"strain rate buckles from L/l_p = {t['buckling_in_rms_strain']:.2f} on"
        )
    if t := result["trend"]:
        lines.append(
            f"γ of the {t['families']} families with L/l_p ≥ {BENT:g} ∝ "
            f"(Lε/u'³)^({t['exponent_of_L_over_large']:.2f} ± "
            f"{t['error_of_L_over_large']:.2f}) (L/l_p)^({t['exponent_of_L_over_l_p']:.2f} ± "
            f"{t['error_of_L_over_l_p']:.2f}), rms of ln {t['rms']:.3f}; with L/η {t['rms_with_eta']:.3f}"
        )
    return "\n".join(lines)


def draw(result: dict) -> Figure:
    """Figure 10 of the paper, and the γ of each family."""
    figure = new_figure(9.5, 4.2)
    left, right = figure.subplots(1, 2, width_ratios=[1.35, 1])
    shown = [r for r in result["rows"] if r["L_over_l_p"] is not None and r["L_over_l_p"] >= LEAST]
    runs = list(dict.fromkeys(r["run"] for r in shown))
    stiffnesses = sorted({r["bending_stiffness"] for r in shown if r["fitted"]})
    shades = colormaps["viridis"](np.linspace(0, 0.92, max(len(stiffnesses), 2)))
    colours = dict(zip(stiffnesses, shades, strict=False))  # dark is soft
    for r in shown:
        style = {"color": colours.get(r["bending_stiffness"], "0.6"), "elinewidth": 1, "markersize": 5}
        style |= {
            "fmt": MARKERS[runs.index(r["run"]) % len(MARKERS)],
            "fillstyle": "full" if r["fitted"] else "none",
        }
        left.errorbar(r["L_over_l_p"], r["R2_over_contour2"], r["standard_error"], **style)
        if r["gamma"] is not None and r["gamma_error"] is not None and r["gamma_error"] < r["gamma"]:
            right.errorbar(r["L_over_l_p"], r["gamma"], r["gamma_error"], **style)
    x = np.geomspace(LEAST, max([60.0, *(r["L_over_l_p"] for r in shown if r["fitted"])]), 200)
    best = next((line for line in result["fits"] if line["variant"] == "all"), None)
    curves = [(PAPER, "--", "γ = 3 (paper)"), (EXPERIMENT, ":", "γ = 2 (its experiment)")]
    if best:
        error = f" ± {best['error']:.2g}" if best["error"] else ""
        curves = [(best["gamma"], "-", f"γ = {best['gamma']:.3g}{error}"), *curves]
    for gamma, line, label in curves:
        left.plot(x, squared_ratio(x / gamma), line, color="k", linewidth=1, label=label)
        right.axhline(gamma, linestyle=line, color="k", linewidth=1)
    if t := result["transition"]:
        own = Transition(t["plateau"], t["middle"], t["steepness"], tuple(t["errors"]), t["scatter"])
        left.plot(x, own(x), color=COLOURS[1], linewidth=1.4, label="straight, then a plateau")
        left.axvline(t["buckling_in_rms_strain"], color="0.6", linewidth=1, linestyle="-.")
    for name, colour in colours.items():
        left.plot([], [], "o", color=colour, markersize=5, label=f"K$^b$ = {name:g}")
    for place, name in enumerate(runs if len(runs) > 1 else []):
        left.plot([], [], MARKERS[place % len(MARKERS)], color="0.3", markersize=5, label=name)
    left.set(
        xscale="log", yscale="log", xlabel="L/l$_p$", ylabel="⟨R²⟩/L²", ylim=(0.05, 1.3), xlim=(x[0], x[-1])
    )
    left.legend(fontsize=7, loc="lower left", labelspacing=0.25)
    right.set(xscale="log", xlabel="L/l$_p$", ylabel="γ of each family", ylim=(0, 10), xlim=(x[0], x[-1]))
    return figure
