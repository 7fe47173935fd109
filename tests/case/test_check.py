"""Cases that would run without fibers, or without what they ask for, are refused before anything starts."""

from __future__ import annotations

import re

import pytest

from gbm_plugin.case.check import check_forcing, check_mesh, check_openfoam, notes
from gbm_plugin.case.prepare import initial_fields, make_mesh
from gbm_plugin.case.scene import read_scene
from gbm_plugin.errors import CaseError

from conftest import DEFAULT_CASE, HEADER, gbm, make_case, set_entry

CONTROL, OPTIONS = "system/controlDict", "constant/fvOptions"
FUNCTIONS = re.compile(r"functions\s*\{.*\}", re.DOTALL)
LIBS = re.compile(r"^libs .*$", re.MULTILINE)
COUPLING = 'functions { f { type fiberCoupling; libs ("libgbmPlugin.so"); } }'


@pytest.fixture
def case(tmp_path):
    return make_case(tmp_path / "case", cells=8, prepared=False)


def edit(path, pattern: re.Pattern, new: str) -> None:
    text, found = pattern.subn(lambda _: new, path.read_text())
    assert found == 1
    path.write_text(text)


def test_the_case_as_it_is_shipped(case):
    check_openfoam(read_scene(case))
    assert notes(read_scene(DEFAULT_CASE)) == []


@pytest.mark.parametrize(
    "functions, expected",
    [
        ("", "no function object fiberCoupling: OpenFOAM would run without fibers; add functions"),
        ("functions { }", "no function object fiberCoupling"),
        ("functions { p { type probes; libs (sampling); } }", "no function object fiberCoupling"),
        (
            "functions { f { type fiberCoupling; enabled no; } }",
            "'enabled' is no: OpenFOAM would run without",
        ),
    ],
)
def test_no_fiber_coupling(functions, expected, case):
    edit(case / CONTROL, FUNCTIONS, functions)
    with pytest.raises(CaseError, match=expected):
        check_openfoam(read_scene(case))
    done = gbm("run", case)
    assert done.returncode == 1 and expected in done.stderr and not (case / "0").exists()


def test_the_function_object_may_be_included(case):
    """As users keep them: a file of its own, and macros."""
    (case / "system/fibers").write_text('fibers { type $kind; libs ("libgbmPlugin.so"); }\n')
    edit(case / CONTROL, FUNCTIONS, 'kind fiberCoupling;\nfunctions { #include "fibers" }')
    check_openfoam(read_scene(case))


def test_libs_of_the_function_object_alone(case):
    """Enough for fibers; not for a forcing, a preconditioner, a scheme, a laminar model: each is named."""
    edit(case / CONTROL, FUNCTIONS, COUPLING)
    edit(case / CONTROL, LIBS, "")
    users = [
        "the forcing linearForcing",
        "the constantViscosity of constant/turb",
        "the leanCubic of system/fvSch",
    ]
    for user, file in zip(users, (OPTIONS, "constant/turbulenceProperties", "system/fvSchemes"), strict=True):
        with pytest.raises(CaseError, match=rf'libs \("libgbmPlugin.so"\) is missing, for {user}'):
            check_openfoam(read_scene(case))
        (case / file).unlink()
    check_openfoam(read_scene(case))


def test_no_libs_at_all(case):
    edit(case / CONTROL, FUNCTIONS, "functions { f { type fiberCoupling; } }")
    edit(case / CONTROL, LIBS, "")
    with pytest.raises(
        CaseError, match=r"controlDict, functions, f: libs .* is missing, which brings fiberCoupling"
    ):
        check_openfoam(read_scene(case))


@pytest.mark.parametrize(
    "application, expected",
    [
        (
            "icoFoam",
            "is icoFoam, which does not look at fvOptions: the forcing linearForcing would do nothing",
        ),
        ("simpleFoam", "whose steps are no time"),
        ("pisoFoam", None),
        ("boxFoam", None),
    ],
)
def test_solvers(application, expected, case):
    set_entry(case / CONTROL, "application", application)
    if expected is None:
        check_openfoam(read_scene(case))
    else:
        with pytest.raises(CaseError, match=expected):
            check_openfoam(read_scene(case))


def test_run_that_would_stop_at_once(case):
    set_entry(case / CONTROL, "stopAt", "writeNow")
    with pytest.raises(CaseError, match="'stopAt' is 'writeNow'"):
        check_openfoam(read_scene(case))


@pytest.mark.openfoam
def test_walls(case):
    make_mesh(case)
    check_mesh(case)
    boundary = case / "constant/polyMesh/boundary"
    edit(boundary, re.compile(r"(?<=zLow\n    \{\n)\s+type\s+cyclic;"), "type wall;")
    with pytest.raises(CaseError, match=r"patch 'zLow' is of type wall with 64 faces: fibers need a box"):
        check_mesh(case)


@pytest.mark.openfoam
@pytest.mark.parametrize("velocity", ["(0 0 0)", "(1 0 0)"])
def test_nothing_to_force(velocity, case):
    """Row 9: constant power on a flow without fluctuations."""
    (case / "system/initialFieldDict").unlink()
    u = case / "0.orig/U"
    u.write_text(u.read_text().replace("uniform (0 0 0)", f"uniform {velocity}"))
    make_mesh(case)
    initial_fields(read_scene(case))
    with pytest.raises(CaseError, match="the forcing linearForcing has nothing to force, k = 0"):
        check_forcing(read_scene(case), "0")
    done = gbm("run", case)
    assert done.returncode == 1 and "nothing to force" in done.stderr
    (case / OPTIONS).unlink()
    check_forcing(read_scene(case), "0")


def test_nothing_to_force_in_the_other_engine(case):
    (case / "system/initialFieldDict").write_text(HEADER + "field ABC; A 0; B 0; C 0;")
    done = gbm("run", case, "--flow", "spectral")
    assert done.returncode == 1 and "nothing to force, k = 0" in done.stderr


def test_worth_a_word(case):
    """A fiber longer than half the box; cells of 3 Kolmogorov lengths (nu = 0.01, P = 0.05: eta = 0.067); LES."""
    fibers = case / "constant/fiberProperties"
    fibers.write_text(fibers.read_text().replace("length 1.2", "length 3.2").replace("beads 6", "beads 40"))
    (case / "constant/turbulenceProperties").write_text(HEADER + "simulationType LES;")
    said = notes(read_scene(case))
    assert len(said) == 3
    assert "family test are 3.2 long, more than half of the box (3.14159)" in said[0]
    assert "cells are 12 Kolmogorov lengths wide" in said[1]  # 2 pi/8/0.0669
    assert "simulationType LES" in said[2]
    assert "note: fibers of family test" in gbm("info", case).stdout


def test_statistics_that_begin_after_the_end(case):
    fibers = case / "constant/fiberProperties"
    text = fibers.read_text()
    for begin, said in (("0.2", 0), ("3", 1)):
        fibers.write_text(text + f"statistics {{ from {begin}; }}\n")
        assert sum("none are gathered" in note for note in notes(read_scene(case))) == said


@pytest.mark.parametrize("interval, said", [("10", False), ("7", True), ("1000", True)])
def test_an_end_that_is_not_written(interval, said, case):
    set_entry(case / CONTROL, "writeInterval", interval)  # of 20 steps
    found = [note for note in notes(read_scene(case)) if "not at endTime 0.4" in note]
    assert len(found) == said


def test_more_beads_than_memory(case):
    fibers = case / "constant/fiberProperties"
    fibers.write_text(fibers.read_text().replace("count 12", "count 500000000"))
    with pytest.raises(CaseError, match=r"not enough memory: 3e\+09 beads take 900 GB or more"):
        read_scene(case)


def test_repulsion_that_no_step_follows(case):
    """Row 14."""
    fibers = case / "constant/fiberProperties"
    fibers.write_text(fibers.read_text().replace("recordInterval 1;", "recordInterval 1; repulsion 100;"))
    with pytest.raises(
        CaseError, match=r"repulsion is 100 in family test: with deltaT 0.02 at most 1/deltaT = 50"
    ):
        read_scene(case)


@pytest.mark.parametrize("name", ["o'brien", 'the "best"', "two words"])
def test_characters_that_openfoam_does_not_take(name, tmp_path):
    """Row 13."""
    path = tmp_path / name
    path.mkdir()
    with pytest.raises(CaseError, match=r"has the character .*, which OpenFOAM does not take"):
        read_scene(path)
