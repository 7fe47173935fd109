"""What the suite does with a test that hangs."""

from __future__ import annotations

import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from conftest import make_case, start_solver
from fakes import start_gbm, until
from hang import stacks

HANGS = """
import subprocess

def test_that_hangs():
    subprocess.run(["sleep", "1000"])

def test_after_it():
    pass
"""


def test_it_fails_and_the_next_one_runs(tmp_path):
    (tmp_path / "test_it.py").write_text(HANGS)
    argv = [
        sys.executable,
        "-m",
        "pytest",
        "-p",
        "hang",
        "-o",
        "hang_after=1",
        "-p",
        "no:cacheprovider",
        tmp_path,
    ]
    here = Path(__file__).parent
    done = subprocess.run(argv, capture_output=True, text=True, cwd=tmp_path, env={"PYTHONPATH": str(here)})
    assert "1 failed, 1 passed" in done.stdout, done.stdout + done.stderr
    assert "test_that_hangs did not end in 1 s" in done.stdout
    assert ", line 5 in test_that_hangs" in done.stdout and "sleep 1000" in done.stdout


def rests(process) -> bool:
    """Whether it sleeps for a while, as one does that waits for another."""
    stat = Path(f"/proc/{process.pid}/stat")
    return all(") S " in stat.read_text() and not time.sleep(0.01) for _ in range(20))


@pytest.mark.openfoam
def test_stacks_of_a_solver_and_a_daemon(tmp_path):
    """Each waits for somebody who does not come; the daemon is stopped as well."""
    alone = make_case(tmp_path / "alone", timeout=1e6, tight=False)
    with (alone / "log.gbmDaemon").open("w") as log:
        daemon = start_gbm("daemon", alone, stdout=log, stderr=log)
    until(lambda: "waiting for" in (alone / "log.gbmDaemon").read_text() and rests(daemon), "its rest")
    daemon.send_signal(signal.SIGSTOP)
    other = make_case(tmp_path / "other", timeout=1e6, tight=False)
    solver = start_solver(other)
    until(lambda: "Starting time loop" in (other / "log.boxFoam").read_text(), "the solver's start")
    until(lambda: rests(solver), "its rest")
    text = stacks()
    assert daemon.wait() == -signal.SIGABRT and solver.wait() != 0
    assert "in greet" in text and "coupling/sockets.py" in text
    assert "Foam::sigQuit::sigHandler" in text and "boxFoam -case" in text
    assert "test_stacks_of_a_solver_and_a_daemon" in text
