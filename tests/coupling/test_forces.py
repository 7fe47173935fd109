"""Forces that come back wrong, to the real pimpleFoam: one line, and the end of both sides."""

from __future__ import annotations

import numpy as np
import pytest

from gbm_plugin.coupling.message import Kind, Message, encode_array, encode_welcome

from conftest import make_case
from fakes import FAMILIES, PATIENCE, fake_daemon, header, positions

pytestmark = pytest.mark.openfoam

BEADS = 72


@pytest.fixture(scope="module")
def prepared(tmp_path_factory):
    path = make_case(tmp_path_factory.mktemp("forces") / "case", timeout=PATIENCE)
    properties = path / "constant/fiberProperties"
    properties.write_text(properties.read_text().replace("coupling {", "coupling { feedback yes;"))
    return path


def forces(step: int = 0, value: float = 0.0, **changes) -> Message:
    values = {"step": step, "time": 0.02 * step, "payload": encode_array(np.full((2, BEADS, 3), value))}
    return Message(Kind.FORCES, **{**values, **changes})


FAULTS = {
    "short": (forces(payload=bytes(48 * 71)).encode(), f"FORCES has {48 * 71} bytes, expected {48 * 72}"),
    "oversize": (header(forces(), size=1 << 50), f"announces {1 << 50} bytes"),
    "of another step": (forces(1).encode(), "FORCES is of step 1, expected step 0"),
    "of another time": (forces(time=0.01).encode(), "FORCES are of time 0.01, expected time 0"),
    "NaN": (forces(value=np.nan).encode(), "FORCES are not finite at bead 0"),
    "flags": (header(forces(), flags=4), "FORCES has unknown flags: 4"),
    "positions instead": (positions(1, BEADS).encode(), "expected FORCES, received POSITIONS"),
}


@pytest.mark.parametrize("fault", FAULTS)
def test_pimplefoam_with_forces_that_are(fault, prepared):
    data, expected = FAULTS[fault]

    def misbehave(channel, first, beads):
        channel.send(Message(Kind.WELCOME, 0, 0.0, encode_welcome("rotation", True, FAMILIES)))
        channel.send(positions(0, beads))
        channel.receive(1 << 20)
        channel._write(data)

    line = fake_daemon(prepared, misbehave)
    assert expected in line and f"its log: {prepared}/log.gbmDaemon" in line
