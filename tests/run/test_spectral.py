"""`gbm run --flow spectral`: one case, the other engine, the same kind of results."""

from __future__ import annotations

import os
import re
import signal
import subprocess
import sys
import time

import numpy as np
import pytest

from gbm_plugin.case.foamfile import read_field, read_list
from gbm_plugin.case.mesh import box_mesh
from gbm_plugin.case.openfoam import utility
from gbm_plugin.output.recording import open_recording
from gbm_plugin.output.tables import read_dat, read_forcing
from gbm_plugin.report.report import report

from conftest import gbm, make_case, run_case, set_entry

SPECTRAL = ("--flow", "spectral")


def results(path):
    table = read_dat(path / "spectral/postProcessing/linearForcing", "linearForcing.dat")
    with open_recording(path / "spectral/postProcessing/fibers") as recording:
        return table, recording.times, recording.families["test"].positions[:]


@pytest.fixture(scope="module")
def whole(tmp_path_factory):
    path = make_case(
        tmp_path_factory.mktemp("whole") / "case", cells=24, prepared=False, application="pimpleFoam"
    )
    run_case(path, *SPECTRAL)
    return path


@pytest.mark.openfoam
def test_both_engines_agree(whole, tmp_path):
    """The same initial modes, forcing and seeds; after 0.4 time units apart by the error of 24^3 cells."""
    path = make_case(tmp_path / "case", cells=24, tight=False, application="pimpleFoam")
    run_case(path)
    flow = read_dat(path / "postProcessing/linearForcing", "linearForcing.dat")
    with open_recording(path / "postProcessing/fibers") as recording:
        x = recording.families["test"].positions[:]
    table, _, y = results(whole)
    np.testing.assert_allclose(flow["Time"], table["Time"], atol=1e-9)
    assert flow["k"][0] == pytest.approx(table["k"][0], rel=1e-12)
    np.testing.assert_allclose(flow["k"], table["k"], rtol=0.01)
    np.testing.assert_allclose(x[0], y[0], atol=1e-10)  # the mesh has its corners from a file
    moved = np.linalg.norm(y[-1] - y[0], axis=-1).max()
    assert np.abs(x[-1] - y[-1]).max() < 0.1 * moved


def test_the_budget_closes(whole):
    """dk/dt = P - epsilon to the second order in the step that the table's differences have."""
    table, *_ = results(whole)
    middle = 0.5 * (table["epsilonLaplacian"][1:] + table["epsilonLaplacian"][:-1])
    np.testing.assert_allclose(table["epsilonBudget"][1:], middle, rtol=1e-3)


def test_the_results_are_a_case(whole):
    assert "fibers.png" in report(whole / "spectral")["files"]
    assert (whole / "spectral/report/fibers.png").is_file()


def test_paraview_opens_the_results_with_a_mesh(whole):
    """Of a case that has none: of as many cells as its U has, beside the name for ParaView; no program made it."""
    folder = whole / "spectral"
    assert box_mesh(folder)[0] == (24, 24, 24) and (folder / "spectral.foam").is_file()
    assert len(read_field(folder / "0.4/U")) == 24**3
    assert not (whole / "constant/polyMesh").exists() and not (whole / "log.blockMesh").exists()


@pytest.mark.openfoam
def test_openfoam_agrees_with_that_mesh(whole):
    """It is one to checkMesh, and cells and faces are where blockMesh puts them."""
    folder = whole / "spectral"
    utility(folder, "checkMesh")
    assert "Mesh OK" in (folder / "log.checkMesh").read_text()
    made = make_case(whole.parent / "made", cells=24, application="pimpleFoam")
    for name in ("points", "owner", "neighbour"):
        ours, theirs = (read_list(case / "constant/polyMesh" / name) for case in (folder, made))
        assert len(ours) == len(theirs)
        count = 3 * 24 * 24 * 23 if name != "points" else None
        np.testing.assert_allclose(ours[:count], theirs[:count], atol=1e-5)


def test_a_killed_run_continues_to_the_same_bits(whole, tmp_path):
    path = make_case(tmp_path / "case", cells=24, prepared=False)
    set_entry(path / "system/controlDict", "endTime", "0.3")
    run_case(path, *SPECTRAL)
    (
        path / "spectral/0.3/uniform/fibers.npz"
    ).unlink()  # killed while it wrote: 0.2 is the latest complete time
    set_entry(path / "system/controlDict", "endTime", "0.4")
    done = run_case(path, *SPECTRAL)
    assert "falling back to time 0.2" in done.stdout
    assert (path / "spectral/previous/1/0.3/U").is_file()
    for a, b in zip(results(path), results(whole), strict=True):
        if isinstance(a, dict):
            for column in a:
                np.testing.assert_array_equal(a[column], b[column], err_msg=column)
        else:
            np.testing.assert_array_equal(a, b)


def test_a_signal_stops_it_cleanly(tmp_path):
    path = make_case(tmp_path / "case", cells=24, steps=5000, write_every=5000, prepared=False)
    argv = [sys.executable, "-m", "gbm_plugin.cli", "run", str(path), *SPECTRAL]
    process = subprocess.Popen(argv, stderr=subprocess.PIPE, text=True)
    table = path / "spectral/postProcessing/linearForcing/0/linearForcing.dat"
    while not (table.is_file() and len(table.read_text().splitlines()) > 10):
        assert process.poll() is None
        time.sleep(0.05)
    os.kill(process.pid, signal.SIGTERM)
    _, errors = process.communicate()
    assert process.returncode == 3 and "stopped on request" in errors and "Traceback" not in errors
    saved = [p for p in (path / "spectral").glob("*/uniform/fibers.npz")]
    assert len(saved) == 1


ESWARAN_POPE = "stirring { type eswaranPope; variance 5e-3; timeScale 0.5; cutoff 2.8284; seed 4; }"


@pytest.mark.openfoam
def test_one_force_in_both_engines(tmp_path):
    """The same entry drives both; each has its table under the entry's name. From one field, one power at t = 0."""
    path = make_case(
        tmp_path / "case", steps=5, prepared=False, fv_options=ESWARAN_POPE, application="pimpleFoam"
    )
    run_case(path)
    run_case(path, *SPECTRAL)
    openfoam, spectral = read_forcing(path), read_forcing(path / "spectral")
    assert (path / "postProcessing/stirring/0/stirring.dat").is_file()
    np.testing.assert_allclose(openfoam["Time"], spectral["Time"], atol=1e-12)
    # the same smooth product, summed over the centres of cells and over the modes
    assert openfoam["power"][0] == pytest.approx(spectral["power"][0], rel=1e-9)
    # later as far as the flows agree on 16^3 cells; another force would be off by its own size
    largest = np.abs(spectral["power"]).max()
    np.testing.assert_allclose(openfoam["power"], spectral["power"], rtol=0, atol=0.05 * largest)
    made = report(path)
    assert len(made["files"]) and made["flow"]["time"] == pytest.approx([0, 0.1])


FROM = 'field run; from "../whole";'


def begun(path, **options):
    """A finer case that begins from `whole`, under a force with a state."""
    options = {"fv_options": ESWARAN_POPE, "initial": FROM, "steps": 2, "prepared": False} | options
    return make_case(path, **options)


def stored(path, time):
    with np.load(path / f"spectral/{time}/uniform/flow.npz") as state:
        return {name: state[name] for name in state.files}


def test_a_run_begins_from_an_earlier_one(tmp_path):
    """Its modes and its force, to rounding: the table of the finer run begins where that of the coarser ended."""
    coarse = make_case(tmp_path / "whole", cells=16, steps=4, prepared=False, fv_options=ESWARAN_POPE)
    run_case(coarse, *SPECTRAL)
    fine = begun(tmp_path / "fine", cells=24)
    run_case(fine, *SPECTRAL)
    before, after = read_forcing(coarse / "spectral"), read_forcing(fine / "spectral")
    assert after["Time"][0] == 0
    for column in ("k", "power", "epsilonGradient"):
        assert after[column][0] == pytest.approx(before[column][-1], rel=1e-12), column
    # the force went on: as many draws as steps, and one for its first value
    assert stored(fine, "0.04")["forcing_draws"] == stored(coarse, "0.08")["forcing_draws"] + 2


@pytest.mark.openfoam
def test_openfoam_begins_from_the_same_modes(tmp_path):
    """At its centres of cells."""
    coarse = make_case(tmp_path / "whole", cells=16, steps=4, prepared=False, fv_options=ESWARAN_POPE)
    run_case(coarse, *SPECTRAL)
    fine = begun(tmp_path / "fine", cells=24, application="pimpleFoam")
    run_case(fine)
    table = read_forcing(fine)
    assert table["k"][0] == pytest.approx(read_forcing(coarse / "spectral")["k"][-1], rel=1e-10)


@pytest.mark.parametrize(
    "initial, message",
    [
        ('field run; from "../nowhere";', "no time folder with a flow"),
        (FROM + " time 0.07;", "is 0.07;.* has 0.2 0.4"),
        (FROM, "the stored force has|has 24 x 24 x 24 cells.*must be as large"),
    ],
)
def test_a_beginning_that_is_none_is_refused(whole, tmp_path, initial, message):
    path = begun(whole.parent / tmp_path.name, cells=24, initial=initial.replace("whole", whole.name))
    set_entry(path / "system/blockMeshDict", "width", "5")
    done = gbm("run", path, *SPECTRAL)
    assert done.returncode == 1 and re.search(message, done.stderr) and "Traceback" not in done.stderr


def test_sub_cycles_are_steps_of_the_flow(tmp_path):
    """Two steps of the flow in a deltaT are those of half of it, to the bit."""
    short = make_case(tmp_path / "short", time_step=0.01, steps=20, prepared=False)
    long = make_case(tmp_path / "long", time_step=0.02, steps=10, prepared=False)
    solution = long / "system/fvSolution"
    solution.write_text(solution.read_text() + "spectral { nSubCycles 2; }\n")
    for path in (short, long):
        run_case(path, *SPECTRAL)
    one, two = (read_forcing(path / "spectral")["k"] for path in (short, long))
    np.testing.assert_array_equal(one[::2], two)


def test_a_gpu_that_is_not_there_is_named(tmp_path):
    path = make_case(tmp_path / "case", steps=1, prepared=False)
    done = gbm("run", path, *SPECTRAL, "--device", "gpu")
    if done.returncode:  # on a machine that has one, it runs
        assert "needs CuPy and a CUDA device" in done.stderr and len(done.stderr.splitlines()) == 1


@pytest.mark.parametrize(
    "change, message",
    [
        (
            ("constant/fiberProperties", "interpolation", "cellPoint"),
            "allowed: trilinear cubic quintic exact",
        ),
        (("system/blockMeshDict", "n", "15"), "same even number"),
    ],
)
def test_what_it_cannot_do_is_refused(tmp_path, change, message):
    path = make_case(tmp_path / "case", prepared=False)
    file, entry, value = change
    set_entry(path / file, entry, value)
    done = gbm("run", path, *SPECTRAL)
    assert done.returncode == 1
    assert message in done.stderr and "Traceback" not in done.stderr
