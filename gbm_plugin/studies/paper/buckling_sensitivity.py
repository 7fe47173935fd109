"""What moves the curve of the buckling probability, by how much, and what does not.

Every variation runs from the same starts as the default, and its difference from it has the error of paired
fibers. A variation moves the curve where the sum of (ΔP/error)² over the Sperm numbers would be exceeded by chance
once in a hundred times. Region and normalisation are read off the default's own runs. Beads touch, so that L/a = 2N:
more beads mean thinner fibers of the same L, or longer ones of the same a.
"""

from __future__ import annotations

import argparse
import tempfile
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure
from scipy.stats import chi2

from ...report.style import COLOURS, new_figure
from ...statistics.buckling import difference, probability
from ..study import option
from ..taylor_green import DEFAULT, NORMALISATIONS, Run, Scene, run_scenes

READINGS = {  # of the default's own runs
    "normalised by 2aN": ("strain", NORMALISATIONS[1]),
    "region square": ("square", NORMALISATIONS[0]),
    "region compression": ("compression", NORMALISATIONS[0]),
}
VARIATIONS = {
    "another seed": {"seed": 2},
    "free drain": {"mobility": "freeDrain"},
    "rpy with ambient strain": {"strain_coupling": True},
    "torque as printed": {"bending_torque": "asPrinted"},
    "torque as printed, 2 Sp": {"bending_torque": "asPrinted"},
    "12 beads, same L": {"beads": 12},
    "20 beads, same L": {"beads": 20},
    "12 beads, same a": {"beads": 12, "length": 0.8},
    "tilted by 10 degrees": {"tilt": 10.0},
    "tilted by 30 degrees": {"tilt": 30.0},
    "isotropic starts": {"start": "isotropic"},
    "discrete rod": {"curvature_law": "discreteRod"},
    "beads repel": {"repulsion": 10.0},
    "re-seeded": {"reseed": 25.0},
    "twice the step": {"time_step": 2.0},
    "half the step": {"time_step": 0.5},
    "implicit": {"integrator": "implicit"},
    "implicit, tolerance / 10": {"integrator": "implicit", "tolerance": 1e-3},
}
SMALL = 0.01  # level of the test


def add_arguments(parser: argparse.ArgumentParser) -> None:
    option(parser, run, "sp", "Sperm numbers")
    option(parser, run, "count", "fibers of each")
    option(parser, run, "end", "time of the flow [W/U0]")
    option(parser, run, "only", "variations (default: all)", nargs="+", choices=[*VARIATIONS], metavar="NAME")
    option(parser, run, "seed", "of positions and directions")
    option(parser, run, "workers", "processes; 0: as many as processors")
    option(parser, run, "state", "folder that keeps the state (default: none)", type=Path)


def run(
    sp: Sequence[float] = (25.0, 45.0, 100.0, 450.0, 1e5),
    count: int = 200,
    end: float = 100.0,
    only: Sequence[str] | None = None,
    seed: int = 1,
    workers: int = 0,
    state: Path | None = None,
) -> dict:
    """P of the default and of each variation at each Sperm number, with differences, and how far each moves it."""
    names = [*VARIATIONS] if only is None else list(only)
    default = {number: Scene(float(number), count=count, seed=seed) for number in sp}
    scenes = {(None, number): scene for number, scene in default.items()}
    scenes |= {(name, number): varied(scene, name) for name in names for number, scene in default.items()}
    with tempfile.TemporaryDirectory(prefix="gbm-buckling-") as own:
        runs = run_scenes(list(scenes.values()), end, state or Path(own), workers, "sensitivity")
    found = dict(zip(scenes, runs, strict=True))
    lines = [_row("default", number, found[None, number], found[None, number], DEFAULT) for number in sp]
    for name, pair in READINGS.items():
        lines += [_row(name, number, found[None, number], found[None, number], pair) for number in sp]
    for name in names:
        lines += [_row(name, number, found[name, number], found[None, number], DEFAULT) for number in sp]
    return {"count": count, "end": end, "seed": seed, "rows": lines, "summary": _summary(lines)}


def varied(scene: Scene, name: str) -> Scene:
    """The default scene with one variation of it."""
    changes = dict(VARIATIONS[name])
    if name.endswith("2 Sp"):
        changes["sperm_number"] = 2 * scene.sperm_number
    if "time_step" in changes:
        changes |= {"integrator": scene.method[0], "time_step": changes["time_step"] * scene.method[1]}
    return replace(scene, **changes)


def _row(name: str, number: float, run: Run, default: Run, pair: tuple[str, str]) -> dict:
    tracks, others = run.tracks[pair], default.tracks[DEFAULT]
    found = probability(tracks.events, tracks.tracks)
    apart, error = difference((tracks.events, tracks.tracks), (others.events, others.tracks))
    return {
        "variation": name,
        "sperm_number": float(number),
        "tracks": found.tracks,
        "events": found.events,
        "probability": found.value,
        "standard_error": found.error,
        "difference": apart,
        "difference_error": error,
        "seconds": run.seconds,
    }


def _summary(lines: list[dict]) -> list[dict]:
    """For each variation: largest |ΔP| and where, the test, and the time over the default's."""
    found = []
    own = sum(r["seconds"] for r in lines if r["variation"] == "default")
    for name in dict.fromkeys(r["variation"] for r in lines if r["variation"] != "default"):
        of_name = [r for r in lines if r["variation"] == name and np.isfinite(r["difference"])]
        certain = [r for r in of_name if r["difference_error"] > 0]
        square = sum((r["difference"] / r["difference_error"]) ** 2 for r in certain)
        largest = max(of_name, key=lambda r: abs(r["difference"]))
        chance = float(chi2.sf(square, len(certain))) if certain else 1.0
        found.append(
            {
                "variation": name,
                "largest_difference": largest["difference"],
                "its_error": largest["difference_error"],
                "at_sperm_number": largest["sperm_number"],
                "chance": chance,
                "moves": chance < SMALL,
                "seconds_over_default": sum(r["seconds"] for r in of_name) / own if own else None,
            }
        )
    return found


def rows(result: dict) -> list[dict]:
    """The lines of a CSV file."""
    return result["rows"]


def table(result: dict) -> str:
    """Which variation moves the curve, then all probabilities."""
    lines = [
        f"{result['count']} fibers, {result['end']:g} W/U0, seed {result['seed']}",
        "variation                   moves?  largest dP       ±   at Sp     by chance  time",
    ]
    for s in result["summary"]:
        lines.append(
            f"{s['variation']:26} {'yes' if s['moves'] else 'no':>6} {s['largest_difference']:11.4f} "
            f"{s['its_error']:8.4f} {s['at_sperm_number']:8.3g} {s['chance']:12.2g} "
            f"{s['seconds_over_default']:6.2f}"
        )
    numbers = list(dict.fromkeys(r["sperm_number"] for r in result["rows"]))
    lines += ["", f"{'P at Sp =':26}" + "".join(f"{n:16.4g}" for n in numbers)]
    for name in dict.fromkeys(r["variation"] for r in result["rows"]):
        cells = [r for r in result["rows"] if r["variation"] == name]
        lines.append(
            f"{name:26}" + "".join(f"{r['probability']:9.4f} ±{r['standard_error']:.3f}" for r in cells)
        )
    return "\n".join(lines)


def draw(result: dict) -> Figure:
    """All variations on the same axes, a panel for each kind."""
    groups = {
        "what is counted": [*READINGS, "re-seeded", "another seed"],
        "hydrodynamics, torque, law": [
            *("free drain", "rpy with ambient strain", "torque as printed", "torque as printed, 2 Sp"),
            *("discrete rod", "beads repel"),
        ],
        "beads and starts": [
            name for name in VARIATIONS if "beads," in name or "tilt" in name or "start" in name
        ],
        "step and integrator": [name for name in VARIATIONS if "step" in name or "implicit" in name],
    }
    figure = new_figure(10.5, 7.5)
    panels = figure.subplots(2, 2, sharex=True, sharey=True).ravel()
    for axes, (title, names) in zip(panels, groups.items(), strict=True):
        for number, name in enumerate(["default", *names]):
            own = [r for r in result["rows"] if r["variation"] == name]
            x, y, e = (
                np.array([r[n] for r in own]) for n in ("sperm_number", "probability", "standard_error")
            )
            style = dict(color=COLOURS[number - 1], marker="o", markersize=3, linewidth=1)
            if name == "default":
                style = dict(color="black", marker="s", markersize=4, linewidth=2)
            if len(own):
                axes.errorbar(x, y, e, capsize=2, label=name, **style)
        axes.set(xscale="log", title=title)
        axes.legend(fontsize=7)
    panels[0].set(ylabel="buckling probability")
    panels[2].set(xlabel="Sp", ylabel="buckling probability")
    panels[3].set(xlabel="Sp")
    return figure
