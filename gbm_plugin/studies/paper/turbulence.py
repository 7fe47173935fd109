"""All that there is on fibers in turbulence: the studies of section 4, and those that apply to a run made at once.

Without a CASE, their list. With one or more, each study that applies is made of all of them and written into --into:
NAME.csv, NAME.json and NAME.png, as `gbm study NAME CASE --save` does.
"""

from __future__ import annotations

import argparse
import inspect
from collections.abc import Sequence
from pathlib import Path
from types import ModuleType

from ..recorded import Since, add_run_arguments
from ..study import find_studies, option, write

NAMES = ("persistence", "curvature", "end-to-end", "shapes", "rods", "dynamics", "gathered")
OTHERS = ("claims", "flows", "flow-one", "flow-one-openfoam", "flow-two")  # that do not take a run


def add_arguments(parser: argparse.ArgumentParser) -> None:
    add_run_arguments(parser, run)
    parser.set_defaults(cases=[])
    option(parser, run, "into", "folder of the results (default: report in the first CASE)", type=Path)


def run(
    cases: Sequence[Path] = (),
    since: Since = None,
    records: int = 400,
    families: Sequence[str] = (),
    into: Path | None = None,
) -> dict:
    """The list, or what was written of each study and why not of others. FileNotFoundError where there is no folder."""
    studies = find_studies()
    if not cases:
        there = [name for name in (*NAMES, *OTHERS) if name in studies]
        return {"rows": [{"study": name, "what": studies[name].title} for name in there]}
    for case in cases:
        if not Path(case).is_dir():
            raise FileNotFoundError(f"there is no folder {case}")
    folder = into or Path(cases[0]) / "report"
    found = []
    for name in NAMES:
        row = {"study": name, "what": studies[name].title}
        found.append(row | make(studies[name].load(), name, folder, cases, since, records, families))
    return {"rows": found}


def make(
    study: ModuleType,
    name: str,
    folder: Path,
    cases: Sequence[Path],
    since: Since,
    records: int,
    families: Sequence[str],
) -> dict:
    """Written files and the table, or the reason why it does not apply."""
    words = {"since": since, "families": families} | ({} if name == "rods" else {"records": records})
    known = inspect.signature(
        study.run
    ).parameters  # rods take all records, what was gathered has its own start
    try:
        result = study.run(cases, **{n: value for n, value in words.items() if n in known})
        paths = write(study, result, folder / name)
    except (ValueError, FileNotFoundError) as error:
        return {"files": "", "not_made": str(error), "text": ""}
    return {"files": " ".join(p.name for p in paths), "not_made": "", "text": study.table(result)}


def rows(result: dict) -> list[dict]:
    """The lines of a CSV file."""
    return [{k: v for k, v in r.items() if k != "text"} for r in result["rows"]]


def table(result: dict) -> str:
    """The list, or what was made, as text."""
    width = max(len(r["study"]) for r in result["rows"])
    if "files" not in result["rows"][0]:
        lines = [f"    {r['study']:<{width}}  {r['what']}" for r in result["rows"]]
        return "\n".join(
            ["gbm study NAME CASE [CASE ...]; gbm study turbulence CASE makes all that apply", *lines]
        )
    return "\n".join(
        f"    {r['study']:<{width}}  {r['files'] or 'not made: ' + r['not_made']}" for r in result["rows"]
    )
