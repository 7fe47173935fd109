"""Fibers move while OpenFOAM solves: shown by the order of what happens, however long each takes."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

from gbm_plugin.case.openfoam import fatal_message
from gbm_plugin.output.tables import read_dat

from conftest import make_case, solver_log, start_solver
from fakes import until

pytestmark = pytest.mark.openfoam

STEPS = 10
LATE_DAEMON = Path(__file__).with_name("late_daemon.py")


# steps that each solver is ahead of positions that it does not need yet
AHEAD = {"pimpleFoam": 1, "boxFoam": 2}


def run(path, solver: str, ahead: int, timeout: float = 300):
    """The solver's exit code in a run whose daemon sends positions only once the solver is so many steps ahead."""
    make_case(path, steps=STEPS, cells=10, tight=False, timeout=timeout, application=solver)
    solver_log(path).touch()
    with (path / "log.gbmDaemon").open("w") as log:
        argv = [sys.executable, LATE_DAEMON, path, solver_log(path), str(ahead), str(STEPS)]
        daemon = subprocess.Popen(argv, stdout=log, stderr=log)
    try:
        until((path / "gbm.sock").exists, "the daemon's socket")
        return start_solver(path).wait()
    finally:
        daemon.kill()
        daemon.wait()


@pytest.mark.parametrize("solver", AHEAD)
def test_the_solver_needs_no_positions_before_it_has_solved_the_step(tmp_path, solver):
    """Those of step n + 1 are made of the sample of step n, and wait until step n + 1 is solved: without overlap each
    side would wait for the other. boxFoam solves step n + 2 while these positions come and are sampled at."""
    path = tmp_path / "case"
    assert run(path, solver, AHEAD[solver]) == 0, solver_log(path).read_text()[-2000:]
    flow = read_dat(path / "postProcessing/fibers", "coupling.dat")
    assert len(flow["Time"]) == STEPS + 1


@pytest.mark.parametrize("solver", AHEAD)
def test_nor_does_it_solve_a_step_ahead_of_them(tmp_path, solver):
    path = tmp_path / "case"
    assert run(path, solver, AHEAD[solver] + 1, timeout=3) == 1
    assert "the daemon was silent" in fatal_message(solver_log(path))
