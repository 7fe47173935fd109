"""Beads: what N buys a fiber of the same length, in free drain

Chains of N beads against one of many, from the same straight lines, moved to the same tolerance: with isotropic drag
a chain converges to a thread as N grows. With rpy N is the aspect ratio L/2a itself, and no choice. The error of the
ends is c/N², c = 0.8 of a rigid chain and more the further it bends: the rule of `beads auto;` (case/beads.py) bounds
it. The mean of eq. (11) leaves out the ends, where a fiber is straight, and is 2/N too large; `bend`, the integral of
the curvature over the contour, has not that error.
"""

from __future__ import annotations

from itertools import product

import numpy as np

from ...case.beads import bead_error
from ...report.style import COLOURS, LINES
from ...statistics.fibers import mean_curvature
from .flows import Carrier, cellular, turbulent
from .march import Outcome, march

REGIMES = (0.07, 0.15, 0.4, 1.0, 3.0)  # l_p/L; the default case has 0.07 and 0.4
BEADS = (6, 8, 12, 20, 40, 80)
END, STEP, COUNT = 2.0, 0.05, 32  # [τ], [τ], fibers


def measure(quick: bool) -> list[dict]:
    """A row for each flow, regime and number of beads."""
    carriers = (cellular(),) if quick else (cellular(), turbulent())
    beads = (6, 12, 20, 40) if quick else BEADS
    count = 16 if quick else COUNT
    rows = []
    for carrier, persistence in product(carriers, (0.15, 1.0) if quick else REGIMES):
        found = {n: _moved(carrier, persistence, n, count) for n in (*beads, 2 * beads[-1])}
        exact = found.pop(2 * beads[-1])
        for n, outcome in found.items():
            row = {"flow": carrier.name, "persistence": persistence, "beads": n}
            row |= {"rule": bead_error(n, 1 / persistence), "seconds": outcome.seconds}
            rows.append(row | _errors(outcome, exact, carrier.length))
    return rows


def _moved(carrier: Carrier, persistence: float, beads: int, count: int) -> Outcome:
    fibers = carrier.fibers(persistence, beads, count)
    return march(carrier, fibers, STEP, END, integrator="implicit", tolerance=1e-3)


def _ends(outcome: Outcome) -> np.ndarray:
    """(F, 2, 3) of the contour, half a bead beyond the last centres: 2aN apart in a straight chain."""
    x = outcome.positions
    return np.stack([1.5 * x[:, 0] - 0.5 * x[:, 1], 1.5 * x[:, -1] - 0.5 * x[:, -2]], axis=1)


def _errors(outcome: Outcome, exact: Outcome, length: float) -> dict[str, float]:
    ends, others = _ends(outcome), _ends(exact)
    ratios = [(np.diff(e, axis=1) ** 2).sum(axis=-1).mean() / length**2 for e in (ends, others)]
    bends = [mean_curvature(o.positions, o.radius).mean() * length for o in (outcome, exact)]
    whole = [bend * (1 - 2 / o.positions.shape[1]) for bend, o in zip(bends, (outcome, exact), strict=True)]
    return {
        "error": float(np.sqrt(((ends - others) ** 2).sum(axis=-1).mean())) / length,
        "r2": float(ratios[0]),
        "r2_error": float(abs(ratios[0] / ratios[1] - 1)),
        "curvature": float(bends[0]),
        "curvature_error": float(abs(bends[0] / bends[1] - 1)),
        "bend_error": float(abs(whole[0] / whole[1] - 1)),
    }


def draw(axes, rows: list[dict]) -> None:
    """Error of the ends against N."""
    for line, flow in zip(LINES, dict.fromkeys(r["flow"] for r in rows), strict=False):
        for colour, persistence in zip(COLOURS, dict.fromkeys(r["persistence"] for r in rows), strict=False):
            own = [r for r in rows if (r["flow"], r["persistence"]) == (flow, persistence)]
            label = f"l$_p$/L = {persistence:g}" if line == "-" else None
            x, y = ([r[name] for r in own] for name in ("beads", "error"))
            axes.loglog(x, y, "o", markersize=3, linestyle=line, color=colour, label=label)
            if line == "-":
                axes.loglog(x, [r["rule"] for r in own], ":", color=colour, linewidth=1)
    beads = sorted({r["beads"] for r in rows})
    axes.set_xticks(beads, [str(n) for n in beads])
    axes.set_xticks([], minor=True)
    axes.set(title="beads (dotted: the rule)", xlabel="N", ylabel="error of the ends / L")
    axes.legend(fontsize=7)


def lines(rows: list[dict]) -> list[str]:
    """Errors of <R²>, the mean curvature and the bend are relative; rule: what `beads auto;` takes the ends for."""
    head = (
        "flow           l_p/L    N    CPU [s]    ends/L      rule   <R²>/L²     error  curvature L     error"
    )
    text = [head + "      bend"]
    for r in rows:
        text.append(
            f"{r['flow']:12s} {r['persistence']:7g} {r['beads']:4d}{r['seconds']:11.3f}{r['error']:10.1e}"
            f"{r['rule']:10.1e}{r['r2']:10.4f}{r['r2_error']:10.1e}{r['curvature']:13.3f}"
            f"{r['curvature_error']:10.1e}{r['bend_error']:10.1e}"
        )
    return text
