"""Copies of a case with other numbers, for benchmarks and comparisons."""

from __future__ import annotations

import shutil
from collections.abc import Mapping
from pathlib import Path

from PyFoam.RunDictionary.ParsedParameterFile import ParsedParameterFile

HEADER = "FoamFile { version 2.0; format ascii; class dictionary; object dictionary; }\n"


def copy_case(
    case: Path, target: Path, entries: Mapping[str, Mapping[str, object]], texts: Mapping[str, str]
) -> None:
    """A new case of the dictionaries of `case`, without its mesh and results.

    entries: {dictionary: {entry: value}}, changed in place; texts: {dictionary: content}, replaced as a whole.
    """
    target.mkdir()
    for part in ("0.orig", "constant", "system"):
        shutil.copytree(case / part, target / part, ignore=shutil.ignore_patterns("polyMesh"))
    for name, text in texts.items():
        (target / name).write_text(HEADER + text)
    for name, values in entries.items():
        dictionary = ParsedParameterFile(str(target / name))
        for entry, value in values.items():
            dictionary[entry] = value
        dictionary.writeFile()
