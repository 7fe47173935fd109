"""Which tests run: `pytest` alone those of pure Python, `pytest --all` also those that need OpenFOAM or take long,
`pytest --exhaustive` also further cases of what another test shows, and `pytest FILES` all in them.

Markers say which these are. A -m or -k of one's own is taken as it is. OpenFOAM's programs
refuse to run in a test that is not marked, but for foamDictionary, by which every case is read.
"""

from __future__ import annotations

import os
import tempfile
from pathlib import Path

import pytest

NOT_QUICK, FURTHER = ("openfoam", "slow"), ("exhaustive",)  # markers
PROGRAMS = ["blockMesh", "boxFoam", "decomposePar", "foamToVTK", "icoFoam", "mpirun"]
PROGRAMS += ["pimpleFoam", "pisoFoam", "postProcess", "reconstructPar", "renumberMesh"]
REFUSAL = '#!/bin/sh\necho "this test runs ${0##*/} and is not marked openfoam" >&2\nexit 1\n'

_refusals = tempfile.TemporaryDirectory(prefix="gbm-tests-")


def pytest_addoption(parser: pytest.Parser) -> None:
    parser.addoption("--all", action="store_true", help="also tests that need OpenFOAM or take long")
    parser.addoption("--exhaustive", action="store_true", help="every test: also further cases of another's")


def pytest_configure(config: pytest.Config) -> None:
    named = config.args_source is not pytest.Config.ArgsSource.TESTPATHS
    if named or config.option.markexpr or config.option.keyword:
        config.option.exhaustive = True  # xdist hands the options to its workers
    for name in PROGRAMS:
        program = Path(_refusals.name) / name
        program.write_text(REFUSAL)
        program.chmod(0o755)


def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
    if config.option.exhaustive:
        return
    names = FURTHER if config.option.all else NOT_QUICK + FURTHER
    left_out = [item for item in items if any(item.get_closest_marker(name) for name in names)]
    config.hook.pytest_deselected(items=left_out)
    items[:] = [item for item in items if item not in set(left_out)]


@pytest.hookimpl(wrapper=True)
def pytest_runtest_protocol(item: pytest.Item):
    path = os.environ["PATH"]
    if not item.get_closest_marker("openfoam"):
        os.environ["PATH"] = os.pathsep.join([_refusals.name, path])
    try:
        return (yield)
    finally:
        os.environ["PATH"] = path
