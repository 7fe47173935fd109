"""A connection that says nothing does not keep the solver from its daemon."""

from __future__ import annotations

import socket
import subprocess
import sys
import time

import pytest

from conftest import make_case, start_solver

pytestmark = pytest.mark.openfoam


def test_a_silent_stranger_on_tcp(tmp_path):
    path = make_case(tmp_path / "case", steps=3, transport="tcp")
    with (path / "log.gbmDaemon").open("w") as log:
        argv = [sys.executable, "-m", "gbm_plugin.cli", "daemon", str(path)]
        daemon = subprocess.Popen(argv, stdout=log, stderr=log)
    try:
        while not (path / "gbm.tcp").is_file():
            assert daemon.poll() is None
            time.sleep(0.05)
        host, port, _ = (path / "gbm.tcp").read_text().split()
        with socket.create_connection((host, int(port))):
            assert start_solver(path).wait(60) == 0, (path / "log.pimpleFoam").read_text()[-2000:]
        assert daemon.wait(30) == 0
        assert "refused a connection" in (path / "log.gbmDaemon").read_text()
    finally:
        daemon.kill()
