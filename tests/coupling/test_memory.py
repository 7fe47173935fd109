"""What the solver holds of a message: once, beside the beads themselves."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest

from gbm_plugin.case.scene import read_scene
from gbm_plugin.coupling.listen import listen
from gbm_plugin.coupling.message import Kind, Message, encode_array, encode_welcome, sample_size

from conftest import make_case, set_families, solver_log, start_solver

pytestmark = pytest.mark.openfoam


def peak(case: Path, transport: str, beads: int) -> tuple[int, int]:
    """The most memory that the solver had after it sent a sample with gradients, and the size of that [bytes]."""
    set_families(case, f"many {{ count {beads // 2}; beads 2; length 1; bendingStiffness 1; }}")
    coupling = read_scene(case).coupling
    assert coupling.transport == transport
    solver = start_solver(case)
    try:
        with listen(case, coupling, solver_log(case)) as listener:
            channel, first, _ = listener.greet(lambda: solver.poll() is not None)
            welcome = encode_welcome("gradient", False, [(beads // 2, 2, 0)])
            channel.send(Message(Kind.WELCOME, first.step, first.time, welcome))
            positions = np.random.default_rng(1).uniform(0, 6, (beads, 3))
            channel.send(Message(Kind.POSITIONS, first.step, first.time, encode_array(positions)))
            size = sample_size(beads, "gradient")
            assert len(channel.receive(size).payload) == size
            status = Path(f"/proc/{solver.pid}/status").read_text()
            return 1024 * int(re.search(r"VmHWM:\s+(\d+) kB", status)[1]), size
    finally:
        solver.kill()
        solver.wait()


@pytest.mark.parametrize("transport", ["socket", "file"])
def test_a_sample_is_held_less_than_twice(transport, tmp_path):
    case = make_case(tmp_path / "case", cells=16, transport=transport, application="boxFoam")
    (small, _), (large, size) = (peak(case, transport, beads) for beads in (2000, 400_000))
    assert large - small > size  # it is measured at all
    assert large - small < 2 * size
