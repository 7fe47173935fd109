"""A daemon that prepares for longer than the solver's patience says so, and the solver waits."""

import subprocess
import sys
from pathlib import Path

import pytest

from conftest import start_solver
from fakes import until

pytestmark = pytest.mark.openfoam

SLOW_START = Path(__file__).with_name("slow_start.py")


def test_the_solver_waits_knowingly(case):
    timeout = 3
    path = case(cells=12, steps=2, timeout=timeout)
    log = path / "log.gbmDaemon"
    with log.open("w") as output:
        argv = [sys.executable, str(SLOW_START), str(path), str(1.5 * timeout)]
        daemon = subprocess.Popen(argv, stdout=output, stderr=output)
    try:
        until(lambda: "waiting for OpenFOAM" in log.read_text() or daemon.poll() is not None, "its start")
        solver = start_solver(path)
        said = (path / "log.boxFoam").read_text
        assert solver.wait() == 0, said()[-2000:]
        assert daemon.wait() == 0, log.read_text()[-2000:]
    finally:
        daemon.kill()
    assert said().count("fiber coupling: the daemon prepares its kernels and fibers") >= 2
