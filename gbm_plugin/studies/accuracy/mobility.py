"""Mobility: free drain, hydrodynamic interactions (rpy), and these with ambient strain

What each changes in the answer, and its cost. The distance is that of the ends from those of rpy with strain, the
fullest of the models.
"""

from __future__ import annotations

from functools import partial
from itertools import product

from ...statistics.fibers import end_to_end_squared_ratio, mean_curvature
from .flows import cellular, turbulent
from .march import fastest, march

MODELS = {
    "freeDrain": {"mobility": "freeDrain"},
    "rpy": {"mobility": "rpy"},
    "rpy, strain": {"mobility": "rpy", "strain_coupling": True},
}
REGIMES = {"flexible": 0.15, "l_p = L": 1.0}
BEADS = {6: 96, 20: 16}  # and how many fibers of so many beads
END, STEP = 2.0, 0.1  # [τ]


def measure(quick: bool) -> list[dict]:
    """A row for each flow, regime, number of beads and model."""
    carriers = (cellular(),) if quick else (cellular(), turbulent())
    rows = []
    for carrier, regime, beads in product(carriers, REGIMES, (6,) if quick else BEADS):
        fibers = carrier.fibers(REGIMES[regime], beads, BEADS[beads])
        runs = [
            partial(march, carrier, fibers, STEP, END, integrator="auto", **words)
            for words in MODELS.values()
        ]
        found = dict(zip(MODELS, fastest(runs), strict=True))
        fullest = found["rpy, strain"]
        for name, outcome in found.items():
            x, a = outcome.positions, outcome.radius
            row = {"flow": carrier.name, "regime": regime, "beads": beads, "model": name}
            row |= {"seconds": outcome.settled, "cost": outcome.settled / found["freeDrain"].settled}
            row |= {"sampling_seconds": outcome.sampling, "distance": outcome.errors(fullest)["error"]}
            row |= {"r2": float(end_to_end_squared_ratio(x, a).mean())}
            rows.append(row | {"curvature": float(mean_curvature(x, a).mean()) * 2 * a * beads})
    return rows


def lines(rows: list[dict]) -> list[str]:
    """Cost is over that of free drain; distance that of the ends, over the length."""
    text = ["flow         regime      N  model           cost   distance   <R²>/L²  curvature L"]
    for r in rows:
        text.append(
            f"{r['flow']:12s} {r['regime']:9s} {r['beads']:3d}  {r['model']:12s}{r['cost']:8.1f}{r['distance']:11.1e}"
            f"{r['r2']:10.4f}{r['curvature']:13.3f}"
        )
    return text
