"""Buckling probability against the Sperm number in cellular flow: section 3 and figure 4 of the paper.

Fibers of α = L/W = 0.4 start straight, in the plane of the flow, at random positions and directions. See
`gbm_plugin.statistics.buckling` for what is counted. Sp = μSL⁴/K^b with S = πU₀/W; the slender-body number of
other authors is 8π Sp/c, c = −ln(ε²e), with ε = a/L or 2a/L.
"""

from __future__ import annotations

import argparse
import shutil
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure

from ...fiber.model import MOBILITIES
from ...report.style import COLOURS, new_figure
from ...statistics.buckling import REGIONS, probability
from ..study import option
from ..taylor_green import NORMALISATIONS, Run, Scene, run_scenes
from .buckling_thresholds import link_matrices, threshold

CURVE = (
    *(
        1.0,
        10.0,
        20.0,
        25.0,
        30.0,
        35.0,
        40.0,
        45.0,
        50.0,
        60.0,
        70.0,
        80.0,
        100.0,
        140.0,
        200.0,
        300.0,
        450.0,
    ),
    *(1e3, 3e3, 1e4, 3e4, 1e5, 3e5, 1e6, 3e6, 1e7, 1e8),
)
SETTLED = 100.0  # W/U₀ without leaving a vortex, after which a fiber counts as trapped in it


def add_arguments(parser: argparse.ArgumentParser) -> None:
    option(parser, run, "sp", "Sperm numbers (default: the whole curve)", nargs="+", type=float)
    option(parser, run, "count", "fibers of each Sperm number")
    option(parser, run, "end", "time of the flow [W/U0]")
    option(parser, run, "region", "where fibers are compressed", choices=list(REGIONS))
    option(parser, run, "mobility", "of the beads", choices=list(MOBILITIES))
    option(parser, run, "beads", "of a fiber, of the same length")
    option(parser, run, "seed", "of positions and directions, the same for every Sperm number")
    option(parser, run, "integrator", "ab3, implicit, or the faster one", choices=["best", "ab3", "implicit"])
    option(parser, run, "time_step", "[W/U0] (default: 0, that of the integrator)")
    option(parser, run, "tolerance", "of implicit steps, over the length")
    option(parser, run, "reseed", "replace fibers that have met no region for so long [W/U0]; 0: never")
    option(parser, run, "workers", "processes; 0: as many as processors")
    option(
        parser,
        run,
        "state",
        "folder that keeps the state; default: buckling.state, gone at the end",
        type=Path,
    )


def run(
    sp: Sequence[float] | None = None,
    count: int = 400,
    end: float = 1000.0,
    region: str = "strain",
    mobility: str = "rpy",
    beads: int = 6,
    seed: int = 1,
    integrator: str = "best",
    time_step: float = 0.0,
    tolerance: float = 1e-2,
    reseed: float = 0.0,
    workers: int = 0,
    state: Path | None = None,
) -> dict:
    """Tracks, events and probability of every Sperm number. The same command goes on where it was killed.

    Raises ValueError for a number or word that is not allowed.
    """
    if region not in REGIONS:
        raise ValueError(f"region is {region!r}; allowed are {', '.join(REGIONS)}")
    if not (np.isfinite(end) and end > 0):
        raise ValueError(f"end is {end}; it must be finite and positive")
    options = {"count": count, "beads": beads, "mobility": mobility, "seed": seed}
    options |= {"integrator": integrator, "time_step": time_step, "tolerance": tolerance, "reseed": reseed}
    scenes = [Scene(float(number), **options) for number in dict.fromkeys(sp or CURVE)]
    folder = state or Path("buckling.state")
    runs = run_scenes(scenes, end, folder, workers, "buckling")
    found = [row_of(run, region) for run in runs]
    if state is None:
        shutil.rmtree(folder, ignore_errors=True)
    first = threshold(link_matrices(beads, mobility, "cellular"), 1)
    settings = {"end": end, "region": region} | options | {"length_over_width": scenes[0].length}
    return settings | {"first_threshold": first, "rows": found}


def row_of(run: Run, region: str = "strain", normalisation: str = NORMALISATIONS[0]) -> dict:
    """What is known of one Sperm number, as a line of the table."""
    tracks = run.tracks[region, normalisation]
    found = probability(tracks.events, tracks.tracks)
    trapped = run.time - run.crossed > SETTLED
    idle = run.time - np.nan_to_num(run.visited, nan=0.0) > SETTLED
    beads = run.scene.beads
    return {
        "sperm_number": run.scene.sperm_number,
        "tracks": found.tracks,
        "events": found.events,
        "probability": found.value,
        "standard_error": found.error,
        "binomial_error": found.binomial_error,
        "slender_body_number": slender_body_number(run.scene.sperm_number, 1 / (2 * beads)),
        "slender_body_number_2a": slender_body_number(run.scene.sperm_number, 1 / beads),
        "trapped_fraction": float(trapped.mean()),
        "trapped_since": float(np.median(run.crossed[trapped])) if trapped.any() else None,
        "without_region_fraction": float(idle.mean()),
        "reseeded": int(run.reseeded.sum()),
        "integrator": run.scene.method[0],
        "time_step": run.scene.method[1],
        "seconds": run.seconds,
    }


def slender_body_number(sperm_number: float, slenderness: float) -> float:
    """8π Sp/c, c = −ln(ε²e): the elasto-viscous number of slender-body theory, ε = slenderness."""
    return 8 * np.pi * sperm_number / -np.log(slenderness**2 * np.e)


def rows(result: dict) -> list[dict]:
    """The lines of a CSV file."""
    return result["rows"]


def table(result: dict) -> str:
    """The curve as text."""
    lines = [
        f"{result['count']} fibers of {result['beads']} beads, {result['mobility']}, region "
        f"{result['region']}, {result['end']:g} W/U0, seed {result['seed']}",
        "        Sp     8πSp/c    tracks    events       P          ±   binomial  trapped   seconds",
    ]
    for r in result["rows"]:
        lines.append(
            f"{r['sperm_number']:10.4g} {r['slender_body_number']:10.4g} {r['tracks']:9d} {r['events']:9d} "
            f"{r['probability']:9.5f} {r['standard_error']:9.2g} {r['binomial_error']:9.2g}  "
            f"{r['trapped_fraction']:8.3f} {r['seconds']:9.1f}"
        )
    lines.append(
        f"a straight chain in the strongest compression begins to buckle at {result['first_threshold']:.1f}"
    )
    lines.append(f"processor time {sum(r['seconds'] for r in result['rows']):.0f} s")
    return "\n".join(lines)


def draw(result: dict) -> Figure:
    """P against Sp, with standard errors."""
    figure = new_figure(6.8, 4.2)
    axes = figure.subplots()
    found = sorted(result["rows"], key=lambda row: row["sperm_number"])
    x, y, error = (np.array([r[n] for r in found]) for n in ("sperm_number", "probability", "standard_error"))
    axes.errorbar(x, y, error, color=COLOURS[0], marker="o", markersize=4, capsize=2, linewidth=1.2)
    label = "a straight chain begins to buckle"
    axes.axvline(result["first_threshold"], color="0.5", linestyle="--", linewidth=1, label=label)
    axes.legend()
    axes.set(xscale="log", xlabel="Sp = μSL⁴/K$^b$", ylabel="buckling probability", ylim=(-0.02, None))
    return figure
