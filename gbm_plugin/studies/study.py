"""What a study is: one module in one of the folders beside this one, with

    add_arguments(parser)      its own arguments, beside their code (`option` takes a default from `run`)
    run(**arguments) -> dict   the measurement; long ones show how far they are (`steps`) and can be resumed
    rows(result) -> list       dictionaries of plain numbers and words: the lines of `--csv`
    table(result) -> str       for a person
    draw(result) -> Figure     for `--figure`; a study without one has no picture

The first line of its docstring is its title. `gbm study` finds it by its file: convergence.py is `convergence`,
flow_one.py is `flow-one`.
"""

from __future__ import annotations

import argparse
import ast
import csv
import inspect
import json
import logging
import sys
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from functools import cache
from importlib import import_module
from pathlib import Path
from types import ModuleType

from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn

from ..report.style import styled

GROUPS = {
    "validate": "The coupling and its engines judged: by each other, by analytic flows, by averages",
    "bench": "Speed beside error; ratios within one run",
    "paper": "The figures of the paper, and beyond them",
}
CONTRACT = {"add_arguments", "run", "rows", "table"}


@dataclass(frozen=True)
class Study:
    """Where a study is, and what it says of itself; it is imported when it is used."""

    group: str
    path: Path
    title: str  # the first line of its docstring

    @property
    def name(self) -> str:
        return self.path.stem.replace("_", "-")

    def load(self) -> ModuleType:
        return import_module(f"{__package__}.{self.group}.{self.path.stem}")


@cache
def find_studies() -> dict[str, Study]:
    """All studies by name, in the order of the groups."""
    found = {}
    for group in GROUPS:
        for path in sorted((Path(__file__).parent / group).glob("*.py")):
            module = ast.parse(path.read_text())
            if {n.name for n in module.body if isinstance(n, ast.FunctionDef)} >= CONTRACT:
                title = (ast.get_docstring(module) or "").partition("\n")[0]
                found[path.stem.replace("_", "-")] = Study(group, path, title)
    return found


def listing(studies: Mapping[str, Study]) -> str:
    """The names and titles of all studies, by group."""
    width = max(map(len, studies), default=0)
    lines = ["gbm study NAME [options]; gbm study NAME --help has them, with units and defaults"]
    for group, title in GROUPS.items():
        lines += ["", f"{group}: {title}"]
        lines += [f"    {s.name:<{width}}  {s.title}" for s in studies.values() if s.group == group]
    return "\n".join(lines)


def option(parser: argparse.ArgumentParser, run: Callable, name: str, text: str, **words) -> argparse.Action:
    """An argument `--name` of a study, or the positional `case`, whose default and type are those of `run`'s
    parameter."""
    default = inspect.signature(run).parameters[name].default
    if default is inspect.Parameter.empty:  # a case to judge
        return parser.add_argument(name, nargs="?", default=".", type=Path, help=text, **words)
    flag = f"--{name.replace('_', '-')}"
    if isinstance(default, bool):
        return parser.add_argument(flag, action=argparse.BooleanOptionalAction, default=default, help=text)
    listed = isinstance(default, (tuple, list))
    shown = " ".join(map(str, default)) if listed else default
    if listed and default:
        words = {"nargs": "+", "type": type(default[0])} | words
    elif not listed and default is not None and "choices" not in words:
        words = {"type": type(default)} | words
    text = f"{text} (default: {shown})" if default is not None and len(str(shown)) < 60 else text
    return parser.add_argument(flag, default=default, help=text.replace("%", "%%"), **words)


@contextmanager
def quiet() -> Iterator[None]:
    """Runs in here do not say what they do, but what is wrong."""
    log = logging.getLogger("gbm_plugin")
    level = log.level
    log.setLevel(logging.ERROR)
    try:
        yield
    finally:
        log.setLevel(level)


def steps(work: Iterable, total: int, title: str) -> Iterator:
    """The items of `work`, of which there are `total`, with a bar on a terminal that says how long it will take;
    elsewhere nothing."""
    console = Console(file=sys.stderr)
    columns = (TextColumn("{task.description}"), BarColumn(), MofNCompleteColumn(), TimeRemainingColumn())
    with Progress(*columns, console=console, disable=not console.is_terminal) as bar:
        task = bar.add_task(title, total=total)
        for item in work:
            yield item
            bar.advance(task)


def write(study: ModuleType, result: dict, name: Path | str) -> list[Path]:
    """NAME.csv, NAME.json and, of a study that draws, NAME.png; returns those written."""
    ends = (".csv", ".json", ".png") if hasattr(study, "draw") else (".csv", ".json")
    paths = {end: Path(f"{name}{end}") for end in ends}
    paths[".csv"].parent.mkdir(parents=True, exist_ok=True)
    write_csv(study, result, paths[".csv"])
    paths[".json"].write_text(json.dumps(result, indent=2) + "\n")
    if ".png" in paths:
        draw(study, result, paths[".png"])
    return list(paths.values())


def write_csv(study: ModuleType, result: dict, path: Path | str) -> None:
    """The rows of a result, unrounded; a column for every name in them."""
    with open(path, "w", newline="") as file:
        rows = study.rows(result)
        writer = csv.DictWriter(file, list(dict.fromkeys(name for row in rows for name in row)))
        writer.writeheader()
        writer.writerows(rows)


def compact(values: Iterable[float]) -> list[float]:
    """Five digits of each number: enough for a curve in a figure, and a third of the length in a file."""
    return [float(f"{value:.5g}") for value in values]


def draw(study: ModuleType, result: dict, path: Path | str) -> None:
    """The figure of a result."""
    with styled():
        study.draw(result).savefig(path)
