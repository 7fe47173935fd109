"""The floors of the package: every import points down, and none goes round."""

from __future__ import annotations

import ast
import graphlib
import re
from pathlib import Path

import pytest

PACKAGE = Path(__file__).parents[1] / "gbm_plugin"

# from the ground up; folders of one line do not know each other, but for the words of the fiber model
FLOORS = [
    {"arrays", "errors", "files", "scales", "compiled", "sampling", "signals", "simd", "threads"},
    {"fiber", "flow", "case", "statistics"},
    {"spectral", "output"},
    {"report", "fleet"},
    {"coupling", "prepare"},
    {"run"},
    {"studies"},
    {"cli"},
]
# the words of the model, and nothing else of it
ALLOWED = {(folder, "gbm_plugin.fiber.model") for folder in ("case", "statistics")}


def modules() -> dict[str, Path]:
    """All modules by dotted name."""
    found = {}
    for path in PACKAGE.rglob("*.py"):
        parts = path.relative_to(PACKAGE.parent).with_suffix("").parts
        found[".".join(parts[:-1] if parts[-1] == "__init__" else parts)] = path
    return found


def imports(name: str, path: Path, known: dict[str, Path]) -> set[str]:
    """The modules of the package that a module imports, wherever in its text."""
    package = name.split(".") if path.name == "__init__.py" else name.split(".")[:-1]
    found: set[str] = set()
    for node in ast.walk(ast.parse(path.read_text())):
        if isinstance(node, ast.Import):
            found |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom):
            base = package[: len(package) - node.level + 1] if node.level else []
            source = ".".join([*base, *filter(None, [node.module])])
            for alias in node.names:
                inner = f"{source}.{alias.name}"
                found.add(inner if inner in known else source)
    return {module for module in found if module in known and module != "gbm_plugin"}


KNOWN = modules()
GRAPH = {name: imports(name, path, KNOWN) for name, path in KNOWN.items()}


def floor(module: str) -> int:
    folder = module.split(".")[1]
    return next(number for number, names in enumerate(FLOORS) if folder in names)


@pytest.mark.parametrize("name", sorted(name for name in KNOWN if name.count(".")))
def test_imports_point_down(name):
    folder = name.split(".")[1]
    for target in GRAPH[name]:
        other = target.split(".")[1]
        if other != folder and (folder, target) not in ALLOWED:
            assert floor(target) < floor(name), f"{name} imports {target}"


def test_no_circle():
    """Within the folders either. A package and its own modules count as one where it only gathers their names."""
    inner = {
        name: {t for t in targets if not name.startswith(f"{t}.")}
        for name, targets in GRAPH.items()
        if name.count(".")
    }
    try:
        list(graphlib.TopologicalSorter(inner).static_order())
    except graphlib.CycleError as error:
        pytest.fail(" <- ".join(error.args[1]))


def test_the_floors_hold_every_folder():
    folders = {name.split(".")[1] for name in KNOWN if name.count(".")}
    assert folders == set().union(*FLOORS)


def test_every_source_is_in_one_unit():
    """What no unit includes would be missed only where its name is looked up: as an unknown word of a dictionary."""
    root = PACKAGE / "openfoam"
    for part in (root, root / "boxFoam"):
        units = [part / line for line in (part / "Make/files").read_text().split() if line.endswith(".C")]
        included = [
            part / name for unit in units for name in re.findall(r'#include "(.*\.C)"', unit.read_text())
        ]
        files = {file for file in part.rglob("*.C") if not {"lnInclude", "units"} & set(file.parts)}
        if part == root:
            files -= set((root / "boxFoam").rglob("*.C"))
        assert sorted(included) == sorted(files)
