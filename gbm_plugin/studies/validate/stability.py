"""Hard cases: what is asked of fibers, flows and forces, and what happens.

Every case is handled, or refused in one line before anything is spoilt; nothing returns NaN silently. A row a case:
whether all is finite, the error of the length (bead spacings), the energy at the end over that at the start, sub-steps
in a step, and processor time (wall time where OpenFOAM runs).
"""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from importlib import import_module

from ...threads import limited_to
from ..hard.case import Case
from ..study import option, steps

PARTS = ("fibers", "flows", "openfoam")


def add_arguments(parser: argparse.ArgumentParser) -> None:
    option(parser, run, "only", f"parts of {', '.join(PARTS)} (default: all)", choices=PARTS, metavar="PART")
    option(parser, run, "quick", "without the slow cases and without OpenFOAM, within a minute")


def cases(only: Sequence[str] = PARTS, quick: bool = False) -> list[Case]:
    """The cases of some parts, without the slow ones and those that run OpenFOAM where it is to be quick."""
    found = [case for part in only for case in import_module(f"gbm_plugin.studies.hard.{part}").CASES]
    return [case for case in found if not (quick and (case.slow or case.openfoam))]


def run(only: Sequence[str] = PARTS, quick: bool = False) -> dict:
    """A row for each case."""
    chosen = cases(only, quick)
    with limited_to(1):
        return {"rows": [case.measure() for case in steps(chosen, len(chosen), "cases")]}


def rows(result: dict) -> list[dict]:
    """The lines of a CSV file."""
    return result["rows"]


def table(result: dict) -> str:
    """A line a case, by kind, and how many are as they must be."""
    found, lines, kind = result["rows"], [], None
    for row in found:
        if row["kind"] != kind:
            kind = row["kind"]
            lines += [
                "",
                f"{kind:66s} {'outcome':8s} {'length':>7s} {'energy':>8s} {'sub-steps':>9s} {'s':>7s}",
            ]
        cells = [
            _cell(row, "length_error", "7.0e"),
            _cell(row, "energy", "8.1e"),
            _cell(row, "sub_steps", "9.3g"),
        ]
        lines.append(
            f"  {row['asked']:64s} {row['outcome']:8s} {' '.join(cells)} {row['seconds']:7.2f}{_words(row)}"
        )
    wrong = [row for row in found if row["outcome"].startswith("WRONG")]
    counts = {word: sum(row["outcome"] == word for row in found) for word in ("handled", "refused")}
    lines += [
        "",
        f"{len(found)} cases: {counts['handled']} handled, {counts['refused']} refused, {len(wrong)} wrong",
    ]
    return "\n".join(lines[1:])


def _cell(row: dict, name: str, form: str) -> str:
    width = int(form.partition(".")[0])
    return f"{row[name]:{form}}" if name in row else " " * width


def _words(row: dict) -> str:
    extra = {
        "largest_step_over_eq10": "longest {:.2g} × eq. (10)",
        "largest_step": "largest {:.2g}",
        "kmax_eta": "k_max η {:.2g}",
        "drift": "c = {:.3f}",
    }
    words = [text.format(row[name]) for name, text in extra.items() if name in row]
    words += [text for text in (row["said"], row["note"]) if text]
    return "  " + "; ".join(words) if words else ""
