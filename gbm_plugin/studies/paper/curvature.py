"""Densities of the mean curvature, eq. (11): beads and time step (figure 2), collapse on l_p (figure 9).

Families that differ in their number of beads alone, and such that differ in their integrator, their time step or
their run alone, are compared: the distance between two densities is the mean by which κ̄ has to be moved to make one
of the other (1-Wasserstein), here in units of the mean κ̄ of the finest family; beside it is what chance alone makes
of it. The collapse is the mean distance between ln κ̄ of all pairs of families, before and after multiplication with
l_p = (K^b)^(1/4)/(μρε)^(1/8): 0.1 is a tenth of the curvature. Families whose l_p is shorter than a bead are left
out of it, and those that are straight (L/l_p < 3), whose curvature the flow's gradients make and not their buckling.
"""

from __future__ import annotations

import argparse
import itertools
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure
from numpy.typing import NDArray

from ...report.style import COLOURS, LINES, new_figure
from ...statistics.densities import density, mean_pairwise, own_noise, quantiles, wasserstein
from ...statistics.ensemble import fiber_average
from ...statistics.fibers import mean_curvature
from ..recorded import Family, Since, add_run_arguments, checked_bending, finished_runs, flow_lines, same_flow
from ..study import compact

BENT = 3.0  # L/l_p from which fibers buckle
BINS = 40


def add_arguments(parser: argparse.ArgumentParser) -> None:
    add_run_arguments(parser, run)


@dataclass(frozen=True)
class Sample:
    """The mean curvatures (T, F) [1/m] of a family; flow: a number that runs in the same flow have in common."""

    family: Family
    values: NDArray
    flow: int

    @property
    def method(self) -> tuple:
        """What moved it, beside its beads."""
        model = self.family.model
        names = ("integrator", "mobility", "bendingTorque", "curvatureLaw", "tolerance", "repulsion")
        return (self.family.run, self.family.time_step, *(model.get(name) for name in names))

    @property
    def fiber(self) -> tuple[float, float, int]:
        """What it is, beside its beads, and in which flow: the same in all runs of that flow."""
        return float(f"{self.family.length:.6g}"), self.family.stiffness, self.flow

    @property
    def collapses(self) -> bool:
        return self.family.resolved and BENT <= self.family.stretch < np.inf


def run(
    cases: Sequence[Path],
    since: Since = None,
    records: int = 400,
    families: Sequence[str] = (),
) -> dict:
    """Mean curvatures with errors, densities, and the distances between them."""
    samples, flows = [], []
    for finished in finished_runs(cases, since, records, families):
        flows.append(finished.summary())
        flow = next(i for i, earlier in enumerate(flows) if same_flow(earlier, flows[-1]))
        for family in finished.followed():
            if family.beads > 2:
                (values,) = finished.measure(family, lambda x, a=family.radius: mean_curvature(x, a))
                samples.append(Sample(family, values, flow))
    return {
        "runs": flows,
        "rows": [_row(s) for s in checked_bending(samples, cases)],
        "beads": _compared(samples, lambda s: (s.fiber, s.method), "beads"),
        "method": _compared(samples, lambda s: (s.fiber, s.family.beads), "method"),
        "collapse": _collapse([s for s in samples if s.collapses]),
        "densities": [_density(s) for s in samples if s.collapses],
    }


def _row(sample: Sample) -> dict:
    average = fiber_average(sample.values)
    return sample.family.row() | {
        "integrator": sample.family.model.get("integrator"),
        "time_step": sample.family.time_step,
        "mean_curvature": average.value,
        "standard_error": average.error,
        "mean_curvature_times_l_p": average.value * sample.family.persistence,
        "rms_over_mean": float(sample.values.std() / average.value) if average.value else None,
    }


def _compared(samples: list[Sample], alike, kind: str) -> list[dict]:
    """Of samples that are alike but in their beads, or their method, the distances to the last, the finest one."""
    found = []
    key = lambda s: repr(alike(s))  # noqa: E731 an order for tuples with None
    for _, group in itertools.groupby(sorted(samples, key=key), key=key):
        own = sorted(group, key=lambda s: s.family.beads if kind == "beads" else -(s.family.time_step or 0))
        if len(own) < 2:
            continue
        finest = own[-1]
        unit = finest.values.mean()
        for s in own:
            found.append(
                {
                    "of": kind,
                    "run": s.family.run,
                    "family": s.family.name,
                    "beads": s.family.beads,
                    "integrator": s.family.model.get("integrator"),
                    "time_step": s.family.time_step,
                    "against": f"{finest.family.run} {finest.family.name}",
                    "distance": wasserstein(s.values / unit, finest.values / unit),
                    "by_chance": float(
                        np.hypot(own_noise(s.values / unit), own_noise(finest.values / unit)) / 2**0.5
                    ),
                    "mean_over_finest": float(s.values.mean() / unit),
                    "density": _density(s),
                }
            )
    return found


def _collapse(samples: list[Sample]) -> dict | None:
    """Mean distances between all pairs, before and after; what chance makes; the widths of the densities."""
    if len(samples) < 2:
        return None
    logs = [np.log(np.maximum(s.values, 1e-12 / s.family.contour)) for s in samples]
    scaled = [log + np.log(s.family.persistence) for s, log in zip(samples, logs, strict=True)]
    by_length = [log + np.log(s.family.contour) for s, log in zip(samples, logs, strict=True)]
    k, length = (np.log([getattr(s.family, n) for s in samples]) for n in ("persistence", "contour"))
    means = np.array([np.median(log) for log in logs])
    design = np.stack([k, length, np.ones_like(k)], axis=1)
    slopes = np.linalg.lstsq(design, means, rcond=None)[0] if len(samples) > 3 else [np.nan] * 2
    return {
        "families": len(samples),
        "before": mean_pairwise(logs),
        "after": mean_pairwise(scaled),
        "with_L_instead": mean_pairwise(by_length),
        "by_chance": float(np.mean([own_noise(log) for log in logs])),
        "width": float(np.mean([q.std() for q in map(quantiles, logs)])),
        "exponent_of_l_p": _known(slopes[0]),  # −1 in a perfect collapse
        "exponent_of_L": _known(slopes[1]),  # 0
    }


def _known(value: float) -> float | None:
    return float(value) if np.isfinite(value) else None


def _density(sample: Sample) -> dict:
    """Of κ̄ l_p."""
    family = sample.family
    scale = family.persistence or family.contour
    top = float(np.quantile(sample.values, 0.998)) * scale
    edges = np.linspace(0, top, BINS + 1)
    return {
        "run": family.run,
        "family": family.name,
        "l_p": family.persistence,
        "bending_stiffness": family.stiffness,
        "centres": compact((edges[1:] + edges[:-1]) / 2),
        "density": compact(density(sample.values * scale, edges)),
    }


def rows(result: dict) -> list[dict]:
    """The lines of a CSV file: families, comparisons, the collapse."""
    compared = [{k: v for k, v in r.items() if k != "density"} for r in result["beads"] + result["method"]]
    collapse = [{"run": "collapse"} | result["collapse"]] if result["collapse"] else []
    return [*result["rows"], *compared, *collapse]


def table(result: dict) -> str:
    """Means, distances and the collapse as text."""
    lines = flow_lines(result["runs"])
    width = max(len(f"{r['run']} {r['family']}") for r in result["rows"])
    lines.append(f"{'family':{width}} {'L/l_p':>7} {'⟨κ̄⟩ [1/m]':>10} {'±':>8} {'⟨κ̄⟩ l_p':>8} {'rms/mean':>9}")
    for r in result["rows"]:
        stretch = "      ∞" if r["L_over_l_p"] is None else f"{r['L_over_l_p']:7.3g}"
        rms = "" if r["rms_over_mean"] is None else f"{r['rms_over_mean']:9.3g}"
        lines.append(
            f"{r['run'] + ' ' + r['family']:{width}} {stretch} {r['mean_curvature']:10.4g} "
            f"{r['standard_error'] or 0:8.2g} {r['mean_curvature_times_l_p']:8.3g} {rms}"
        )
    for kind, title in (("beads", "figure 2 (a), beads"), ("method", "figure 2 (b), time step and method")):
        if result[kind]:
            lines += ["", f"{title}: distance of densities, over the mean κ̄ of the finest"]
            lines += [
                f"    {r['run']} {r['family']:<20} N = {r['beads']:3d} {r['integrator'] or '':9} Δt = "
                f"{r['time_step'] or 0:<7g} {r['distance']:.4f}  by chance {r['by_chance']:.4f}  mean "
                f"{r['mean_over_finest']:.3f}  against {r['against']}"
                for r in result[kind]
            ]
    c = result["collapse"]
    if c:
        lines += [
            "",
            f"figure 9, {c['families']} families with L/l_p ≥ {BENT:g} and l_p ≥ 2a: mean distance of ln κ̄ of two "
            f"families {c['before']:.3f}, with l_p {c['after']:.3f}, with L instead {c['with_L_instead']:.3f} "
            f"(by chance {c['by_chance']:.3f}; width of one density {c['width']:.3f})",
        ]
        if c["exponent_of_l_p"] is not None:
            lines.append(
                f"    median κ̄ ∝ l_p^{c['exponent_of_l_p']:.2f} L^{c['exponent_of_L']:.2f}; a collapse has −1 and 0"
            )
    return "\n".join(lines)


def draw(result: dict) -> Figure:
    """Densities: of different beads, of different methods, of all families over l_p."""
    figure = new_figure(12.5, 3.9)
    panels = figure.subplots(1, 3)
    for axes, kind, title in ((panels[0], "beads", "N"), (panels[1], "method", "method")):
        group = _first(result[kind])
        for number, r in enumerate(group):
            label = (
                f"N = {r['beads']}"
                if kind == "beads"
                else f"{r['integrator']}, Δt = {r['time_step']:g}, {r['run']}"
            )
            style = {"color": COLOURS[number % len(COLOURS)], "linestyle": LINES[number % len(LINES)]}
            axes.plot(r["density"]["centres"], r["density"]["density"], label=label, **style)
        axes.set(xlabel="κ̄ l$_p$", ylabel="probability density", ylim=(0, None), title=_title(group, title))
        if group:
            axes.legend(fontsize=8)
    stiffnesses = sorted({d["bending_stiffness"] for d in result["densities"]})
    runs = list(dict.fromkeys(d["run"] for d in result["densities"]))
    for d in result["densities"]:
        place = stiffnesses.index(d["bending_stiffness"])
        label = f"K$^b$ = {d['bending_stiffness']:g}" if d is _one_of(result["densities"], d) else None
        line = LINES[runs.index(d["run"]) % len(LINES)]
        panels[2].plot(
            d["centres"],
            np.where(np.array(d["density"]) > 0, d["density"], np.nan),
            color=COLOURS[place % len(COLOURS)],
            linestyle=line,
            linewidth=1.2,
            label=label,
        )
    panels[2].set(xlabel="κ̄ l$_p$", yscale="log", ylim=(2e-2, 100), title="families with L/l$_p$ ≥ 3")
    if stiffnesses:
        panels[2].legend(fontsize=8, ncols=2, loc="upper right")
    return figure


def _first(compared: list[dict]) -> list[dict]:
    """The largest group with one finest member."""
    groups = [list(g) for _, g in itertools.groupby(compared, key=lambda r: r["against"])]
    return max(groups, key=len, default=[])


def _title(group: list[dict], kind: str) -> str:
    return f"{group[-1]['family']}: {kind}" if group else f"no families that differ in {kind} alone"


def _one_of(densities: list[dict], one: dict) -> dict:
    """The first of this stiffness: it has the label."""
    return next(d for d in densities if d["bending_stiffness"] == one["bending_stiffness"])
