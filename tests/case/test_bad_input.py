"""Mistakes in a case: one line that names the file, the entry, and what is allowed; never a traceback."""

from __future__ import annotations

import re
import shutil

import numpy as np
import pytest

from gbm_plugin.cli import main
from gbm_plugin.output.recording import open_recording

from conftest import gbm, make_case, set_entry

FIBERS, CONTROL = "constant/fiberProperties", "system/controlDict"
NU, OPTIONS = "constant/transportProperties", "constant/fvOptions"


@pytest.fixture
def case(tmp_path):
    return make_case(tmp_path / "case", prepared=False)


def info(case, capsys) -> str:
    """`gbm info` in this process: its one line of error."""
    assert main(["info", str(case)]) == 1
    said = capsys.readouterr()
    assert "Traceback" not in said.err + said.out
    lines = said.err.splitlines()
    assert len(lines) == 1 and lines[0].startswith("gbm info: "), said.err
    return lines[0]


def edit(path, old: str | re.Pattern, new: str) -> None:
    """Replace a text, or the match of a pattern, which must be there once."""
    pattern = re.compile(re.escape(old)) if isinstance(old, str) else old
    text, found = pattern.subn(lambda _: new, path.read_text())
    assert found == 1, f"{old!r} is {found} times in {path}"
    path.write_text(text, errors="surrogateescape")


ALL = re.compile(r"\A.*\Z", re.S)
FAMILIES = re.compile(r"families \{.*\}", re.S)

# file, what is there, what is put there, what the line must say beside the file
MISTAKES = {
    "unknown entry": (
        FIBERS,
        "recordInterval",
        "recordIntervall",
        ["'recordIntervall'", "allowed:", "recordInterval "],
    ),
    "unknown entry of a family": (FIBERS, "seed 3;", "seeds 3;", ["test", "'seeds'", "allowed:", " seed "]),
    "unknown entry of coupling": (
        FIBERS,
        "timeout 300;",
        "timeOut 60;",
        ["coupling", "'timeOut'", "allowed:", "timeout"],
    ),
    "missing entry": (FIBERS, "beads 6;", "", ["'beads'", "is missing"]),
    "missing families": (FIBERS, "families {", "groups {", ["'families'"]),
    "no family": (FIBERS, FAMILIES, "families { }", ["'families'", "at least one"]),
    "families that are no dictionary": (FIBERS, FAMILIES, "families 3;", ["'families'", "braces"]),
    "family that is no dictionary": (FIBERS, FAMILIES, "families { test 3; }", ["'test'", "braces"]),
    "one bead": (FIBERS, "beads 6;", "beads 1;", ["'beads'", "is 1", "at least 2"]),
    "half a bead": (FIBERS, "beads 6;", "beads 6.5;", ["'beads'", "6.5", "whole number"]),
    "no fiber": (FIBERS, "count 12;", "count 0;", ["'count'", "is 0", "at least 1"]),
    "no length": (FIBERS, "length 1.2;", "length 0;", ["'length'", "is 0", "greater than 0"]),
    "negative length": (FIBERS, "length 1.2;", "length -1;", ["'length'", "-1", "greater than 0"]),
    "length and radius": (
        FIBERS,
        "length 1.2;",
        "length 1.2; radius 0.1;",
        ["exactly one", "'length'", "'radius'"],
    ),
    "neither length nor radius": (FIBERS, "length 1.2;", "", ["exactly one", "'length'", "'radius'"]),
    "negative stiffness": (FIBERS, "Stiffness 1e-4;", "Stiffness -1;", ["'bendingStiffness'", "at least 0"]),
    "stiffness twice": (
        FIBERS,
        "1e-4;",
        "1e-4; youngModulus 1;",
        ["exactly one", "'bendingStiffness'", "'youngModulus'"],
    ),
    "no stiffness": (
        FIBERS,
        "bendingStiffness 1e-4;",
        "",
        ["exactly one", "'bendingStiffness'", "'youngModulus'"],
    ),
    "NaN": (FIBERS, "length 1.2;", "length nan;", ["'length'", "finite number"]),
    "word for a number": (FIBERS, "count 12;", "count many;", ["'count'", "'many'", "a number is needed"]),
    "huge number": (FIBERS, "count 12;", "count 1e400;", ["'count'", "finite number"]),
    "list for a number": (FIBERS, "count 12;", "count (1 2 x);", ["'count'", "a number is needed"]),
    "dictionary for a number": (FIBERS, "count 12;", "count { a 1; }", ["'count'", "a number is needed"]),
    "entry without a value": (FIBERS, "count 12;", "count ;", ["count"]),
    "negative seed": (FIBERS, "seed 3;", "seed -3;", ["'seed'", "at least 0"]),
    "no density": (FIBERS, "recordInterval 1;", "recordInterval 1; rho 0;", ["'rho'", "greater than 0"]),
    "no interval": (FIBERS, "recordInterval 1;", "recordInterval 0;", ["'recordInterval'", "at least 1"]),
    "integrator": (
        FIBERS,
        "integrator ab3;",
        "integrator rk4;",
        ["'integrator'", "'rk4'", "ab3 implicit auto"],
    ),
    "mobility": (
        FIBERS,
        "integrator ab3;",
        "mobility slender;",
        ["'mobility'", "'slender'", "freeDrain rpy"],
    ),
    "bending torque": (
        FIBERS,
        "integrator ab3;",
        "bendingTorque half;",
        ["'bendingTorque'", "consistent asPrinted"],
    ),
    "curvature law": (FIBERS, "integrator ab3;", "curvatureLaw tan;", ["'curvatureLaw'", "sine discreteRod"]),
    "strain in free drain": (
        FIBERS,
        "integrator ab3;",
        "strainCoupling yes;",
        ["'strainCoupling'", "needs rpy"],
    ),
    "no switch": (
        FIBERS,
        "integrator ab3;",
        "strainCoupling maybe;",
        ["'strainCoupling'", "'maybe'", "yes no"],
    ),
    "tolerance of ab3": (FIBERS, "ab3;", "ab3; tolerance 1e-3;", ["'tolerance'", "implicit or auto"]),
    "shape": (FIBERS, "seed 3;", "shape curly;", ["'shape'", "'curly'", "straight file"]),
    "positions that are not there": (
        FIBERS,
        "seed 3;",
        "shape file; positions no.npy;",
        ["'positions'", "no.npy"],
    ),
    "transport": (
        FIBERS,
        "transport socket;",
        "transport pigeon;",
        ["'transport'", "'pigeon'", "socket tcp file"],
    ),
    "timeout": (FIBERS, "timeout 300;", "timeout 0;", ["'timeout'", "greater than 0"]),
    "port": (FIBERS, "timeout 300;", "port 99999;", ["'port'", "99999", "65535"]),
    "viscosity": (NU, re.compile(r"0.01;"), "0;", ["'nu'", "is 0", "greater than 0"]),
    "negative viscosity": (NU, re.compile(r"0.01;"), "[0 2 -1 0 0 0 0] -1;", ["'nu'", "greater than 0"]),
    "no viscosity": (NU, re.compile(r"nu\s+0.01;"), "", ["'nu'", "is missing"]),
    "variable time step": (
        CONTROL,
        re.compile(r"(?<=adjustTimeStep)\s+no;"),
        " yes;",
        ["'adjustTimeStep'", "fixed"],
    ),
    "no time step": (CONTROL, re.compile(r"(?<=deltaT)\s+0.02;"), " 0;", ["'deltaT'", "greater than 0"]),
    "no end": (CONTROL, re.compile(r"endTime\s+0.4;"), "", ["'endTime'", "is missing"]),
    "forcing without power": (OPTIONS, re.compile(r"\bpower\s+[\d.]+;"), "", ["'power'", "is missing"]),
    "forcing mode": (OPTIONS, "constantPower;", "gentle;", ["'mode'", "'gentle'", "constantCoefficient"]),
    "cutoff below the lowest wave": (
        OPTIONS,
        ALL,
        "f { type eswaranPope; variance 1; timeScale 1; cutoff 0.5; }",
        ["'cutoff'", "is 0.5", "at least 1"],
    ),
    "seed that is no label": (
        OPTIONS,
        ALL,
        "f { type eswaranPope; variance 1; timeScale 1; cutoff 2; seed 3000000000; }",
        ["'seed'", "3000000000", "allowed: 0 to 2147483647"],
    ),
    "forcing without type": (OPTIONS, re.compile(r"type\s+linearForcing;"), "", ["'type'", "is missing"]),
    "brace left open": (FIBERS, re.compile(r"\}\s*\Z"), "", ["not an OpenFOAM dictionary"]),
    "unfinished entry": (FIBERS, "beads 6;", "beads 6", []),
    "not a dictionary": (FIBERS, ALL, "just ] some ( words", ["not an OpenFOAM dictionary"]),
    "not text": (FIBERS, ALL, "\0\udcff\udcfe\0", ["not an OpenFOAM dictionary"]),
    "empty file": (FIBERS, ALL, "", ["not an OpenFOAM dictionary"]),
    "macro of nothing": (FIBERS, "beads 6;", "beads $nothing;", [chr(34) + "nothing" + chr(34), "line 6"]),
}


@pytest.mark.parametrize("mistake", MISTAKES)
def test_mistake(mistake, case, capsys):
    name, old, new, expected = MISTAKES[mistake]
    edit(case / name, old, new)
    line = info(case, capsys)
    assert str(case / name) in line
    for words in expected:
        assert words in line, line


@pytest.mark.parametrize("name", [FIBERS, CONTROL, NU], ids=lambda name: name.split("/")[-1])
def test_missing_file(name, case, capsys):
    (case / name).unlink()
    assert f"there is no file {case / name}" in info(case, capsys)


def test_no_case(tmp_path, capsys):
    assert f"there is no case folder {tmp_path / 'nothing'}" in info(tmp_path / "nothing", capsys)
    assert f"there is no file {tmp_path / CONTROL}" in info(tmp_path, capsys)


def test_positions_of_a_wrong_shape(case, capsys):
    np.save(case / "p.npy", np.zeros((4, 3)))
    edit(case / FIBERS, "seed 3;", "shape file; positions p.npy;")
    edit(case / FIBERS, re.compile(r"count 12; beads 6; length 1.2;"), "")
    line = info(case, capsys)
    assert "'positions'" in line and "(4, 3)" in line and "(fibers, beads, 3)" in line


def test_wrong_usage_is_exit_code_2(case, capsys):
    for arguments in (["run", "--fast", str(case)], ["walk", str(case)], []):
        with pytest.raises(SystemExit) as stopped:
            main(arguments)
        assert stopped.value.code == 2
        assert "usage: gbm" in capsys.readouterr().err


def refused(case) -> str:
    """The one line of error of a `gbm run`."""
    done = gbm("run", case)
    assert done.returncode == 1, done.stderr
    assert "Traceback" not in done.stdout + done.stderr
    lines = done.stderr.splitlines()
    assert len(lines) == 1 and lines[0].startswith("gbm run: "), done.stderr
    return lines[0]


@pytest.fixture
def small(tmp_path):
    return make_case(tmp_path / "case", cells=12, steps=20, write_every=5, tight=False)


@pytest.mark.openfoam
def test_interpolation_that_openfoam_does_not_know(small):
    set_entry(small / FIBERS, "interpolation", "spline")
    line = refused(small)
    assert "interpolation 'spline' is unknown to OpenFOAM; allowed: trilinear" in line
    assert "cellPoint" in line and FIBERS in line and "log.boxFoam" in line


@pytest.mark.openfoam
def test_mesh_that_is_not_periodic(small):
    edit(small / "system/blockMeshDict", "zLow    { type cyclic; neighbourPatch zHigh;", "zLow { type wall;")
    edit(small / "system/blockMeshDict", "zHigh   { type cyclic; neighbourPatch zLow;", "zHigh { type wall;")
    for name in ("U", "p"):
        field = small / "0.orig" / name
        text = field.read_text().replace("(x|y|z)(Low|High)", "(x|y)(Low|High)")
        text = text.replace("boundaryField\n{", 'boundaryField\n{\n    "z.*" { type zeroGradient; }')
        field.write_text(text)
    shutil.rmtree(small / "0")
    line = refused(small)
    assert "patch 'zLow' is of type wall with 144 faces" in line
    assert "periodic (cyclic) in all three directions" in line and "polyMesh/boundary" in line


@pytest.mark.openfoam
def test_mesh_that_is_not_a_box(small):
    """A parallelepiped: translations still map its faces onto each other."""
    mesh = small / "system/blockMeshDict"
    text = mesh.read_text()
    for corner in (
        "(0      0      $width)",
        "($width 0      $width)",
        "($width $width $width)",
        "(0      $width $width)",
    ):
        assert corner in text
        x = "1" if corner.startswith("(0") else "7.283185307179586"
        text = text.replace(corner, corner.replace("(0     ", f"({x}").replace("($width ", f"({x} ", 1))
    mesh.write_text(text)
    set_entry(small / FIBERS, "interpolation", "cellPoint")
    (small / "system/initialFieldDict").unlink()
    (small / "constant/fvOptions").unlink()  # which would miss a velocity first
    line = refused(small)
    assert "whole, axis-aligned box" in line


@pytest.mark.openfoam
def test_program_that_is_not_there(small):
    set_entry(small / CONTROL, "application", "cimpleFoam")
    assert "the OpenFOAM program 'cimpleFoam' is not on the PATH" in refused(small)


@pytest.mark.openfoam
def test_no_initial_field_and_no_mesh(small):
    for folder in ("0", "constant/polyMesh"):
        (small / folder).rename(small / "system" / folder.replace("/", "."))
    (small / "0.orig").rename(small / "elsewhere")
    assert "neither a folder 0 nor 0.orig" in refused(small)
    (small / "elsewhere").rename(small / "0.orig")
    (small / "system/blockMeshDict").unlink()
    assert "blockMeshDict" in refused(small)


@pytest.mark.openfoam
def test_too_many_fibers_for_the_memory(small):
    edit(small / FIBERS, "count 12;", "count 100000000000;")
    assert "not enough memory" in refused(small)


@pytest.mark.openfoam
def test_nan_in_the_flow(small):
    """Named with its time; what was recorded before stays."""
    set_entry(small / CONTROL, "endTime", "0.1")
    assert gbm("run", small).returncode == 0
    set_entry(small / CONTROL, "endTime", "0.4")
    file = small / "0.1/U"
    data = bytearray(file.read_bytes())
    at = data.index(b"1728\n(") + 6
    data[at : at + 8] = np.float64(np.nan).tobytes()
    file.write_bytes(data)
    line = refused(small)
    assert "not finite" in line and "0.1" in line and "log.boxFoam" in line, line
    with open_recording(small / "postProcessing/fibers") as recording:
        assert len(recording.times) == 6
        assert np.isfinite(recording.families["test"].positions[:]).all()


@pytest.mark.openfoam
def test_time_step_that_is_far_too_long(small):
    """OpenFOAM or the daemon says so before anything infinite is recorded."""
    set_entry(small / CONTROL, "deltaT", "5")
    set_entry(small / CONTROL, "endTime", "1000")
    line = refused(small)
    assert re.search("not finite|blown up|predicted with an error|SIGFPE|loating point|loses fiber", line), (
        line
    )
    with open_recording(small / "postProcessing/fibers") as recording:
        assert np.isfinite(recording.families["test"].positions[:]).all()
