"""`gbm run --flow stored`: real runs of OpenFOAM, and another code's fields, replayed."""

from __future__ import annotations

import os
import re
import shutil
import signal
import subprocess
import sys
import time

import h5py
import numpy as np
import pytest

from gbm_plugin.output.field import read_velocity
from gbm_plugin.output.recording import open_recording
from gbm_plugin.report.report import report as report_of
from gbm_plugin.run.openfoam import run_stored

from conftest import divide, gbm, make_case, run_case, set_entry

pytestmark = pytest.mark.openfoam

REPLAY = ("--flow", "stored")
STEPS = 12
# shear waves, each free of divergence in any box
WAVES = """field modes;
modes (((0 1 0) (0.3 0 0) (0 0 0.2)) ((1 0 0) (0 0.4 0) (0 0 -0.3)) ((0 0 2) (0.2 -0.1 0) (0 0.3 0)));
"""


def fibers(folder):
    """(times, positions) of a recording."""
    with open_recording(folder / "postProcessing/fibers") as recording:
        return recording.times, recording.families["test"].positions[:]


def distance(case):
    """Largest distance of a bead to the coupled run at any record, and how far beads went."""
    times, live = fibers(case)
    again, found = fibers(case / "stored")
    np.testing.assert_allclose(again, times, atol=1e-12)
    return np.abs(found - live).max(), np.abs(live - live[0]).max()


@pytest.fixture(scope="module")
def live(tmp_path_factory):
    """A run that wrote every step, in binary; to be copied, not changed."""
    path = make_case(
        tmp_path_factory.mktemp("live") / "case",
        steps=STEPS,
        write_every=1,
        tight=False,
        application="pimpleFoam",
    )
    run_case(path)
    return path


@pytest.fixture
def case(live, tmp_path):
    return shutil.copytree(live, tmp_path / "case", symlinks=True)


def thinned(case, every):
    for n in range(1, STEPS):
        if n % every:
            shutil.rmtree(case / f"{n * 0.02:.8g}", ignore_errors=True)
    return case


def test_the_replay_of_every_step_is_the_run_itself(case):
    run_case(case, *REPLAY)
    apart, went = distance(case)
    assert went > 0.05
    assert apart < 1e-13


def test_the_replay_of_a_cubic_run_is_the_run_itself(tmp_path):
    """The same interpolation, and derivatives, in C++ and in Python."""
    case = make_case(
        tmp_path / "case",
        steps=STEPS,
        write_every=1,
        tight=False,
        interpolation="cubic",
        application="pimpleFoam",
    )
    run_case(case)
    run_case(case, *REPLAY)
    apart, _ = distance(case)
    assert apart < 1e-13


def test_the_distance_falls_with_the_interval(case):
    """Every second and every fourth field; orders are those of the study, whose flow has no first step."""
    apart = {}
    for every in (2, 4):
        thinned(case, every)
        for words in ("linear", "cubic"):
            run_stored(case, fresh=True, in_time=words)
            apart[every, words], went = distance(case)
    assert apart[2, "cubic"] < apart[2, "linear"] and apart[4, "cubic"] < apart[4, "linear"]
    assert 1e-9 < apart[2, "linear"] < apart[4, "linear"] < 0.01 * went


def test_the_results_are_a_case(case):
    set_entry(case / "system/controlDict", "writeInterval", "6")
    shutil.rmtree(case / "0.orig")  # the form of U is then that of a binary file
    run_stored(case)
    report_of(case / "stored")
    written = (read_velocity(folder, "0.24", (16, 16, 16)) for folder in (case, case / "stored"))
    np.testing.assert_allclose(*written, atol=1e-14)
    assert b"cyclic" in (case / "stored/0.24/U").read_bytes()
    report = case / "stored/report"
    assert all((report / n).is_file() for n in ("fibers.png", "spectrum.csv", "fibers_wrapped.pvd"))
    folders = sorted(p.parent.parent.name for p in (case / "stored").glob("*/uniform/fibers.npz"))
    assert folders == ["0.12", "0.24"]
    run_stored(case, fresh=True)  # the old one is kept
    assert (case / "stored/previous/1/0.24/U").is_file()


def test_two_ranks_ascii_compressed_and_a_box_of_three_widths(tmp_path):
    """The folders of the processors alone, and then reconstructed: the same to the digits that are written."""
    path = make_case(tmp_path / "case", steps=6, write_every=1, prepared=False, initial=WAVES)
    control = path / "system/controlDict"
    set_entry(control, "writeFormat", "ascii")
    set_entry(control, "writePrecision", "12")
    control.write_text(control.read_text() + "writeCompression on;\n")
    mesh = path / "system/blockMeshDict"
    mesh.write_text(mesh.read_text().replace("$width)", "3.7)").replace("($n $n $n)", "(16 12 8)"))
    divide(path, 2, (1, 1, 2))
    run_case(path, "--parallel")
    assert (path / "processor1/0.02/U.gz").is_file() and (path / "0.02/U.gz").is_file()
    run_stored(path)
    whole, went = distance(path)
    for n in range(1, 7):
        shutil.rmtree(path / f"{n * 0.02:.8g}")
    run_stored(path, fresh=True)
    parts, _ = distance(path)
    assert went > 0.02
    assert whole < 1e-10 and parts < 1e-10


def test_a_killed_replay_continues_to_the_same_bits(case, tmp_path, caplog):
    """Between fields, so that the window of fields is built anew as well."""
    caplog.set_level("INFO", "gbm_plugin")
    thinned(case, 2)
    other = shutil.copytree(case, tmp_path / "other", symlinks=True)
    for path in (case, other):
        set_entry(path / "system/controlDict", "writeInterval", "5")
    run_stored(case)
    set_entry(other / "system/controlDict", "endTime", "0.2")
    run_stored(other)
    (
        other / "stored/0.2/uniform/fibers.npz"
    ).unlink()  # killed while it wrote: 0.1 is the latest complete time
    set_entry(other / "system/controlDict", "endTime", "0.24")
    run_stored(other)
    assert "falling back to time 0.1" in caplog.text
    for a, b in zip(fibers(other / "stored"), fibers(case / "stored"), strict=True):
        np.testing.assert_array_equal(a, b)
    (other / "stored/0.24/uniform/fibers.npz").unlink()
    refused(other, "the replay began with inTime 'cubic', this one has 'linear'", in_time="linear")


def test_the_range_is_that_of_the_fields(case, caplog):
    caplog.set_level("INFO", "gbm_plugin")
    control = case / "system/controlDict"
    set_entry(control, "endTime", "0.9")
    shutil.rmtree(case / "0")
    run_stored(case)
    assert "the fields begin at 0.02" in caplog.text and "the fields end at 0.24" in caplog.text
    times, _ = fibers(case / "stored")
    np.testing.assert_allclose(times, 0.02 * np.arange(1, 13), atol=1e-12)
    set_entry(control, "startTime", "0.24")
    refused(case, "there is no step of 0.02 within the fields, 0.02 to 0.24", fresh=True)


def hdf5(path, times, steady=False, box=3 * [2 * np.pi], **changes):
    """Cellular flow (sin x cos y, -cos x sin y, 0) that swells in time, at nodes."""
    n = 8
    x, y, _ = np.indices((n, n, n)) * 2 * np.pi / n
    u = np.stack([np.sin(x) * np.cos(y), -np.cos(x) * np.sin(y), 0 * x])
    with h5py.File(path, "w") as file:
        file["time"] = times
        values = [u * (1 if steady else 1 + t) for t in times]
        file["velocity"] = np.stack(values)
        file.attrs.update(box=box, location="nodes", **changes)
    return path


def test_another_codes_fields(tmp_path):
    """Fibers of a case without flow folders; the mean of the beads at a place of rest stays there."""
    path = make_case(tmp_path / "case", steps=STEPS, prepared=False)
    fields = hdf5(tmp_path / "u.h5", np.linspace(0, 0.3, 4))
    run_stored(path, fields=fields)
    times, positions = fibers(path / "stored")
    assert len(times) == STEPS + 1
    assert np.abs(positions[..., 2].mean(axis=2) - positions[0, ..., 2].mean(axis=1)).max() < 0.05
    assert np.abs(positions[-1] - positions[0]).max() > 0.05
    u = (path / "stored/0.24/U").read_bytes()
    assert b"4096" in u  # on the case's own cells


def test_a_signal_stops_it_cleanly(tmp_path):
    path = make_case(tmp_path / "case", steps=50000, write_every=50000, prepared=False)
    fields = hdf5(tmp_path / "u.h5", [0.0, 2000.0], steady=True)
    argv = [sys.executable, "-m", "gbm_plugin.cli", "run", str(path), *REPLAY, "--fields", str(fields)]
    process = subprocess.Popen(argv, stderr=subprocess.PIPE, text=True)
    table = path / "stored/postProcessing/fibers/0/daemon.dat"
    while not (table.is_file() and len(table.read_text().splitlines()) > 10):
        assert process.poll() is None
        time.sleep(0.05)
    os.kill(process.pid, signal.SIGTERM)
    _, errors = process.communicate()
    assert process.returncode == 3 and "stopped on request" in errors and "Traceback" not in errors
    [saved] = (path / "stored").glob("*/uniform/fibers.npz")
    assert float(saved.parent.parent.name) == pytest.approx(
        float(table.read_text().split("\n")[-2].split()[0])
    )


def refused(path, message, error=ValueError, **options):
    """In one line, as the command line shows it."""
    with pytest.raises(error, match=re.escape(message)):
        run_stored(path, **options)


def test_bad_folders_are_refused(case):
    u = case / "0.1/U"
    content = u.read_bytes()
    u.write_bytes(content[: len(content) // 2])
    refused(case, "0.1/U is cut off")
    u.unlink()
    refused(case, f"time 0.1 has no U in {case}/0.1")
    shutil.rmtree(case / "0.1")
    refused(case, "between the times 0.08 and 0.12 no field is stored")
    done = gbm("run", case, *REPLAY)
    assert done.returncode == 1 and "Traceback" not in done.stderr and len(done.stderr.splitlines()) == 1
    nan = bytearray((case / "0.12/U").read_bytes())
    at = nan.index(b"4096\n(") + 6
    nan[at : at + 8] = np.array([np.nan]).tobytes()
    (case / "0.12/U").write_bytes(nan)
    set_entry(case / "system/controlDict", "startTime", "0.12")
    where = "component 0 in cell (0, 0, 0)"
    refused(case, f"the velocity stored at time 0.12 is not finite: {where}", FloatingPointError)
    set_entry(case / "constant/fiberProperties", "interpolation", "cellPoint")
    refused(
        case,
        "interpolation 'cellPoint' is not one of those for stored fields; allowed: trilinear cubic quintic",
    )
    set_entry(case / "constant/fiberProperties", "interpolation", "cubic")
    set_entry(case / "system/blockMeshDict", "n", "20")
    shutil.rmtree(case / "constant/polyMesh")  # while it is there, it decides
    refused(case, "0.12/U has 4096 values for 8000 cells")


def test_bad_sources_are_refused(tmp_path):
    path = make_case(tmp_path / "case", steps=STEPS, prepared=False)
    refused(path, "has fields at fewer than 2 times (none)")
    refused(path, "there is no file", FileNotFoundError, fields=tmp_path / "none.h5")
    fields = hdf5(tmp_path / "u.h5", [0.0, 1.0], box=(1, 1, 1))
    refused(path, "box is (1 1 1), that of", fields=fields)
    done = gbm("run", path, "--fields", fields)
    assert done.returncode == 1 and "--fields goes with --flow stored" in done.stderr
    done = gbm("run", path, *REPLAY, "--in-time", "spline")
    assert done.returncode == 2 and "'cubic', 'linear'" in done.stderr
