"""Small cases made from the default one, and real OpenFOAM runs of them."""

from __future__ import annotations

import hashlib
import logging
import os
import re
import shutil
import subprocess
import sys
import tempfile
import traceback
from collections.abc import Callable
from pathlib import Path
from typing import NoReturn

import numpy as np
import PyFoam.LogAnalysis.FoamLogAnalyzer  # noqa: F401  by a run, and so once for all that are forked here
import pytest

import gbm_plugin.run.openfoam  # noqa: F401  likewise
from gbm_plugin.case.made import RECORD
from gbm_plugin.case.openfoam import command, environment
from gbm_plugin.case.prepare import initial_fields, make_mesh, utility
from gbm_plugin.case.scene import read_scene
from gbm_plugin.cli import main
from gbm_plugin.output.recording import Recorder

from sample_records import FAMILIES, SCENE, records

pytest_plugins = ("selection", "hang")

os.environ.update(OMPI_MCA_mpi_yield_when_idle="1")  # ranks that wait leave their core to others

DEFAULT_CASE = Path(__file__).parents[1] / "openfoam_case"

# solver tolerances at which runs on different ranks can be compared
TIGHT = """solvers
{
    "p|pFinal" { solver PCG; preconditioner DIC; tolerance 1e-12; relTol 0; maxIter 5000; }
    "U|UFinal" { solver PBiCGStab; preconditioner DILU; tolerance 1e-12; relTol 0; }
}
PIMPLE { momentumPredictor yes; nOuterCorrectors 1; nCorrectors 2; pRefCell 0; pRefValue 0; }
"""

HEADER = "FoamFile { version 2.0; format ascii; class dictionary; object dictionary; }\n"

# a family that crosses faces of the box and of ranks within a few steps
FIBERS = """{coupling}
recordInterval 1;
interpolation {interpolation};
integrator {integrator};
families {{ {families} }}
"""
FAMILY = "test { count 12; beads 6; length 1.2; bendingStiffness 1e-4; seed 3; }"


def set_entry(path: Path, name: str, value: str) -> None:
    """Replace the value of an entry that stands at the start of a line."""
    text, found = re.subn(
        rf"^(\s*){re.escape(name)}(\s+)[^;]*;", rf"\g<1>{name}\g<2>{value};", path.read_text(), flags=re.M
    )
    assert found, f"{name} is not in {path}"
    path.write_text(text)


def set_families(case: Path, words: str) -> None:
    """Replace the fibers of a case."""
    path = case / "constant/fiberProperties"
    head, found, _ = path.read_text().partition("families")
    assert found
    path.write_text(f"{head}families {{ {words} }}\n")


def make_case(
    path: Path,
    *,
    cells: int = 16,
    steps: int = 20,
    time_step: float = 0.02,
    write_every: int = 10,
    transport: str = "socket",
    timeout: float = 300,
    interpolation: str = "trilinear",
    integrator: str = "ab3",
    families: str = FAMILY,
    fv_options: str | None = None,
    initial: str | None = None,
    tight: bool = True,
    prepared: bool = True,
    application: str = "boxFoam",
    viscosity: float = 0.01,
) -> Path:
    """A small copy of the default case: the same dictionaries, other numbers."""
    path.mkdir(parents=True)
    for folder in ("0.orig", "constant", "system"):
        shutil.copytree(DEFAULT_CASE / folder, path / folder, ignore=shutil.ignore_patterns("polyMesh"))
    control = path / "system/controlDict"
    set_entry(control, "application", application)
    set_entry(path / "constant/transportProperties", "nu", repr(viscosity))
    set_entry(control, "deltaT", repr(time_step))
    set_entry(control, "endTime", repr(steps * time_step))
    set_entry(control, "writeInterval", str(write_every))
    set_entry(path / "system/blockMeshDict", "n", str(cells))
    set_entry(path / "system/initialFieldDict", "maxWavenumber", "4")
    if tight:
        (path / "system/fvSolution").write_text(HEADER + TIGHT)
    if fv_options is not None:
        (path / "constant/fvOptions").write_text(HEADER + fv_options)
    if initial is not None:
        (path / "system/initialFieldDict").write_text(HEADER + initial)
    coupling = f"coupling {{ transport {transport}; timeout {timeout:g}; }}"
    words = FIBERS.format(
        coupling=coupling, interpolation=interpolation, integrator=integrator, families=families
    )
    (path / "constant/fiberProperties").write_text(HEADER + words)
    if prepared:
        prepare(path)
    return path


_store = tempfile.TemporaryDirectory(prefix="gbm-tests-")


def prepare(path: Path) -> None:
    """Mesh and initial fields; a copy, where a case before had the same."""
    words = "".join((path / "system" / name).read_text() for name in ("blockMeshDict", "initialFieldDict"))
    kept = Path(_store.name) / hashlib.sha256(words.encode()).hexdigest()
    parts = ("constant/polyMesh", "0")
    if kept.is_dir():
        for part in parts:  # newer than the dictionaries, or a run would make them again
            shutil.copytree(kept / part, path / part, copy_function=shutil.copyfile)
        shutil.copyfile(kept / RECORD, path / RECORD)
    else:
        make_mesh(path)
        initial_fields(read_scene(path))
        for part in parts:
            shutil.copytree(path / part, kept / part)
        shutil.copyfile(path / RECORD, kept / RECORD)


def divide(case: Path, ranks: int, n: tuple | None) -> None:
    """Decompose a prepared case into n[0] x n[1] x n[2] blocks, or with None into ragged bodies of cells;
    of a case that is not prepared yet, only say so in decomposeParDict."""
    d = case / "system/decomposeParDict"
    set_entry(d, "numberOfSubdomains", str(ranks))
    if n is None:  # ragged bodies of cells, no planes
        i, j, k = np.indices(read_scene(case).cells).transpose(0, 3, 2, 1).reshape(3, -1)  # x fastest
        rank = (i // 5 + j // 3 + (k + i) // 4) % ranks
        header = "FoamFile { version 2.0; format ascii; class labelList; object ranks; }\n"
        (case / "constant/ranks").write_text(header + f"{len(rank)}({' '.join(map(str, rank))})\n")
        set_entry(d, "method", "manual")
        d.write_text(d.read_text() + 'manualCoeffs { dataFile "ranks"; }\n')
    else:
        d.write_text(re.sub(r"n\s+\(1 1 2\);", f"n ({n[0]} {n[1]} {n[2]});", d.read_text()))
    if (case / "constant/polyMesh").is_dir():
        utility(case, "decomposePar", "-force")


@pytest.fixture
def case(tmp_path) -> Callable[..., Path]:
    """make_case in a folder of its own; several by giving names."""

    def make(name: str = "case", **options) -> Path:
        return make_case(tmp_path / name, **options)

    return make


def gbm(*arguments: str, **options) -> subprocess.CompletedProcess:
    """The command line, as a user calls it."""
    return subprocess.run(
        [sys.executable, "-m", "gbm_plugin.cli", *map(str, arguments)],
        capture_output=True,
        text=True,
        **options,
    )


def run_case(path: Path, *options: str) -> subprocess.CompletedProcess:
    """`gbm run` that must succeed: in a fork of this process, which has already imported what it needs, half of the
    processor time of a small run."""
    words = ["run", *map(str, (path, *options))]
    with tempfile.TemporaryFile("w+") as out, tempfile.TemporaryFile("w+") as err:
        child = os.fork()
        if child == 0:
            _become(main, words, out.fileno(), err.fileno())
        _, status = os.waitpid(child, 0)
        out.seek(0), err.seek(0)
        code = os.waitstatus_to_exitcode(status)
        done = subprocess.CompletedProcess(words, code, out.read(), err.read())
    assert done.returncode == 0, done.stderr
    return done


def _become(program: Callable[[list[str]], int], words: list[str], out: int, err: int) -> NoReturn:
    """End this process as the program would, with its output in these files."""
    os.dup2(out, 1)
    os.dup2(err, 2)
    sys.stdout, sys.stderr = (os.fdopen(number, "w", closefd=False) for number in (1, 2))
    logging.getLogger().handlers.clear()  # the test's own
    code = 70
    try:
        code = program(words)
    except BaseException:
        traceback.print_exc()
    finally:
        sys.stdout.flush(), sys.stderr.flush()
        os._exit(code)


def application(path: Path) -> str:
    """The solver that a case names, whatever else is wrong with it."""
    return re.search(r"^application\s+(\w+);", (path / "system/controlDict").read_text(), re.MULTILINE).group(
        1
    )


def solver_log(path: Path) -> Path:
    """Where the solver of a case leaves its log."""
    return path / f"log.{application(path)}"


def start_solver(path: Path, ranks: int = 1) -> subprocess.Popen:
    """The solver of a case alone."""
    with solver_log(path).open("w") as log:
        argv = command(application(path), path, ranks)
        return subprocess.Popen(argv, env=environment(), stdout=log, stderr=subprocess.STDOUT)


@pytest.fixture
def write(tmp_path):
    """Write a recording of the steps given, 0.1 s apart, to <folder>/fibers.h5 and return its path."""

    def write(steps, folder="0"):
        path = tmp_path / "postProcessing" / "fibers" / folder / "fibers.h5"
        with Recorder(path, FAMILIES, **SCENE) as recorder:
            for step in steps:
                recorder.append(step, 0.1 * step, records(step))
        return path

    return write
