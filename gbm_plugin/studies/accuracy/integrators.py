"""Integrators: time of the fibers against their error, one sample of the flow a step

Cost: processor time per bead and Kolmogorov time τ, after the first steps of a run. The error includes that of
extrapolating the flow over the step, which is the same for all; the reference takes steps eight times as short, by ab3
or to a tolerance of 1e-5.
`own limit` is ab3 with sub-steps at its stability limit instead of eq. (10).
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager, nullcontext
from functools import partial
from itertools import product

from ...fiber import ab3
from ...report.style import COLOURS
from .flows import Carrier, cellular, turbulent
from .front import draw_front, mark_front
from .march import Outcome, fastest, march

REGIMES = {
    "flexible": (0.1, 20, 100),
    "l_p = L": (1.0, 10, 40),
    "nearly rigid": (3.0, 10, 40),
}  # l_p/L, N, fibers
STEPS = (0.4, 0.2)  # [τ]: of 1 % and of 0.1 %; the default case has 0.04
TOLERANCES = (1e-2, 1e-3, 1e-4)
DEFAULT = ("auto", 1e-3)
SAME = ("flow", "regime", "mobility", "step")  # of rows that compare
MOST_WORK = {"freeDrain": 6e7, "rpy": 5e6}  # bead-sub-steps of a run: what takes more is left out


def methods() -> list[tuple[str, float | None]]:
    """Integrator and tolerance of each."""
    return [("ab3", None), ("ab3, own limit", None), *product(("implicit", "auto"), TOLERANCES)]


@contextmanager
def own_limit() -> Iterator[None]:
    """ab3 takes its stability limit for eq. (10)."""
    usual = ab3.stable_step

    def stable(fibers, softness: float, tension: float) -> float:
        stiffness = fibers.bending_stiffness.max() / (fibers.viscosity * (2 * fibers.radius) ** 4 * softness)
        rate = ab3.BENDING_RATE * stiffness + ab3.TENSION_RATE * tension / (2 * fibers.radius)
        return ab3.LIMIT / rate

    ab3.stable_step = stable
    try:
        yield
    finally:
        ab3.stable_step = usual


def measure(quick: bool) -> list[dict]:
    """A row for each flow, regime, mobility, step and method."""
    carriers, mobilities = ((cellular(),), ("freeDrain",)) if quick else (
        (cellular(), turbulent()), ("freeDrain", "rpy")
    )  # fmt: skip
    steps, end = ((0.1,), 1.0) if quick else (STEPS, 2.0)
    rows: list[dict] = []
    for carrier, mobility, regime in product(carriers, mobilities, REGIMES):
        rows += _regime(carrier, mobility, regime, steps, end, MOST_WORK[mobility])
    mark_front(rows, *SAME)
    return rows


def _regime(carrier: Carrier, mobility: str, regime: str, steps, end: float, most: float) -> list[dict]:
    persistence, beads, count = REGIMES[regime]
    fibers = carrier.fibers(persistence, beads, count)
    substep = (
        fibers.viscosity * (2 * fibers.radius) ** 4 / fibers.bending_stiffness[0] / carrier.kolmogorov_time
    )
    short = min(steps) / 8
    words = {"integrator": "ab3"} if short < 20 * substep else {"integrator": "implicit", "tolerance": 1e-5}
    exact = march(carrier, fibers, short, end, mobility=mobility, **words)
    work = count * beads * end / substep
    rows = []
    chosen = [
        (step, *m) for step, m in product(steps, methods()) if work <= most or not m[0].startswith("ab3")
    ]
    runs = [partial(_moved, carrier, fibers, end, mobility, *choice) for choice in chosen]
    for (step, name, tolerance), outcome in zip(chosen, fastest(runs), strict=True):
        row = {"flow": carrier.name, "regime": regime, "mobility": mobility, "step": step, "integrator": name}
        row |= {"tolerance": tolerance, "sub_steps": step / substep, "seconds": outcome.settled}
        row |= {"microseconds": 1e6 * outcome.settled / (count * beads * end)} | outcome.errors(exact)
        rows.append(row | {"default": (name, tolerance) == DEFAULT})
    return rows


def _moved(carrier: Carrier, fibers, end: float, mobility: str, step: float, name: str, tolerance) -> Outcome:
    with own_limit() if name == "ab3, own limit" else nullcontext():
        options = {"integrator": name.partition(",")[0], "tolerance": tolerance, "mobility": mobility}
        return march(carrier, fibers, step, end, **options)


def draw(axes, rows: list[dict]) -> None:
    """Error of the ends against time in free drain, at all steps; the default is framed, the front dashed."""
    shown = [r for r in rows if r["mobility"] == "freeDrain"]
    names = list(dict.fromkeys(r["integrator"] for r in shown))
    flow = shown[-1]["flow"]
    for marker, regime in zip("osD", REGIMES, strict=False):
        for colour, name in zip(COLOURS, names, strict=False):
            own = [r for r in shown if (r["flow"], r["regime"], r["integrator"]) == (flow, regime, name)]
            x, y = ([r[key] for r in own] for key in ("microseconds", "error"))
            axes.loglog(x, y, marker, markersize=4, color=colour)
            for r in own:
                if r["default"]:
                    axes.plot(r["microseconds"], r["error"], "ks", markersize=9, fillstyle="none")
        for step in dict.fromkeys(r["step"] for r in shown):
            own = [r for r in shown if (r["flow"], r["regime"], r["step"]) == (flow, regime, step)]
            draw_front(axes, own, "microseconds")
        axes.plot([], [], marker, color="0.4", linestyle="", label=regime)
    for colour, name in zip(COLOURS, names, strict=False):
        axes.plot([], [], color=colour, label=name)
    axes.plot([], [], "--", color="0.6", linewidth=2, label="front")
    listed = ", ".join(f"{step:g}" for step in dict.fromkeys(r["step"] for r in shown))
    axes.set(
        title=f"integrators, {flow}, steps of {listed} τ",
        xlabel="µs a bead and τ",
        ylabel="error of the ends / L",
    )
    axes.legend(fontsize=7)


def over_the_front(rows: list[dict]) -> dict[tuple, float]:
    """The time of the default over that of whatever has its error, or at most a fifth more, at the least time; by flow,
    regime, mobility and step."""
    found = {}
    for own in (r for r in rows if r["default"]):
        key = tuple(own[name] for name in SAME)
        as_good = [r for r in rows if tuple(r[n] for n in SAME) == key and r["error"] <= 1.2 * own["error"]]
        found[key] = own["seconds"] / min(r["seconds"] for r in as_good)
    return found


def lines(rows: list[dict]) -> list[str]:
    """* marks the default, + the front."""
    head = "flow         regime       mobility   step/τ sub-steps  integrator      tolerance   µs/bead/τ"
    text = [head + "    ends/L      <R²>  curvature"]
    for r in rows:
        mark = "*" * r["default"] + "+" * r["on_front"]
        tolerance = "" if r["tolerance"] is None else f"{r['tolerance']:g}"
        text.append(
            f"{r['flow']:12s} {r['regime']:12s} {r['mobility']:9s} {r['step']:7g} {r['sub_steps']:9.3g}  "
            f"{r['integrator']:14s} {tolerance:>9s}{r['microseconds']:13.3g}{r['error']:10.1e}{r['r2_error']:10.1e}"
            f"{r['curvature_error']:10.1e} {mark}"
        )
    ratios = over_the_front(rows)
    for regime in dict.fromkeys(key[1] for key in ratios):
        own = [ratio for key, ratio in ratios.items() if key[1] == regime]
        text.append(
            f"{regime}: the default takes {min(own):.2f} to {max(own):.2f} of the least time for its error"
        )
    return text
