"""What a long run of the default case leaves in its log."""

from __future__ import annotations

import pytest

from conftest import make_case, start_solver

pytestmark = pytest.mark.openfoam


def test_a_step_takes_few_bytes(tmp_path):
    """Times, Courant numbers and continuity, and not the residuals of ten linear solves: 10⁶ steps stay below 1 GB."""
    steps = 10
    path = make_case(tmp_path / "case", steps=steps, tight=False, application="pimpleFoam")
    (path / "constant/fiberProperties").unlink()
    control = path / "system/controlDict"
    head, _, rest = control.read_text().partition("functions")
    assert "DebugSwitches" in rest
    control.write_text(head + rest[rest.index("DebugSwitches") :])
    assert start_solver(path).wait(60) == 0
    log = (path / "log.pimpleFoam").read_text()
    per_step = len(log[log.index("Starting time loop") :]) / steps
    assert log.count("Time = ") >= steps and log.count("continuity errors") >= steps
    assert per_step < 1000
