"""boxFoam as a solver of OpenFOAM: restarts, ranks, other solvers' runs, sources, and what it refuses."""

from __future__ import annotations

import re
import shutil

import numpy as np
import pytest

from gbm_plugin.case.openfoam import fatal_message, utility
from gbm_plugin.output.recording import open_recording

from box_cases import box_case, run, velocity
from conftest import HEADER, divide, make_case, run_case, set_entry, solver_log, start_solver

pytestmark = pytest.mark.openfoam

POWER = "linearForcing { type linearForcing; mode constantPower; power 0.05; }"


@pytest.mark.parametrize("ranks", [1, 2])
def test_restart_to_the_same_bits(tmp_path, ranks):
    """Also after one step, when the scheme has no history yet, and in a case that writes ascii."""
    whole = box_case(tmp_path / "whole", cells=12, steps=8, ranks=ranks, fv_options=POWER)
    parts = box_case(tmp_path / "parts", cells=12, steps=1, ranks=ranks, fv_options=POWER)
    for path in (whole, parts):
        set_entry(path / "system/controlDict", "writeFormat", "ascii")
    run(whole, ranks)
    run(parts, ranks)
    for end in (0.08, 0.16):
        set_entry(parts / "system/controlDict", "endTime", str(end))
        set_entry(parts / "system/controlDict", "writeInterval", "1")
        assert "Continuing from the state in" in run(parts, ranks)
    for folder in [f"processor{r}" for r in range(ranks)] if ranks > 1 else ["."]:
        for name in ("uniform/boxFoam", "U", "p", "phi"):
            a, b = ((case / folder / "0.16" / name).read_bytes() for case in (whole, parts))
            assert a == b, name


@pytest.mark.parametrize(
    "options",
    [pytest.param((), marks=pytest.mark.exhaustive), ("--parallel",)],
    ids=["serial", "parallel"],
)
def test_fibers_ride(tmp_path, options):
    """A run of flow and fibers that was stopped in between equals one that was not, to the same bits."""
    positions = []
    for ends in ((8,), (4, 8)):
        path = make_case(
            tmp_path / str(len(ends)), cells=12, steps=8, time_step=0.02, write_every=4, fv_options=POWER,
            interpolation="quintic", application="boxFoam", prepared=False,
        )  # fmt: skip
        for end in ends:
            set_entry(path / "system/controlDict", "endTime", repr(end * 0.02))
            run_case(path, *options)
        with open_recording(path / "postProcessing/fibers") as recording:
            assert len(recording.times) == 9
            positions.append(recording.families["test"].positions[:])
    np.testing.assert_array_equal(*positions)


def test_ranks_agree(tmp_path):
    """To rounding, also where the layers do not divide evenly and cells have another order, by memory or messages."""
    one = box_case(tmp_path / "one", order=4, cells=10, steps=10, fv_options=POWER)
    run(one)
    u = velocity(one, "0.2", 10)
    for ranks, shared in ((2, 1), (3, 1), (3, 0)):
        many = box_case(tmp_path / f"{ranks}{shared}", order=4, cells=10, steps=10, fv_options=POWER)
        if ranks == 3:  # 4, 4 and 2 layers, as FFTW would have them
            rank = np.minimum(np.arange(1000) // 400, 2)
            set_entry(many / "system/decomposeParDict", "numberOfSubdomains", "3")
            set_entry(many / "system/decomposeParDict", "method", "manual")
            d = many / "system/decomposeParDict"
            d.write_text(d.read_text() + 'manualCoeffs { dataFile "ranks"; }\n')
            header = HEADER.replace("class dictionary", "class labelList")
            (many / "constant/ranks").write_text(header + f"1000({' '.join(map(str, rank))})\n")
            utility(many, "decomposePar", "-force")
        else:
            divide(many, 2, (1, 1, 2))
        with (many / "system/controlDict").open("a") as control:
            control.write(f"OptimisationSwitches {{ nodeMemory {shared}; }}\n")
        assert re.search(rf"nodeMemory +{shared};", run(many, ranks))
        assert np.abs(velocity(many, "0.2", 10) - u).max() < 1e-13


def test_other_solvers_continue(tmp_path):
    """pimpleFoam continues a run of boxFoam, and boxFoam that: the flow is the same to pimpleFoam's error."""
    alone = box_case(tmp_path / "alone", cells=16, steps=15, fv_options=POWER)
    run(alone)
    path = box_case(tmp_path / "case", cells=16, steps=5, fv_options=POWER, tight=False)
    run(path)
    for application, end in (("pimpleFoam", 0.2), ("boxFoam", 0.3)):
        set_entry(path / "system/controlDict", "application", application)
        set_entry(path / "system/controlDict", "endTime", str(end))
        log = run(path)
    left = float(re.search(r"Starting from U: .* has an rms of (\S+)", log).group(1))
    u, reference = (velocity(case, "0.3", 16) for case in (path, alone))
    rms = np.sqrt((reference**2).mean())
    assert 0 < left < 0.03 * rms  # it is divergence-free for other differences
    assert np.sqrt(((u - reference) ** 2).mean()) < 0.03 * rms


def test_stock_sources(tmp_path):
    """An implicit A u of OpenFOAM's own is what linearForcing is; a mean velocity force holds its velocity."""
    fields = {}
    stock = """lundgren { type vectorSemiImplicitSource; selectionMode all; volumeMode specific;
        injectionRateSuSp { U ((0 0 0) 0.5); } }"""
    ours = "linearForcing { type linearForcing; mode constantCoefficient; A 0.5; }"
    for name, option in (("stock", stock), ("ours", ours)):
        path = box_case(tmp_path / name, cells=12, steps=10, fv_options=option)
        run(path)
        fields[name] = velocity(path, "0.2", 12)
    np.testing.assert_allclose(fields["stock"], fields["ours"], atol=1e-13)

    wind = "wind { type meanVelocityForce; selectionMode all; fields (U); Ubar (0.5 0 0); }"
    path = box_case(tmp_path / "wind", cells=12, steps=6, fv_options=wind)
    log = run(path)
    mean = velocity(path, "0.12", 12).mean(axis=(1, 2, 3))
    np.testing.assert_allclose(mean, [0.5, 0, 0], atol=1e-12)
    assert len(re.findall("Pressure gradient source", log)) == 6


def test_a_mean_velocity_is_not_amplified(tmp_path):
    modes = "((0 2 0) (0 0 0) (-1 0 0)) ((0 0 0) (0.3 -0.2 0.1) (0 0 0))"
    path = box_case(tmp_path / "case", cells=10, fv_options=POWER, initial=f"field modes; modes ({modes});")
    run(path)
    assert np.abs(velocity(path, "0.2", 10).mean(axis=(1, 2, 3))).max() < 1e-14


def test_adjustable_steps(tmp_path):
    """Steps of any length, to the end and times of writing that are asked for."""
    fixed = box_case(tmp_path / "fixed", cells=12, steps=40, time_step=0.01, fv_options=POWER)
    run(fixed)
    path = box_case(tmp_path / "case", cells=12, steps=200, time_step=0.002, fv_options=POWER)
    control = path / "system/controlDict"
    set_entry(control, "writeControl", "adjustableRunTime")
    set_entry(control, "writeInterval", "0.2")
    replace(control, "adjustTimeStep  no;", "adjustTimeStep  yes; maxCo 0.1;")
    log = run(path)
    steps = [float(x) for x in re.findall(r"^deltaT = (\S+)", log, re.MULTILINE)]
    assert len(set(steps)) > 8 and max(steps) > 0.015
    assert max(float(x) for x in re.findall(r"max: (\S+)", log)) < 0.11
    assert (path / "0.2/U").is_file()
    np.testing.assert_allclose(velocity(path, "0.4", 12), velocity(fixed, "0.4", 12), atol=1e-4)


def replace(path, old: str, new: str) -> None:
    text = path.read_text()
    assert old in text
    path.write_text(text.replace(old, new))


@pytest.mark.parametrize(
    "file, old, new, words",
    [
        ("system/fvSchemes", "central6", "central5", "central5 central2 central4 central6"),
        ("system/fvSchemes", "differences ", "difference ", "unknown entry 'difference' allowed"),
        ("constant/turbulenceProperties", "laminar;", "LES;", "LES turbulence models laminar"),
        (
            "constant/turbulenceProperties",
            "constantViscosity;",
            "Maxwell;",
            "Maxwell constantViscosity Stokes",
        ),
        ("constant/transportProperties", "Newtonian", "CrossPowerLaw", "CrossPowerLaw Newtonian"),
        (
            "system/blockMeshDict",
            "simpleGrading (1 1 1)",
            "simpleGrading (1 2 1)",
            "uniform periodic one size",
        ),
        ("system/blockMeshDict", "type cyclic; neighbourPatch xHigh;", "type wall;", "uniform periodic xLow"),
    ],
)
def test_refusals(tmp_path, file, old, new, words):
    path = box_case(tmp_path / "case", cells=10, steps=1)
    replace(path / file, old, new)
    if "wall" in new:
        replace(path / file, "type cyclic; neighbourPatch xLow;", "type wall;")
        for field in ("0/U", "0/p"):
            content = (path / field).read_bytes()
            patches = b'"x.*" { type zeroGradient; }\n    "(y|z)(Low|High)"'
            (path / field).write_bytes(content.replace(b'"(x|y|z)(Low|High)"', patches))
    if "blockMesh" in file:
        utility(path, "blockMesh")
    assert start_solver(path).wait() != 0
    text = fatal_message(solver_log(path))
    assert text and all(word in text for word in words.split()), text


def test_more_refusals(tmp_path):
    """A step that may grow beyond stability, a source that is no source, ranks that are no slabs."""
    path = box_case(tmp_path / "constraint", cells=10, steps=2, fv_options="""
        damp { type velocityDampingConstraint; active yes; selectionMode all; UMax 0.01; }""")  # fmt: skip
    assert start_solver(path).wait() != 0
    assert "damp" in fatal_message(solver_log(path))

    path = box_case(tmp_path / "ranks", cells=10, steps=2)
    divide(path, 2, (2, 1, 1))
    assert start_solver(path, 2).wait() != 0
    assert "simpleCoeffs { n (1 1 2); }" in fatal_message(solver_log(path))

    path = box_case(tmp_path / "blown", cells=10, steps=100, time_step=1.5, nu=1e-9)
    assert start_solver(path).wait() != 0
    text = fatal_message(solver_log(path))
    assert "blown up" in text and "deltaT" in text and "0.45" in text


def test_a_changed_velocity_is_taken(tmp_path):
    """A state beside a U that somebody has replaced is left, and said so."""
    path = box_case(tmp_path / "case", cells=10, steps=2)
    run(path)
    shutil.copy(path / "0/U", path / "0.04/U")
    set_entry(path / "system/controlDict", "endTime", "0.06")
    log = run(path)
    assert "U has changed since it was written" in log and "Starting from U" in log
