"""Every quantitative sentence of sections 2.3, 4 and 5 and of tables 1 and 2 beside what the studies of runs measured.

Reads the JSON files that `gbm study turbulence CASE [CASE ...] --into FOLDER` wrote. No data point of the paper's
figures is in its text, and none is invented: a sentence about data that is not there is answered with that. Of several
runs, those of a dissipation near 0.0015 are Flow I and those near 0.34 Flow II.
"""

from __future__ import annotations

import argparse
import json
from collections.abc import Iterator
from pathlib import Path

import numpy as np

from ...scales import kolmogorov_length
from ...statistics.wormlike import Transition, squared_ratio
from ..study import option

FILES = ("persistence", "curvature", "end-to-end", "shapes", "dynamics")
FLOWS = {"I": (0.0015, 51, 0.0286), "II": (0.34, 97, 0.007)}  # ε, Re_λ, η
LARGE = 0.7  # L_g of Table 1
RARE = 0.01  # share of the time that is rare
DIFFERENT = 2.0  # standard errors, or so many times what chance makes


def add_arguments(parser: argparse.ArgumentParser) -> None:
    option(parser, run, "folder", "of the JSON files", type=Path)


def run(folder: Path = Path("docs/results/turbulence")) -> dict:
    """Claim, measured value and verdict, in the order of the text. OSError where a file is not there."""
    data = {name: json.loads((Path(folder) / f"{name}.json").read_text()) for name in FILES}
    flows = {f: [r for r in data["persistence"]["runs"] if _is(r, f)] for f in FLOWS}
    found = [
        *_steps(data["curvature"]),
        *_beads(data["curvature"]),
        *_tables(flows, data["persistence"]),
        *_shapes(data["shapes"]),
        *_densities(data["end-to-end"]),
        *_slopes(data["end-to-end"]),
        *_collapse(data["curvature"]),
        *_gamma(data["persistence"], flows),
        *_contact(data["dynamics"]),
        *_straightening(data["curvature"]),
    ]
    return {"rows": found}


def _is(run: dict, flow: str) -> bool:
    return 0.5 < run["dissipation"] / FLOWS[flow][0] < 2


def _verdict(claim: str, measured: str, agrees: bool | str) -> dict:
    return {"claim": claim, "measured": measured, "agrees": {True: "yes", False: "no"}.get(agrees, agrees)}


def _steps(curvature: dict) -> Iterator[dict]:
    yield _verdict(
        "Δt < μ(2a)⁴/K^b, eq. (10), is what the integration of the fibers needs",
        f"the fastest mode decays at 0.206 K^b/(μ(2a)⁴) (0.412 with eq. (6) as printed), AB3 is stable to 6/11: "
        f"Δt may be {6 / 11 / 0.206:.1f} (or {6 / 11 / 0.412:.1f}) times that",
        "yes, it is safe",
    )
    groups: dict[str, list[dict]] = {}
    for r in curvature["method"]:
        groups.setdefault(r["against"], []).append(r)
    several = [g for g in groups.values() if len({r["integrator"] for r in g}) > 1]
    if several:
        own = [r for r in max(several, key=len) if r["distance"] > 0]
        text = "; ".join(
            f"{r['run']} {r['family']} ({r['integrator']}, Δt = {r['time_step']:g}) is {r['distance']:.3f} of the mean "
            f"curvature from {r['against']}, {r['by_chance']:.3f} by chance"
            for r in own
        )
        needed = any(r["distance"] > DIFFERENT * r["by_chance"] for r in own)
        yield _verdict(
            "a time step of δ_CFL/20 or lower is recommended (figure 2 b)", text, needed or "not needed"
        )


def _beads(curvature: dict) -> Iterator[dict]:
    groups: dict[str, dict] = {}
    for r in curvature["beads"]:
        groups.setdefault(r["against"], {})[r["beads"]] = r
    own = next((g for g in groups.values() if {10, 20, 40, 80} <= g.keys()), None)
    if own is None:
        return
    text = "N = {beads}: {distance:.3f} of the mean curvature from N = 80, {by_chance:.3f} by chance, mean "
    text += "{mean_over_finest:.2f} of that of N = 80"
    small = own[10]
    off = small["distance"] > DIFFERENT * small["by_chance"] and small["mean_over_finest"] > 1
    yield _verdict("ten beads are too few: small curvatures are less probable", text.format(**small), off)
    close = all(own[n]["distance"] < DIFFERENT * own[n]["by_chance"] for n in (20, 40))
    both = "; ".join(text.format(**own[n]) for n in (20, 40))
    yield _verdict("N = 20, 40 and 80 hardly differ, N = 20 is adequate", both, close)


def _tables(flows: dict[str, list[dict]], persistence: dict) -> Iterator[dict]:
    for name, (epsilon, reynolds, eta) in FLOWS.items():
        for r in flows[name]:
            text = f"{r['run']}: ε = {r['dissipation']:.4g}, η = {r['kolmogorov_length']:.4g}, "
            text += f"Re_λ = {r['taylor_reynolds']:.1f}"
            off = max(abs(r["taylor_reynolds"] / reynolds - 1), abs(r["kolmogorov_length"] / eta - 1))
            claim = f"Table 1, Flow {name}: ε = {epsilon:g}, η = {eta:g}, Re_λ = {reynolds}"
            yield _verdict(claim, text, True if off < 0.1 else f"within {off:.0%}")
    lengths = [
        15**0.25 * reynolds**0.5 * kolmogorov_length(1e-3, epsilon) for epsilon, reynolds, _ in FLOWS.values()
    ]
    yield _verdict(
        "Table 1: λ_g = 0.23 (I), 0.17 (II)",
        f"λ = 15^(1/4) Re_λ^(1/2) η of its own ν, ε, Re_λ is {lengths[0]:.2f} and {lengths[1]:.3f}",
        False,
    )
    for name, (low, high) in {"I": (0.85, 6.5), "II": (0.1, 6)}.items():
        runs = [r["run"] for r in flows[name]]
        own = [r["length_2aN"] for r in persistence["rows"] if r["run"] in runs and r["fitted"]]
        if own:
            text = f"families in the fits have L/{LARGE} = {min(own) / LARGE:.2g} to {max(own) / LARGE:.2g}"
            yield _verdict(f"L/L_g varies from {low} to {high} in Flow {name}", text, "our range")
    stiffness = 21e6 * np.pi * 9e-4**4 / 64
    yield _verdict(
        "Table 2: E = 21 MPa and 2a = 900 μm make K^b = 6.75e-7 N m²",
        f"Eπd⁴/64 = {stiffness:.3g}",
        abs(stiffness / 6.75e-7 - 1) < 0.01,
    )


def _shapes(shapes: dict) -> Iterator[dict]:
    rows = shapes["rows"]
    worst = max(rows, key=lambda r: r["anisotropy"] / r["anisotropy_by_chance_at_most"])
    ratio = worst["anisotropy"] / worst["anisotropy_by_chance_at_most"]
    text = f"anisotropy of ⟨R R⟩ of {len(rows)} families: median {np.median([r['anisotropy'] for r in rows]):.3f}; "
    text += (
        f"the largest, {worst['family']}, is {ratio:.1f} times what one vector of each fiber makes by chance"
    )
    yield _verdict(
        "superposed fibers form a sphere: end-to-end vectors are isotropic (figure 6)", text, ratio < 2
    )


def _densities(ends: dict) -> Iterator[dict]:
    rows = ends["rows"]
    rigid = _nearest(rows, 1.0, 1e-5)
    if rigid:
        name = f"{rigid['run']} {rigid['family']}, ⟨R²⟩/L² = {rigid['R2_over_contour2']:.3f}: "
        text = f"D = {rigid['D_rigid']:.3f} ({rigid['D_by_chance']:.3f} by chance)"
        stiffest = min(rows, key=lambda r: r["D_rigid"])
        text += f"; of a straight family, {stiffest['family']}, {stiffest['D_rigid']:.3f}"
        near = rigid["D_rigid"] < DIFFERENT * rigid["D_by_chance"]
        claim = (
            "the PDF of R²_{2D} of the rigid fiber (L = 1, K^b = 1e-5, Flow I) is that of rods (figure 7 a)"
        )
        yield _verdict(claim, name + text, near)
        below = rigid["gyration_over_rod"]
        text = f"R_g is {below:.3f} of that of a straight chain of its beads"
        yield _verdict("its R_g has a sharp peak slightly below δ_R (figure 7 b)", text, 0.9 < below < 1)
    soft = [r for r in rows if r["bending_stiffness"] < 1e-14 and r["l_p_over_2a"] < 0.1 and r["beads"] > 2]
    soft = [r for r in soft if r["bending_stiffness"] > 0]
    if soft:
        r = soft[0]
        text = f"{r['run']} {r['family']}: D = {r['D_coil']:.3f} ({r['D_by_chance']:.3f} by chance), "
        text += (
            f"{r['D_rigid']:.3f} from rods; l_p is {r['l_p_over_2a']:.2g} of a bead: a freely jointed chain"
        )
        near = r["D_coil"] < DIFFERENT * r["D_by_chance"]
        claim = (
            "the PDF of R²_{2D} of the flexible fiber (L = 1.8, K^b = 4e-16, Flow I) is Gaussian (figure 7 c)"
        )
        yield _verdict(claim, text, near)
        text = f"R_g is {r['gyration_over_coil']:.2f} δ_F and {r['gyration_over_rod']:.2f} of that of rods; R²/R_g² = "
        text += f"{r['R2_over_Rg2']:.1f} (6 of random walks, {12 * (r['beads'] - 1) / (r['beads'] + 1):.1f} of rods)"
        yield _verdict("δ_F = 1/√(6N), the random walk's, is the theoretical R_g (figure 7 d)", text, False)


def _nearest(rows: list[dict], length: float, stiffness: float) -> dict | None:
    own = [
        r
        for r in rows
        if np.isclose(r["length_2aN"], length) and np.isclose(r["bending_stiffness"], stiffness)
    ]
    return next((r for r in own if r["beads"] == 20), None)


def _slopes(ends: dict) -> Iterator[dict]:
    claims = {
        "L/l_p < 3": ("short and rigid fibers scale linearly, R ∝ L (figure 8)", 2.0),
        "L/l_p ≥ 3": ("⟨R²⟩ ∝ L is mostly observed for flexible fibers (figure 8)", 1.0),
    }
    for group, (claim, slope) in claims.items():
        own = [s for s in ends["slopes"] if s["slope_of"] == group]
        if own:
            text = "; ".join(
                f"{s['run']}, {group}: ⟨R²⟩ ∝ L^({s['slope']:.2f} ± {s['error']:.2f}), {s['families']} families"
                for s in own
            )
            yield _verdict(claim, text, all(abs(s["slope"] - slope) < max(2 * s["error"], 0.05) for s in own))


def _collapse(curvature: dict) -> Iterator[dict]:
    c = curvature["collapse"]
    if c:
        text = f"mean distance of ln κ̄ of two of {c['families']} families: {c['before']:.2f} before, {c['after']:.2f} "
        text += f"after ({c['by_chance']:.2f} by chance; width of one density {c['width']:.2f})"
        if c["exponent_of_l_p"] is not None:
            text += f"; median κ̄ ∝ l_p^{c['exponent_of_l_p']:.2f} L^{c['exponent_of_L']:.2f}"
        good = c["after"] < DIFFERENT * c["by_chance"]
        part = "in part" if c["after"] < 0.7 * c["before"] else False
        claim = "all densities of the mean curvature collapse on l_p alone (figure 9)"
        yield _verdict(claim, text, good or part)


def _gamma(persistence: dict, flows: dict[str, list[dict]]) -> Iterator[dict]:
    fits = {f["variant"]: f for f in persistence["fits"]}
    whole, paper = fits["all"], fits["γ = 3, the paper's"]
    text = f"γ = {whole['gamma']:.2f} ± {whole['error']:.2f} of {whole['points']} families, which leave the curve by "
    text += f"{whole['scatter']:.0%}; γ = 3 by {paper['scatter']:.0%}"
    yield _verdict("γ = 3 in the simulations (figure 10)", text, abs(whole["gamma"] - 3) < 2 * whole["error"])
    short, long = (fits.get(n) for n in ("L/l_p up to 5", "L/l_p from 5 on"))
    if short and long:
        text = f"γ = {short['gamma']:.1f} ± {short['error']:.1f} up to L/l_p = 5, {long['gamma']:.1f} ± "
        text += f"{long['error']:.1f} from there on: short fibers stay straighter than the curve, long ones fall faster"
        same = abs(short["gamma"] - long["gamma"]) < 2 * np.hypot(short["error"], long["error"])
        yield _verdict(
            "the data are well described by the model of eq. (19)", text, same and whole["scatter"] < 0.1
        )
    runs = {
        f: [fits[f"run {r['run']}"] for r in own if f"run {r['run']}" in fits] for f, own in flows.items()
    }
    if runs["I"] and runs["II"] and persistence["transition"]:
        text = "γ in " + "; ".join(
            f"Flow {flow}: "
            + ", ".join(f"{f['gamma']:.2f} ± {f['error']:.2f} ({f['variant'][4:]})" for f in own)
            for flow, own in runs.items()
        )
        text += f"; {_around_one_curve(persistence, flows)}"
        one, two = (_offsets(persistence, flows[f]) for f in ("I", "II"))
        error = np.hypot(one.std() / len(one) ** 0.5, two.std() / len(two) ** 0.5)
        apart = abs(one.mean() - two.mean())
        same = True if apart < 2 * error else f"to {apart:.0%}"
        yield _verdict("both flows have one curve: less stiffness is as good as more turbulence", text, same)
    own = [r for r in persistence["rows"] if r["fitted"]]
    straight, bent = (f(own, key=lambda r: r["L_over_l_p"]) for f in (min, max))
    yield _verdict(
        "⟨R²⟩ = L² for L ≪ l_p",
        f"{straight['R2_over_contour2']:.4f} L² at L/l_p = {straight['L_over_l_p']:.2f}; eq. (19) with γ = 3 has "
        f"{float(squared_ratio(straight['L_over_l_p'] / 3)):.4f}",
        abs(straight["R2_over_contour2"] - 1) < 0.02,
    )
    expected = 2 * whole["gamma"] / bent["L_over_l_p"]
    yield _verdict(
        "⟨R²⟩ = 2 l_p L for L ≫ l_p",
        f"{bent['R2_over_contour2']:.3f} L² at L/l_p = {bent['L_over_l_p']:.1f}, where 2γl_p/L is {expected:.3f}",
        abs(bent["R2_over_contour2"] / expected - 1) < 0.1,
    )
    yield _verdict(
        "γ = 2 in the experiment",
        "the text has no data point of it; what moves γ is in gamma.md",
        "cannot be judged",
    )
    yield _verdict(
        "eq. (18): Sp = L⁸/l_p⁸; conclusion: Sp = L/l_p",
        "two numbers of one name: axes here say L/l_p",
        False,
    )


def _offsets(persistence: dict, runs: list[dict]) -> np.ndarray:
    """ln ⟨R²⟩/L² of the families of some runs from the one curve through all."""
    t, names = persistence["transition"], [r["run"] for r in runs]
    curve = Transition(t["plateau"], t["middle"], t["steepness"], tuple(t["errors"]), t["scatter"])
    own = [r for r in persistence["rows"] if r["fitted"] and r["run"] in names]
    return np.array([np.log(r["R2_over_contour2"] / float(curve(r["L_over_l_p"]))) for r in own])


def _around_one_curve(persistence: dict, flows: dict[str, list[dict]]) -> str:
    parts = []
    for flow, runs in flows.items():
        own = _offsets(persistence, runs)
        parts.append(f"Flow {flow} by {own.mean():+.1%} ± {own.std() / len(own) ** 0.5:.1%}")
    return f"around one curve of L/l_p ⟨R²⟩ lies off, {', '.join(parts)}"


def _contact(dynamics: dict) -> Iterator[dict]:
    rows = [r for r in dynamics["rows"] if r.get("self_contact") is not None and r["l_p_over_2a"] >= 1]
    if not rows:
        return
    often = [r for r in rows if r["self_contact"] > RARE]
    worst = max(rows, key=lambda r: r["self_contact"])
    text = (
        f"{len(often)} of {len(rows)} families touch themselves in more than {RARE:.0%} of the time; most, "
    )
    text += f"{worst['run']} {worst['family']} (L/l_p = {worst['L_over_l_p']:.0f}), in {worst['self_contact']:.0%}"
    claim = "self-contact occurs only for very long flexible fibers, and is very rare"
    yield _verdict(claim, text, "not rare" if often else True)


def _straightening(curvature: dict) -> Iterator[dict]:
    groups: dict[tuple, dict[float, dict]] = {}
    for r in curvature["rows"]:
        if r["beads"] == 20 and (r["L_over_l_p"] or 0) > 3 and r["l_p_over_2a"] > 0.7:
            groups.setdefault((r["run"], r["bending_stiffness"]), {})[r["length_2aN"]] = r
    if not groups:
        return
    (name, stiffness), own = max(groups.items(), key=lambda item: max(item[1]) / min(item[1]))
    if len(own) >= 3:
        means = [own[length]["mean_curvature"] for length in sorted(own)]
        text = f"{name}, K^b = {stiffness:g}: κ̄ = "
        text += ", ".join(f"{m:.2f} at L = {n:g}" for m, n in zip(means, sorted(own), strict=True))
        falls = means[-1] < 0.95 * max(means)
        yield _verdict(
            "turbulence straightens long fibers: their mean curvature falls with length", text, falls
        )


def rows(result: dict) -> list[dict]:
    """The lines of a CSV file."""
    return result["rows"]


def table(result: dict) -> str:
    """A table in Markdown."""
    lines = ["| the paper | measured | agrees? |", "|---|---|---|"]
    return "\n".join(
        [*lines, *(f"| {r['claim']} | {r['measured']} | {r['agrees']} |" for r in result["rows"])]
    )
