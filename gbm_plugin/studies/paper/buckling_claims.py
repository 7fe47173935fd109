"""Every quantitative sentence of section 3 beside what `buckling` and its companions measured.

Reads the CSV files that they wrote into one folder (curve, shapes, transport, thresholds). No data point of the
paper's figures is in its text, and none is invented: a sentence about data that is not there is answered with that.
"""

from __future__ import annotations

import argparse
import csv
from pathlib import Path

import numpy as np
from scipy.stats import chi2

from ..study import option

FILES = ("curve", "shapes", "transport", "thresholds")
PLATEAU = 1e6
SEEN = 0.01  # share of events from which a shape counts as observed


def add_arguments(parser: argparse.ArgumentParser) -> None:
    option(parser, run, "results", "folder of the CSV files", type=Path)


def run(results: Path = Path("docs/results/buckling")) -> dict:
    """Claim, measured value and verdict, in the order of the text. OSError where a file is not there."""
    curve, shapes, transport, thresholds = (_read(Path(results) / f"{name}.csv") for name in FILES)
    found = [
        *_setting(curve),
        *_transport(transport),
        *_shapes(shapes),
        *_range(curve),
        *_plateau(curve),
        *_onset(curve, thresholds),
        *_errors(curve),
        {
            "claim": "the agreement with [13] is very good; below Sp = 400 very close to the experiment, above less",
            "measured": "the text has no data point of either",
            "agrees": "cannot be judged",
        },
    ]
    return {"rows": found}


def _read(path: Path) -> list[dict]:
    """Lines of a CSV file, numbers where they are numbers."""
    with open(path, newline="") as file:
        return [{name: _number(value) for name, value in line.items()} for line in csv.DictReader(file)]


def _number(text: str) -> float | str:
    try:
        return float(text)
    except ValueError:
        return text


def _verdict(claim: str, measured: str, agrees: bool) -> dict:
    return {"claim": claim, "measured": measured, "agrees": "yes" if agrees else "no"}


def _setting(curve: list[dict]) -> list[dict]:
    slender = curve[0]["slender_body_number"] / curve[0]["sperm_number"]
    other = curve[0]["slender_body_number_2a"] / curve[0]["sperm_number"]
    return [
        {
            "claim": "Sp = μL⁴S/(K^b a⁴) is the elasto-viscous number of [13]",
            "measured": f"as printed it has a dimension; 8πμSL⁴/(K^b c) is {slender:.2f} Sp with ε = a/L, "
            f"{other:.2f} Sp with 2a/L",
            "agrees": "no: taken as μSL⁴/K^b",
        }
    ]


def _transport(lines: list[dict]) -> list[dict]:
    fibers = [r for r in lines if r["kind"] == "fiber"]
    trapped = np.array([r["trapped_fraction"] for r in fibers])
    slope = np.array([r["exponent_meandering"] for r in fibers if r["exponent_meandering"] != ""])
    text = f"trapped at the end: {trapped.min():.0%} to {trapped.max():.0%} of the fibers; the others disperse with "
    text += f"an exponent of {slope.min():.2f} to {slope.max():.2f}" if len(slope) else "none are left"
    claim = "fibers are captured within vortices or translate along the manifolds between them"
    return [_verdict(claim, text, bool(trapped.max() > SEEN and trapped.min() < 1 - SEEN))]


def _shapes(lines: list[dict]) -> list[dict]:
    kinds = [name for name in lines[0] if name not in ("sperm_number", "events")]
    own = min(lines, key=lambda r: abs(r["sperm_number"] - 450))
    text = ", ".join(f"{name} {own[name]:.1%}" for name in kinds)
    seen = all(own[name] > SEEN for name in ("V", "U", "S"))
    found = [_verdict("V, U and S shapes are clearly observed for Sp = 450", f"of events: {text}", seen)]
    last = max(lines, key=lambda r: r["sperm_number"])
    counts, rest = ([_kinds(r, kinds) for r in (own, last)], [r["W"] + r["higher"] for r in (own, last)])
    text = f"{counts[0]} kinds above {SEEN:.0%} of events at {own['sperm_number']:g}, {counts[1]} at "
    text += f"{last['sperm_number']:g}; W and higher {rest[0]:.1%} and {rest[1]:.1%}"
    more = rest[1] > rest[0]
    return [*found, _verdict("for higher Sp more deformation shapes occur", text, more)]


def _kinds(line: dict, kinds: list[str]) -> int:
    return sum(line[name] > SEEN for name in kinds)


def _range(curve: list[dict]) -> list[dict]:
    numbers = [r["sperm_number"] for r in curve]
    decades = np.log10(max(numbers) / min(numbers))
    text = f"{len(numbers)} values over {decades:.0f} decades"
    return [
        _verdict("Sp is varied over eight decades, up to 10⁸", text, max(numbers) >= 1e8 and decades >= 8)
    ]


def _plateau(curve: list[dict]) -> list[dict]:
    own = [r for r in curve if r["sperm_number"] >= PLATEAU and r["standard_error"] > 0]
    p, e = (np.array([r[name] for r in own]) for name in ("probability", "standard_error"))
    mean = (p / e**2).sum() / (1 / e**2).sum()
    chance = chi2.sf((((p - mean) / e) ** 2).sum(), len(own) - 1)
    text = (
        f"{mean:.3f} ± {(1 / e**2).sum() ** -0.5:.3f}; {len(own)} values differ as they would by chance in "
    )
    return [
        _verdict(
            "a constant probability is attained above Sp = 10⁶", f"{text}{chance:.0%} of cases", chance > 0.01
        )
    ]


def _onset(curve: list[dict], thresholds: list[dict]) -> list[dict]:
    first = min(
        (r for r in curve if r["probability"] > 3 * r["standard_error"] > 0), key=lambda r: r["sperm_number"]
    )
    below = max((r["sperm_number"] for r in curve if r["sperm_number"] < first["sperm_number"]), default=0.0)
    own = next(r for r in thresholds if (r["beads"], r["mobility"], r["flow"]) == (6, "rpy", "cellular"))
    text = f"P leaves zero between {below:g} and {first['sperm_number']:g}; the U begins to grow at "
    text += f"{own['threshold_1']:.1f} in the strongest compression of the cell, and needs more to grow in passing"
    claim = "buckling occurs beyond a critical strain rate, with a U-shaped mode"
    return [_verdict(claim, text, own["threshold_1"] < first["sperm_number"])]


def _errors(curve: list[dict]) -> list[dict]:
    ratio = [r["standard_error"] / r["binomial_error"] for r in curve if r["binomial_error"] > 0]
    text = f"true only of independent tracks: the spread between fibers is {min(ratio):.1f} to {max(ratio):.1f} times "
    return [
        _verdict(
            "statistical errors are inversely proportional to √N_events", text + "the binomial error", False
        )
    ]


def rows(result: dict) -> list[dict]:
    """The lines of a CSV file."""
    return result["rows"]


def table(result: dict) -> str:
    """A table in Markdown."""
    lines = ["| the paper | measured | agrees? |", "|---|---|---|"]
    return "\n".join(
        [*lines, *(f"| {r['claim']} | {r['measured']} | {r['agrees']} |" for r in result["rows"])]
    )
