"""What users do to a run: pipes that close, queues that signal, other MPIs, flows at rest, edits between restarts."""

from __future__ import annotations

import os
import re
import shutil
import signal
import stat
import subprocess
import sys
from pathlib import Path

import pytest

from gbm_plugin.output.recording import open_recording
from gbm_plugin.report.report import report

from conftest import HEADER, gbm, make_case, run_case, set_entry
from fakes import Run, alive, children, kill_all_of

pytestmark = pytest.mark.openfoam
CONTROL, FIBERS, FLUID = "system/controlDict", "constant/fiberProperties", "constant/transportProperties"


@pytest.fixture(scope="module")
def prepared(tmp_path_factory):
    return make_case(tmp_path_factory.mktemp("prepared") / "case", cells=12, tight=False)


@pytest.fixture
def case(prepared, tmp_path):
    path = tmp_path / "case"
    shutil.copytree(prepared, path)
    yield path
    kill_all_of(path)


def endless(case: Path) -> None:
    set_entry(case / CONTROL, "endTime", "1000")
    set_entry(case / CONTROL, "writeInterval", "100000")


def latest(case: Path) -> float:
    names = (p.name for p in (*case.iterdir(), *case.glob("processor0/*")))
    return max(float(name) for name in names if re.fullmatch(r"\d[\d.]*", name))


def test_a_pipe_that_nobody_reads(case):
    """Row 12: gbm run case | true."""
    command = [sys.executable, "-m", "gbm_plugin.cli", "run", str(case)]
    process = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
    process.stdout.close()
    errors = process.stderr.read()
    assert process.wait() == 0 and "Error" not in errors, errors
    assert latest(case) == 0.4


@pytest.mark.parametrize("how", [pytest.param("serial", marks=pytest.mark.exhaustive), "parallel"])
def test_a_queue_that_ends_all_processes_of_a_job(how, case):
    """Row 8: SIGTERM to gbm run, daemon, mpirun and every rank."""
    endless(case)
    run = Run(case, *(["--parallel"] if how == "parallel" else []))
    both = run.at_step(7)
    everyone = [run.process.pid, *both.values()]
    for folder in Path("/proc").glob("[0-9]*"):
        words = (folder / "cmdline").read_text().split("\0") if (folder / "cmdline").exists() else []
        if str(case) in words and int(folder.name) not in everyone:
            everyone.append(int(folder.name))  # the ranks
    for pid in everyone:
        os.kill(pid, signal.SIGTERM)
    assert "stopped on request; everything is written: the same command continues" in run.line(code=3)
    assert not any(alive(pid) for pid in everyone)
    last = latest(case)
    assert last >= 0.14
    with open_recording(case / "postProcessing/fibers") as recording:
        assert recording.times[-1] == pytest.approx(last)  # the step under way
    set_entry(case / CONTROL, "endTime", repr(round(last + 0.06, 6)))
    set_entry(case / CONTROL, "writeInterval", "1")
    done = run_case(case, *(["--parallel"] if how == "parallel" else []))
    assert f"continuing from time {last:g}" in done.stdout
    assert gbm("run", case).stdout.endswith("is complete; --fresh repeats it\n")


@pytest.mark.parametrize(
    "number", [pytest.param(signal.SIGUSR1, marks=pytest.mark.exhaustive), signal.SIGHUP], ids=["USR1", "HUP"]
)
def test_signals_of_queues_to_gbm_run(number, case):
    endless(case)
    set_entry(case / CONTROL, "startFrom", "startTime")
    run = Run(case)
    run.at_step(3)
    both = children(run.process.pid)
    run.process.send_signal(number)
    assert "startFrom latestTime in system/controlDict continues it" in run.line(code=3)  # row 3
    assert not any(alive(pid) for pid in both.values())
    again = gbm("run", case)
    assert again.returncode == 1 and "say startFrom latestTime to continue, or --fresh" in again.stderr


def fake_mpirun(folder: Path, text: str) -> dict[str, str]:
    folder.mkdir()
    (folder / "mpirun").write_text(f"#!/bin/sh\n{text}\n")
    (folder / "mpirun").chmod(0o755 | stat.S_IXUSR)
    return {**os.environ, "PATH": f"{folder}:{os.environ['PATH']}"}


def test_an_mpirun_without_oversubscribe(case, tmp_path):
    """Row 11: no option that only Open MPI has."""
    real = shutil.which("mpirun")
    refuse = 'case "$*" in *oversubscribe*) echo "unrecognized argument oversubscribe"; exit 1;; esac'
    done = gbm("run", case, "--parallel", env=fake_mpirun(tmp_path / "bin", f'{refuse}\nexec {real} "$@"'))
    assert done.returncode == 0, done.stderr


def test_what_mpirun_says_is_shown(case, tmp_path):
    words = 'echo "mpiexec: cannot find hydra_pmi_proxy"; exit 7'
    done = gbm("run", case, "--parallel", env=fake_mpirun(tmp_path / "bin", words))
    assert done.returncode == 1
    assert "ended with exit code 7 and said last 'mpiexec: cannot find hydra_pmi_proxy'" in done.stderr


@pytest.mark.parametrize(
    "beginning", [pytest.param("pressure", marks=pytest.mark.exhaustive), "mean velocity"]
)
def test_a_fluid_at_rest(beginning, tmp_path):
    """Row 17: u is zero, or rounding of it; or begins to move in the first step."""
    case = make_case(tmp_path / "case", cells=8, steps=10, time_step=4e-4, prepared=False, tight=False)
    (case / "system/initialFieldDict").unlink()
    (case / "constant/fvOptions").unlink()
    if beginning == "pressure":
        p = case / "0.orig/p"
        p.write_text(p.read_text().replace("uniform 0;", "uniform 1e5;"))
    else:
        force = "m { type meanVelocityForce; selectionMode all; fields (U); Ubar (1 0 0); }"
        (case / "constant/fvOptions").write_text(HEADER + force)
    done = run_case(case)
    assert "predicted" not in done.stdout
    assert report(case)["fibers"] is not None


def test_edits_between_restarts(case):
    """Said on the screen, kept in the recording, listed and drawn in the report."""
    run_case(case)
    set_entry(case / CONTROL, "endTime", "0.5")
    set_entry(case / FLUID, "nu", "0.02")
    fibers = case / FIBERS
    fibers.write_text(fibers.read_text().replace("Stiffness 1e-4", "Stiffness 1e-5"))
    done = run_case(case)
    assert "changed since the start: test bendingStiffness 1e-4 → 1e-5, nu 0.01 → 0.02\n" in done.stdout
    with open_recording(case / "postProcessing/fibers") as recording:
        texts = [dictionaries[FLUID] for _, dictionaries in recording.starts]
        assert len(texts) == 2 and "0.01" in texts[0] and "0.02" in texts[1]
    found = report(case)["changes"]
    assert len(found) == 1 and found[0]["time"] == pytest.approx(0.4)
    assert found[0]["changes"] == ["test bendingStiffness 1e-4 → 1e-5", "nu 0.01 → 0.02"]


def test_a_box_that_changed_between_restarts(case):
    from gbm_plugin.case.openfoam import utility

    run_case(case)
    utility(case, "transformPoints", "-scale", "(0.5 0.5 0.5)")
    set_entry(case / CONTROL, "endTime", "0.5")
    done = gbm("run", case)
    assert done.returncode == 1 and "--fresh begins again" in done.stderr
    assert "the box of the mesh was (6.28319 6.28319 6.28319)" in done.stderr


def test_warnings_of_the_daemon_reach_the_screen(tmp_path):
    """A step at which the flow is foreseen badly: named while the run goes on, and counted at its end."""
    field = "field random; kineticEnergy 4; peakWavenumber 4; maxWavenumber 5;"
    case = make_case(tmp_path / "case", cells=12, steps=20, time_step=0.04, initial=field, tight=False)
    done = gbm("run", case)
    said = [line for line in done.stdout.splitlines() if "predicted with an error of" in line]
    assert said and said[0].startswith("step "), done.stdout + done.stderr
    files = list((case / "postProcessing/fibers").glob("*/warnings.txt"))
    assert len(files) == 1 and files[0].read_text().splitlines() == said
