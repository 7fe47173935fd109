"""Fibers move while OpenFOAM solves: shown by the clocks of both sides, and by a daemon made slow."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from gbm_plugin.output.tables import read_dat

from conftest import make_case, start_solver

pytestmark = pytest.mark.openfoam

STEPS = 15
SLOW_DAEMON = Path(__file__).with_name("slow_daemon.py")


def run(path, pause: float):
    """A run whose daemon sleeps `pause` seconds a step: seconds per step, and both sides' tables."""
    make_case(path, cells=40, steps=STEPS, time_step=0.005, tight=True)
    with (path / "log.gbmDaemon").open("w") as log:
        daemon = subprocess.Popen(
            [sys.executable, str(SLOW_DAEMON), str(path), str(pause)], stdout=log, stderr=log
        )
    solver = start_solver(path)
    try:
        assert solver.wait(240) == 0, (path / "log.pimpleFoam").read_text()[-2000:]
        assert daemon.wait(30) == 0, (path / "log.gbmDaemon").read_text()[-2000:]
    finally:
        solver.kill()
        daemon.kill()
    flow = read_dat(path / "postProcessing/fibers", "coupling.dat")
    fibers = read_dat(path / "postProcessing/fibers", "daemon.dat")
    return np.diff(flow["sentAt"])[3:], flow, fibers


@pytest.fixture(scope="module")
def step_time(tmp_path_factory):
    """Seconds of a step with the daemon as it is."""
    return float(np.median(run(tmp_path_factory.mktemp("fast") / "case", 0.0)[0]))


def test_a_daemon_of_nine_tenths_of_a_step_costs_nothing(tmp_path, step_time):
    """Positions of step n + 1 leave the daemon its pause after the sample of step n came, so they are made
    while the solver is in that step; the solver then waits for less than 5 % of it. The best of three
    attempts, as other work on the machine slows one side or the other."""
    pause = 0.9 * step_time
    assert pause > 0.05
    shares = []
    for attempt in range(3):
        steps, flow, fibers = run(tmp_path / str(attempt), pause)
        sent, left = fibers["sentAt"][4:], flow["sentAt"][3:-1]
        assert np.all(sent - left > 0.99 * pause)
        shares.append(np.median(flow["wait"][4:]) / np.median(steps))
        if shares[-1] < 0.05:
            assert np.mean(flow["arrivedAt"][4:] > sent) > 0.9
            return
    pytest.fail(f"the solver waited for {min(shares):.0%} of a step")
