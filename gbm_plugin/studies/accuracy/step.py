"""The coupling's step: what one sample of the flow a step costs

Between samples the flow is extrapolated along each bead's path by a quadratic in time: the error of a step is of fourth
order in it, that of a run of third. Fibers are moved to a tolerance at which they themselves add nothing; the reference
takes steps four times as short as the shortest. `share` is the error of a run of one τ over (Δt/τ)³: the constant in
`scales.coupling_error`, by which `gbm info` judges deltaT.
"""

from __future__ import annotations

from itertools import product

from ...report.style import COLOURS, LINES
from ...scales import EXTRAPOLATION, coupling_error
from .flows import cellular, turbulent
from .march import march

REGIMES = {"flexible": (0.1, 20), "l_p = L": (1.0, 10), "nearly rigid": (3.0, 10)}  # l_p/L, N
STEPS = (0.8, 0.4, 0.2, 0.1)  # [τ]
END, COUNT = 2.0, 32  # [τ], fibers


def measure(quick: bool) -> list[dict]:
    """A row for each flow, regime and step."""
    carriers = (cellular(),) if quick else (cellular(), turbulent())
    words = {"integrator": "implicit", "tolerance": 3e-5}
    rows = []
    for carrier, (regime, (persistence, beads)) in product(carriers, REGIMES.items()):
        fibers = carrier.fibers(persistence, beads, 8 if quick else COUNT)
        exact = march(carrier, fibers, STEPS[-1] / 4, END, **words)
        for step in STEPS:
            outcome = march(carrier, fibers, step, END, **words)
            row = {"flow": carrier.name, "regime": regime, "step": step} | outcome.errors(exact)
            rows.append(row | {"share": row["error"] / END / step**3})
    return rows


def draw(axes, rows: list[dict]) -> None:
    """Error of the ends against the step."""
    for line, flow in zip(LINES, dict.fromkeys(r["flow"] for r in rows), strict=False):
        for colour, regime in zip(COLOURS, REGIMES, strict=False):
            own = [r for r in rows if (r["flow"], r["regime"]) == (flow, regime)]
            x, y = ([r[name] for r in own] for name in ("step", "error"))
            axes.loglog(x, y, "o", markersize=3, linestyle=line, color=colour, label=f"{regime}, {flow}")
    rule = [END * coupling_error(step, 1.0) for step in STEPS]
    axes.loglog(STEPS, rule, ":k", label=f"{EXTRAPOLATION:g} (Δt/τ)³ a τ")
    axes.set_xticks(STEPS, [f"{step:g}" for step in STEPS])
    axes.set_xticks([], minor=True)
    axes.set(title="one sample a step", xlabel="Δt/τ", ylabel=f"error of the ends / L after {END:g} τ")
    axes.legend(fontsize=7)


def lines(rows: list[dict]) -> list[str]:
    """Errors at the end, ends over length; <R²> relative; curvature times length."""
    text = ["flow         regime        Δt/τ    ends/L      <R²>  curvature    share"]
    for r in rows:
        text.append(
            f"{r['flow']:12s} {r['regime']:12s}{r['step']:6g}{r['error']:10.1e}{r['r2_error']:10.1e}"
            f"{r['curvature_error']:11.1e}{r['share']:9.3f}"
        )
    return text
