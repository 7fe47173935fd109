"""End-to-end distances and gyration radii: their densities against theory, and ⟨R²⟩ against L (figures 7 and 8).

The densities of figure 7 are those of the projected vector, R_{e,2D}, of which each fiber gives three; rigid rods have
(1/2)L⁻²(1 − R²/L²)^(−1/2) and Gaussian coils exp(−R²/⟨R²⟩)/⟨R²⟩. Goodness is the largest distance between the
distribution and that of the theory (Kolmogorov–Smirnov's D: 0 is perfect, 1 the worst). R_g/L is compared with
that of rods, δ_R = 1/√12, which is ((N + 1)/(12(N − 1)))^(1/2) for N beads and L = 2a(N−1), and of random walks,
δ_F = 1/√(6N). The slopes of figure 8 are those of ln⟨R²⟩ against ln L, both in η, of one K^b and of all.
"""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure
from numpy.typing import NDArray

from ...report.style import COLOURS, MARKERS, new_figure
from ...statistics.densities import density, distance_to
from ...statistics.ensemble import fiber_average, jackknife_error
from ...statistics.fibers import end_to_end, gyration_radius
from ..recorded import (
    Family,
    FinishedRun,
    Since,
    add_run_arguments,
    checked_bending,
    finished_runs,
    flow_lines,
)
from ..study import compact

BINS = 40


def add_arguments(parser: argparse.ArgumentParser) -> None:
    add_run_arguments(parser, run)


def run(
    cases: Sequence[Path],
    since: Since = None,
    records: int = 400,
    families: Sequence[str] = (),
) -> dict:
    """Means, goodness of both theories for each family, densities of all, slopes."""
    measured, densities, flows = [], [], []
    for finished in finished_runs(cases, since, records, families):
        flows.append(finished.summary())
        for family in finished.followed():
            if family.beads > 2:
                vectors, gyration = finished.measure(family, end_to_end, gyration_radius)
                row = _row(finished, family, vectors / family.contour, gyration / family.contour)
                measured.append(row)
                densities.append(_densities(family, vectors / family.contour, gyration / family.contour))
    checked_bending(measured, cases)
    return {"runs": flows, "rows": measured, "slopes": _slopes(measured), "densities": densities}


def projections(vectors: NDArray) -> NDArray:
    """R²_{2D} (..., 3) of vectors (..., 3): seen along x, y and z."""
    square = vectors**2
    return square.sum(axis=-1, keepdims=True) - square


def rigid(square: NDArray) -> NDArray:
    """Distribution of R²_{2D}/L² of randomly oriented rods."""
    return 1 - np.sqrt(1 - np.clip(square, 0, 1))


def _row(finished: FinishedRun, family: Family, vectors: NDArray, gyration: NDArray) -> dict:
    flat = projections(vectors)
    square = fiber_average((vectors**2).sum(axis=-1))
    size = fiber_average(gyration**2)
    rod = np.sqrt((family.beads + 1) / (12 * (family.beads - 1)))
    coil = 1 / np.sqrt(6 * family.beads)
    eta = finished.flow.kolmogorov_length
    # the three projections would be alike in isotropic turbulence
    sides = flat.mean(axis=(0, 1)) / flat.mean()
    return family.row() | {
        "resolved": family.resolved,
        "L_over_eta": family.contour / eta,
        "R2_over_eta2": square.value * (family.contour / eta) ** 2,
        "R2_over_contour2": square.value,
        "standard_error": square.error,
        "projections_differ_by": float(np.ptp(sides)),
        "D_rigid": distance_to(flat, rigid),
        "D_coil": distance_to(flat, lambda s: 1 - np.exp(-s / flat.mean())),
        "D_by_chance": _chance(flat),
        "gyration_over_contour": float(np.sqrt(size.value)),
        "gyration_error": None if size.error is None else float(size.error / (2 * np.sqrt(size.value))),
        "gyration_over_rod": float(np.sqrt(size.value) / rod),
        "gyration_over_coil": float(np.sqrt(size.value) / coil),
        "R2_over_Rg2": square.value / size.value,  # 12 (N − 1)/(N + 1) of rods, 6 of long random walks
    }


def _chance(flat: NDArray) -> float:
    """What D a perfect theory would have: that of as many independent values as there are fibers, D ≈ 0.87/√F. Fibers
    are not followed long enough to count more than once for sure."""
    return float(0.8687 / np.sqrt(flat.shape[1]))


def _densities(family: Family, vectors: NDArray, gyration: NDArray) -> dict:
    edges, flat = np.linspace(0, 1, BINS + 1), projections(vectors)
    own = np.linspace(0, 0.36, BINS + 1)
    return {
        "run": family.run,
        "family": family.name,
        "L_over_l_p": family.stretch if np.isfinite(family.stretch) else None,
        "beads": family.beads,
        "square": float(flat.mean()),
        "edges": compact(edges),
        "projected": compact(density(flat, edges)),
        "gyration_edges": compact(own),
        "gyration": compact(density(gyration, own)),
    }


def _slopes(measured: list[dict]) -> list[dict]:
    """Of ln<R²> against ln L: all resolved families of a run, of one K^b, stiff ones and long ones."""
    found = []
    for name in dict.fromkeys(r["run"] for r in measured):
        own = [r for r in measured if r["run"] == name and r["resolved"] and r["L_over_l_p"] is not None]
        groups = {"all": own}
        for stiffness in sorted({r["bending_stiffness"] for r in own}):
            groups[f"K^b = {stiffness:g}"] = [r for r in own if r["bending_stiffness"] == stiffness]
        groups["L/l_p < 3"] = [r for r in own if r["L_over_l_p"] < 3]
        groups["L/l_p ≥ 3"] = [r for r in own if r["L_over_l_p"] >= 3]
        for group, chosen in groups.items():
            x = np.log([r["L_over_eta"] for r in chosen])
            if len(set(np.round(x, 6))) < 3:
                continue
            y = np.log([r["R2_over_eta2"] for r in chosen])
            slope, error = _slope(x, y)
            found.append(
                {"run": name, "slope_of": group, "slope": slope, "error": error, "families": len(chosen)}
            )
    return found


def _slope(x: NDArray, y: NDArray) -> tuple[float, float]:
    """By least squares, with the error that leaving out one point after the other tells: the points do not lie on a
    line, and their own errors are smaller than that."""
    slope = np.polyfit(x, y, 1)[0]
    parts = [np.polyfit(np.delete(x, i), np.delete(y, i), 1)[0] for i in range(len(x))]
    return float(slope), float(jackknife_error(parts))


def rows(result: dict) -> list[dict]:
    """The lines of a CSV file: families, then slopes."""
    return [*result["rows"], *result["slopes"]]


def table(result: dict) -> str:
    """Means, goodness and slopes as text."""
    lines = flow_lines(result["runs"])
    width = max(len(f"{r['run']} {r['family']}") for r in result["rows"])
    lines.append(
        f"{'family':{width}} {'L/l_p':>7} {'L/η':>6} {'⟨R²⟩/L²':>8} {'±':>8} {'D rod':>6} {'D coil':>6} "
        f"{'chance':>6} {'Rg/rod':>7} {'Rg/coil':>7} {'R²/Rg²':>7}"
    )
    for r in result["rows"]:
        stretch = "      ∞" if r["L_over_l_p"] is None else f"{r['L_over_l_p']:7.3g}"
        lines.append(
            f"{r['run'] + ' ' + r['family']:{width}} {stretch} {r['L_over_eta']:6.1f} {r['R2_over_contour2']:8.4f} "
            f"{r['standard_error'] or 0:8.2g} {r['D_rigid']:6.3f} {r['D_coil']:6.3f} {r['D_by_chance']:6.3f} "
            f"{r['gyration_over_rod']:7.3f} {r['gyration_over_coil']:7.3f} {r['R2_over_Rg2']:7.2f}"
        )
    lines += ["", "slope of ln⟨R²⟩ against ln L"]
    lines += [
        f"    {s['run']} {s['slope_of']:<16} {s['slope']:.3f} ± {s['error']:.3f} ({s['families']} families)"
        for s in result["slopes"]
    ]
    return "\n".join(lines)


def draw(result: dict) -> Figure:
    """Figure 7, of the family that is nearest to rods and the most flexible one, and figure 8."""
    figure = new_figure(12.5, 7.0)
    upper, lower = figure.subplots(2, 3)
    pairs = list(zip(result["rows"], result["densities"], strict=True))
    soft = max(pairs, key=lambda p: -1 if p[0]["L_over_l_p"] is None else p[0]["L_over_l_p"])
    families = (min(pairs, key=lambda p: p[0]["D_rigid"]), soft)
    for axes, (row, own), kind in zip((upper, lower), families, ("rods", "coils"), strict=True):
        edges = np.array(own["edges"])
        axes[0].stairs(own["projected"], edges, color=COLOURS[0], label=f"{own['family']}, {own['run']}")
        s = np.linspace(0.001, 0.999, 400)
        axes[0].plot(s, 0.5 / np.sqrt(1 - s), "k--", linewidth=1, label="rods")
        axes[0].plot(s, np.exp(-s / own["square"]) / own["square"], "k:", linewidth=1, label="Gaussian coils")
        axes[0].set(xlabel="R²$_{2D}$/L²", ylabel="probability density", yscale="log", ylim=(1e-3, 30))
        axes[0].set_title(f"D from {kind}: {row['D_rigid' if kind == 'rods' else 'D_coil']:.3f}")
        axes[0].legend(fontsize=8)
        axes[1].stairs(own["gyration"], own["gyration_edges"], color=COLOURS[0])
        rod = np.sqrt((own["beads"] + 1) / (12 * (own["beads"] - 1)))
        for value, line, label in (
            (rod, "--", "rods of N beads"),
            (12**-0.5, "-.", "δ$_R$ = 1/√12"),
            ((6 * own["beads"]) ** -0.5, ":", "δ$_F$ = 1/√(6N)"),
        ):
            axes[1].axvline(value, linestyle=line, color="k", linewidth=1, label=label)
        axes[1].set(xlabel="R$_g$/L", ylabel="probability density")
        axes[1].legend(fontsize=8)
    runs = list(dict.fromkeys(r["run"] for r in result["rows"]))
    stiffnesses = sorted({r["bending_stiffness"] for r in result["rows"]})
    for r in result["rows"]:
        style = {"color": COLOURS[stiffnesses.index(r["bending_stiffness"]) % len(COLOURS)]}
        style |= {"marker": MARKERS[runs.index(r["run"]) % len(MARKERS)]}
        style |= {"fillstyle": "full" if r["resolved"] else "none", "linestyle": "", "markersize": 5}
        upper[2].plot(r["L_over_eta"], r["R2_over_eta2"], **style)
        lower[2].plot(r["L_over_eta"], r["R2_over_contour2"], **style)
    x = np.array([r["L_over_eta"] for r in result["rows"]])
    ends = np.array([x.min(), x.max()])
    upper[2].plot(ends, ends**2, "k--", linewidth=1, label="L²")
    whole = next((s for s in result["slopes"] if s["slope_of"] == "L/l_p ≥ 3"), None)
    if whole:
        own = [r for r in result["rows"] if r["run"] == whole["run"] and (r["L_over_l_p"] or 0) >= 3]
        level = np.exp(np.mean([np.log(r["R2_over_eta2"] / r["L_over_eta"] ** whole["slope"]) for r in own]))
        label = f"L/l$_p$ ≥ 3: slope {whole['slope']:.2f} ± {whole['error']:.2f}"
        upper[2].plot(ends, level * ends ** whole["slope"], "k-", linewidth=1, label=label)
    upper[2].set(xscale="log", yscale="log", xlabel="L/η", ylabel="⟨R²⟩/η²")
    upper[2].legend(fontsize=8)
    lower[2].set(xscale="log", yscale="log", xlabel="L/η", ylabel="⟨R²⟩/L²")
    return figure
