"""Forces on the wire: none without the word, and those that come wrong to the real pimpleFoam end both sides in one
line."""

from __future__ import annotations

import numpy as np
import pytest

from gbm_plugin.case.scene import read_scene
from gbm_plugin.coupling.listen import listen
from gbm_plugin.coupling.message import PROVISIONAL, Kind, Message

from conftest import make_case, solver_log, start_solver
from fakes import PATIENCE, FakeSolver, fake_daemon, forces, header, positions, welcome

pytestmark = pytest.mark.openfoam

BEADS = 72


@pytest.fixture(scope="module")
def prepared(tmp_path_factory):
    path = make_case(tmp_path_factory.mktemp("forces") / "case", timeout=PATIENCE)
    properties = path / "constant/fiberProperties"
    properties.write_text(properties.read_text().replace("coupling {", "coupling { feedback yes;"))
    return path


FAULTS = {
    "short": (
        forces(0, BEADS, payload=bytes(48 * 71)).encode(),
        f"FORCES has {48 * 71} bytes, expected {48 * 72}",
    ),
    "oversize": (header(forces(0, BEADS), size=1 << 50), f"announces {1 << 50} bytes"),
    "of another step": (forces(1, BEADS).encode(), "FORCES is of step 1, expected step 0"),
    "of another time": (forces(0, BEADS, time=0.01).encode(), "FORCES are of time 0.01, expected time 0"),
    "NaN": (forces(0, BEADS, np.nan).encode(), "FORCES are not finite at bead 0"),
    "flags": (header(forces(0, BEADS), flags=4), "FORCES has unknown flags: 4"),
    "of no kind": (header(forces(0, BEADS), kind=99), "received message of unknown type 99"),
    "of another version": (header(forces(0, BEADS), version=3), "version 3"),
    "of a stranger": (header(forces(0, BEADS), magic=b"HTTP"), "what answers is not a gbm daemon"),
    "positions instead": (positions(1, BEADS).encode(), "expected FORCES, received POSITIONS"),
}


@pytest.mark.parametrize("fault", FAULTS)
def test_pimplefoam_with_forces_that_are(fault, prepared):
    data, expected = FAULTS[fault]

    def misbehave(channel, first, beads):
        channel.send(welcome(feedback=True))
        channel.send(positions(0, beads))
        channel.receive(1 << 20)
        channel._write(data)

    line = fake_daemon(prepared, misbehave)
    assert expected in line and f"its log: {prepared}/log.gbmDaemon" in line


@pytest.mark.parametrize("seed", range(4))
def test_forces_with_bytes_at_random(seed, prepared):
    """Whatever they are, the solver ends in one line: by what is wrong with them, with the flow, or with the peer."""
    rng = np.random.default_rng(seed)

    def misbehave(channel, first, beads):
        channel.send(welcome(feedback=True))
        channel.send(positions(0, beads))
        channel.receive(1 << 20)
        data = bytearray(forces(0, beads, 0.1).encode())
        some = 40 if seed % 2 else len(data)  # the header alone, or all
        for place in rng.integers(some, size=1 + rng.integers(4)):
            data[place] = rng.integers(256)
        channel._write(bytes(data[: len(data) - (seed % 3 == 0) * rng.integers(len(data))]))
        channel._socket.close()

    line = fake_daemon(prepared, misbehave)
    assert "\n" not in line and len(line) < 400


def said(case, words):
    """What a real daemon sends in six steps at whose samples nothing changes, after WELCOME."""
    properties = case / "constant/fiberProperties"
    properties.write_text(properties.read_text().replace("coupling {", f"coupling {{ {words}"))
    messages = []
    with FakeSolver(case) as solver:
        solver.connect()
        while (message := solver.receive()).kind is not Kind.WELCOME:
            pass
        while True:
            messages.append(message := solver.receive())
            if message.step == 6:
                return messages
            if message.kind is Kind.POSITIONS:
                solver.raw(solver.sample(message.step).encode())


def test_without_the_word_nothing_more_is_sent(case):
    """Positions and nothing else; with it the same ones to the bit, and 48 bytes a bead after each final sample."""
    without = said(case("without"), "")
    assert {m.kind for m in without} == {Kind.POSITIONS} and {len(m.payload) for m in without} == {24 * BEADS}
    both = said(case("with"), "feedback yes; ownDisturbance kept;")
    sent = [m for m in both if m.kind is Kind.FORCES]
    assert {len(m.payload) for m in sent} == {48 * BEADS}
    final = [m for m in without if not m.flags & PROVISIONAL and m.step < 6]
    assert [m.step for m in sent] == [m.step for m in final] == list(range(6))
    assert [m for m in both if m.kind is Kind.POSITIONS] == without


def test_without_the_word_openfoam_asks_for_nothing_more(tmp_path):
    """A daemon that never sends a force; its samples are as long as ever, and no force is a field or a column."""
    case = make_case(
        tmp_path / "case", application="boxFoam", cells=12, steps=2, time_step=0.02, write_every=2
    )
    sizes = []
    with listen(case, read_scene(case).coupling, solver_log(case)) as listener:
        solver = start_solver(case)
        try:
            channel, _, _ = listener.greet(lambda: solver.poll() is not None)
            channel.send(welcome())
            for step in range(3):
                channel.send(positions(step, BEADS))
                message = channel.receive(1 << 20)
                sizes.append(len(message.payload))
            channel.send(positions(3, BEADS))
            while (message := channel.receive(1 << 20)).kind is not Kind.END:
                assert message.kind is Kind.SAVE
            channel.send(Message(Kind.GOODBYE, message.step, message.time))
            assert solver.wait() == 0
        finally:
            solver.kill()
            solver.wait()
    assert sizes == [48 * BEADS] * 3
    assert not list(case.glob("*/fiberForce"))
    head = next(case.glob("postProcessing/**/coupling.dat")).read_text()
    assert "spreading" not in head and "forces" not in head
