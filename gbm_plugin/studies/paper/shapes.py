"""Fibers laid over each other with one end at the origin, rigid and flexible, and how isotropic they are: figure 6.

The density of the fibers around their first bead, in the three projections together, of the straightest family and of
the most flexible one whose l_p is not shorter than a bead (or of those that --families names). Isotropy of every
family: the distance of ⟨R R⟩/⟨R²⟩ from a third of the unit tensor, 0 where it is isotropic and 1 for parallel fibers;
M independent vectors make 1/√M of it by chance, M being at least the number of fibers.
"""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure
from numpy.typing import NDArray

from ...report.style import new_figure
from ...statistics.fibers import end_to_end
from ...statistics.orientation import anisotropy
from ..recorded import (
    Family,
    FinishedRun,
    Since,
    add_run_arguments,
    checked_bending,
    finished_runs,
    flow_lines,
)

WITHIN = (0.25, 0.5, 0.75, 1.0)  # of each link, the places that count
CELLS = 60  # of a picture, in each direction


def add_arguments(parser: argparse.ArgumentParser) -> None:
    add_run_arguments(parser, run)


def run(
    cases: Sequence[Path],
    since: Since = None,
    records: int = 100,
    families: Sequence[str] = (),
) -> dict:
    """Isotropy of all families, and the pictures of two."""
    measured, flows, pictures = [], [], []
    for finished in finished_runs(cases, since, records, families):
        flows.append(finished.summary())
        own = []
        for family in finished.followed():
            if family.beads > 2:
                (vectors,) = finished.measure(family, end_to_end)
                own.append(_row(family, vectors))
        measured += own
        chosen = sorted([r for r in own if r["resolved"]] or own, key=lambda r: -r["R2_over_contour2"])
        for row in (chosen[:1] + chosen[-1:]) if not pictures else ():
            family = next(f for f in finished.families if f.name == row["family"])
            pictures.append(row | {"density": _density(finished, family).round(4).tolist()})
    checked_bending(measured, cases)
    return {"runs": flows, "rows": measured, "pictures": pictures}


def _row(family: Family, vectors: NDArray) -> dict:
    square = (vectors**2).sum(axis=-1)
    return family.row() | {
        "resolved": family.resolved,
        "R2_over_contour2": float(square.mean() / family.contour**2),
        "anisotropy": anisotropy(vectors),
        "anisotropy_by_chance_at_most": family.count**-0.5,
        "sides": (
            (vectors**2).mean(axis=(0, 1)) / family.contour**2
        ).tolist(),  # alike in isotropic turbulence
    }


def _density(finished: FinishedRun, family: Family) -> NDArray:
    """(CELLS, CELLS) places of fibers per cell over the largest number, in a square as wide as two contour lengths."""
    edges = np.linspace(-1.05, 1.05, CELLS + 1) * family.contour

    def counted(positions: NDArray) -> NDArray:
        x = positions - positions[..., :1, :]
        links = np.diff(x, axis=-2)
        x = np.concatenate([x[..., :-1, :] + part * links for part in WITHIN]).reshape(-1, 3)
        counts = sum(np.histogram2d(x[:, i], x[:, (i + 1) % 3], (edges, edges))[0] for i in range(3))
        return counts[None]

    (counts,) = finished.measure(family, counted)
    counts = counts.sum(axis=0)
    return counts / counts.max()


def rows(result: dict) -> list[dict]:
    """The lines of a CSV file."""
    return [{k: v for k, v in r.items() if k != "sides"} for r in result["rows"]]


def table(result: dict) -> str:
    """Isotropy as text."""
    lines = flow_lines(result["runs"])
    width = max(len(f"{r['run']} {r['family']}") for r in result["rows"])
    lines.append(
        f"{'family':{width}} {'⟨R²⟩/L²':>8} {'anisotropy':>11} {'chance ≤':>9}  ⟨R_x²⟩ ⟨R_y²⟩ ⟨R_z²⟩ over L²"
    )
    lines += [
        f"{r['run'] + ' ' + r['family']:{width}} {r['R2_over_contour2']:8.4f} {r['anisotropy']:11.4f} "
        f"{r['anisotropy_by_chance_at_most']:9.4f}  " + " ".join(f"{v:.4f}" for v in r["sides"])
        for r in result["rows"]
    ]
    return "\n".join(lines)


def draw(result: dict) -> Figure:
    """The superposed beads of two families."""
    figure = new_figure(4.4 * len(result["pictures"]), 4.2)
    for axes, own in zip(
        np.atleast_1d(figure.subplots(1, len(result["pictures"]))), result["pictures"], strict=True
    ):
        density = np.array(own["density"])
        with np.errstate(divide="ignore"):
            shown = np.log10(density)
        image = axes.imshow(shown.T, origin="lower", extent=(-1.05, 1.05) * 2, cmap="magma", vmin=-3, vmax=0)
        axes.set(xlabel="x/L", ylabel="y/L", facecolor="k")
        axes.grid(False)
        axes.set_title(f"{own['family']}: anisotropy {own['anisotropy']:.3f}", fontsize=10)
    figure.colorbar(image, label="log$_{10}$ density over its largest", shrink=0.8)
    return figure
