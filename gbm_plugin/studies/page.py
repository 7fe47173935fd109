"""The page of a run: what `gbm report` drew, and every study of fibers in turbulence that applies to it."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from ..report.page import Section, write_page
from .paper import turbulence

RECORDS = 200  # of which the studies of a page are made: enough for the eye
FIGURES = {
    "fibers": "Fibers",
    "energy": "Energy and dissipation",
    "spectrum": "Spectrum",
    "end_to_end": "End-to-end distance",
}


def make_page(case: Path, key: dict, summary: Sequence[str]) -> Path:
    """Write report/index.html of a case of which `report` gave the key figures; returns its path."""
    folder = case / "report"
    studies = turbulence.run([case], records=RECORDS) if key["fibers"] and key["flow"] else {"rows": []}
    sections = [Section("Averages", text="\n".join(summary))] if summary else []
    sections += [
        Section(title, [folder / f"{name}.png"])
        for name, title in FIGURES.items()
        if f"{name}.png" in key["files"]
    ]
    for row in studies["rows"]:
        if row["files"]:
            note = f"{row['what']} Numbers: {row['study']}.csv, {row['study']}.json"
            sections.append(Section(row["study"], [folder / f"{row['study']}.png"], row["text"], note))
    missing = [
        *key["not_drawn"],
        *(f"{r['study']}: {r['not_made']}" for r in studies["rows"] if r["not_made"]),
    ]
    if missing:
        sections.append(Section("Not made", text="\n".join(missing)))
    return write_page(folder / "index.html", key["case"], sections)
