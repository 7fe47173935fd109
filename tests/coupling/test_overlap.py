"""Fibers move while OpenFOAM solves: shown by the order of what happens, however long each takes."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

from gbm_plugin.case.openfoam import fatal_message
from gbm_plugin.output.tables import read_dat

from conftest import make_case, start_solver
from fakes import until

pytestmark = pytest.mark.openfoam

STEPS = 10
LATE_DAEMON = Path(__file__).with_name("late_daemon.py")


def run(path, ahead: int, timeout: float = 300):
    """The solver's exit code in a run whose daemon sends positions only once the solver is so many steps ahead."""
    make_case(path, steps=STEPS, cells=10, tight=False, timeout=timeout)
    (path / "log.pimpleFoam").touch()
    with (path / "log.gbmDaemon").open("w") as log:
        argv = [sys.executable, LATE_DAEMON, path, str(ahead), str(STEPS)]
        daemon = subprocess.Popen(argv, stdout=log, stderr=log)
    try:
        until((path / "gbm.sock").exists, "the daemon's socket")
        return start_solver(path).wait()
    finally:
        daemon.kill()
        daemon.wait()


def test_the_solver_needs_no_positions_before_it_has_solved_the_step(tmp_path):
    """Those of step n + 1 are made of the sample of step n, and wait until step n + 1 is solved. Without overlap each
    side would wait for the other."""
    path = tmp_path / "case"
    assert run(path, 1) == 0, (path / "log.pimpleFoam").read_text()[-2000:]
    flow = read_dat(path / "postProcessing/fibers", "coupling.dat")
    assert len(flow["Time"]) == STEPS + 1


def test_nor_does_it_solve_a_step_ahead_of_them(tmp_path):
    path = tmp_path / "case"
    assert run(path, 2, timeout=3) == 1
    assert "the daemon was silent" in fatal_message(path / "log.pimpleFoam")
