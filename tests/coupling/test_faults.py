"""Each fault, on the real processes: one line names the cause, the peer and its log; recorded data stay readable."""

from __future__ import annotations

import os
import re
import shutil
import signal
import socket
import stat
import subprocess
import time
from dataclasses import replace
from pathlib import Path

import pytest

from gbm_plugin.case.openfoam import fatal_message
from gbm_plugin.coupling.message import Kind, Message
from gbm_plugin.output.recording import open_recording
from gbm_plugin.run.standstill import members

from conftest import divide, gbm, make_case, set_entry, solver_log, start_solver
from fakes import (
    FakeSolver,
    Run,
    children,
    fake_daemon,
    forces,
    greet,
    header,
    is_solver,
    kill_all_of,
    one_line,
    positions,
    start_gbm,
    until,
    welcome,
)

pytestmark = pytest.mark.openfoam

PATIENT, IMPATIENT = 300, 3  # s: of a case whose fault shows at once, and of one whose fault is silence
NAN = float("nan")


@pytest.fixture(scope="module")
def original(tmp_path_factory):
    """To be copied."""
    return make_case(tmp_path_factory.mktemp("original") / "case", timeout=PATIENT, application="boxFoam")


@pytest.fixture
def copy(original, tmp_path):
    """A case of one's own, with another transport and timeout, and perhaps fibers that act on the flow."""

    def make(transport: str = "socket", timeout: float = PATIENT, name: str = "case", feedback: bool = False):
        case = shutil.copytree(original, tmp_path / name)
        set_coupling(case, transport, timeout, feedback)
        return case

    return make


def set_coupling(case, transport: str, timeout: float, feedback: bool = False) -> None:
    properties = case / "constant/fiberProperties"
    more = "feedback yes; ownDisturbance kept;" if feedback else ""
    words = f"coupling {{ transport {transport}; timeout {timeout:g}; {more} }}"
    text, found = re.subn(r"coupling \{.*?\}", words, properties.read_text())
    assert found == 1
    properties.write_text(text)


@pytest.fixture
def prepared(copy):
    return copy()


@pytest.fixture
def silence(copy) -> float:
    """A timeout that both sides of a real run keep while they start: some times what a daemon takes to listen at
    the load of the moment [s]."""
    case = copy(name="start")
    began = time.monotonic()
    daemon = start_gbm("daemon", case)
    until((case / "gbm.sock").exists, "the socket")
    taken = time.monotonic() - began
    daemon.terminate()
    daemon.communicate()
    return round(max(IMPATIENT, 5 * taken), 1)


@pytest.fixture
def long_case(prepared):
    """A run that does not end by itself."""
    case = prepared
    set_entry(case / "system/controlDict", "endTime", "1000")
    set_entry(case / "system/controlDict", "writeInterval", "5")
    yield case
    kill_all_of(case)


def records(case) -> int:
    """How many records can be read."""
    with open_recording(case / "postProcessing/fibers") as recording:
        assert len(recording.families["test"].positions[:]) == len(recording.times)
        return len(recording.times)


def shortened(case, more_steps: int = 8) -> None:
    """endTime a few steps after the latest time that is written."""
    latest = max(
        (float(p.name) for p in case.iterdir() if p.name[0].isdigit() and p.name != "0.orig"), default=0
    )
    set_entry(case / "system/controlDict", "endTime", repr(round(latest + more_steps * 0.02, 6)))


# --- a solver that misbehaves, against the real daemon ------------------------------------------------------


def _then_close(solver, data: bytes) -> None:
    solver.raw(data)
    solver.close()


SOLVER_FAULTS = {
    "truncated": (lambda s: _then_close(s, s.sample(4).encode()[:500]), "closed the connection"),
    "cut in the header": (lambda s: _then_close(s, s.sample(4).encode()[:17]), "closed the connection"),
    "short": (
        lambda s: s.raw(Message(Kind.SAMPLE, 4, 0.08, b"\0" * 800).encode()),
        "SAMPLE of step 4 has 800 bytes",
    ),
    "duplicated": (
        lambda s: [s.raw(s.sample(4).encode()) for _ in range(2)],
        "SAMPLE is of step 4, time 0.08; step 5, time 0.1",
    ),
    "out of order": (
        lambda s: s.raw(s.sample(6).encode()),
        "SAMPLE is of step 6, time 0.12; step 4, time 0.08",
    ),
    "late": (
        lambda s: s.raw(header(s.sample(4), time=0.09)),
        "SAMPLE is of step 4, time 0.09; step 4, time 0.08",
    ),
    "version": (lambda s: s.raw(header(s.sample(4), version=9)), "version 9 of the coupling protocol"),
    "unknown kind": (lambda s: s.raw(header(s.sample(4), kind=77)), "unknown kind 77"),
    "kind of the other side": (
        lambda s: s.raw(Message(Kind.WELCOME, 4, 0.08).encode()),
        "received WELCOME where",
    ),
    "not a message": (
        lambda s: s.raw(b"GET / HTTP/1.1\r\nHost: localhost\r\n\r\n" + b"." * 40),
        "not a message of a gbm",
    ),
    "oversize": (
        lambda s: s.raw(header(s.sample(4), size=1 << 50)),
        f"announces {1 << 50} bytes where at most",
    ),
    "NaN": (lambda s: s.raw(s.sample(4, NAN).encode()), "SAMPLE of step 4 holds values that are not finite"),
    "NaN time": (lambda s: s.raw(header(s.sample(4), time=NAN)), "has the time nan"),
    "foreign folder": (
        lambda s: s.raw(s.sample(4, keep=True).encode() + Message(Kind.SAVE, 4, 0.08, b"../../etc").encode()),
        "is not a time folder",
    ),
    "save of another step": (
        lambda s: s.raw(s.sample(4, keep=True).encode() + Message(Kind.SAVE, 3, 0.06, b"0.06").encode()),
        "SAVE is of step 3",
    ),
    "end with a payload": (
        lambda s: s.raw(Message(Kind.END, 3, 0.06, b"and more").encode()),
        "END of step 3 has 8 bytes",
    ),
    "nothing to save": (
        lambda s: s.raw(Message(Kind.SAVE, 4, 0.08, b"0.08").encode()),
        "received SAVE where SAMPLE or END must come",
    ),
    "early end": (lambda s: s.raw(Message(Kind.END, 1, 0.02).encode()), "END is of step 1"),
    "error": (
        lambda s: s.raw(Message(Kind.ERROR, 4, 0.08, b"out of coffee").encode()),
        "stopped: out of coffee",
    ),
    "silence": (lambda s: None, f"OpenFOAM was silent for {IMPATIENT} s"),
    "half a message, then silence": (lambda s: s.raw(s.sample(4).encode()[:500]), "was silent"),
}


# on the other transports, and there with forces between sample and positions, those that a transport could hide; a
# file is a whole message or a short one
SOLVER_FAULTS_ELSEWHERE = ("truncated", "duplicated", "out of order", "version", "NaN")
IN_FILES = {
    "truncated": "short message",
    "two in one": f"SAMPLE of step 4 is followed by {40 + 8 * 6 * 72} bytes",
}
SOLVER_FAULTS_IN_FILES = {"two in one": (lambda s: s.raw(2 * s.sample(4).encode()), "")}


@pytest.mark.parametrize(
    "transport, fault",
    [("socket", fault) for fault in SOLVER_FAULTS]
    + [("tcp", fault) for fault in ("truncated", "half a message, then silence")]
    + [pytest.param("tcp", fault, marks=pytest.mark.exhaustive) for fault in SOLVER_FAULTS_ELSEWHERE[1:]]
    + [("file", fault) for fault in (*SOLVER_FAULTS_ELSEWHERE, *SOLVER_FAULTS_IN_FILES)],
)
def test_daemon_with_a_solver_that_is(transport, fault, copy):
    prepared = copy(transport, IMPATIENT if "silence" in fault else PATIENT, feedback=transport != "socket")
    misbehave, expected = (SOLVER_FAULTS | SOLVER_FAULTS_IN_FILES)[fault]
    if transport == "file":
        expected = IN_FILES.get(fault, expected)
    with FakeSolver(prepared) as solver:
        solver.connect()
        solver.serve_until(4)
        misbehave(solver)
        if solver.socket.fileno() >= 0 and fault != "error":
            assert expected in solver.last_word()
            solver.close()
        line = one_line(solver.daemon, "daemon")
    assert expected in line and str(solver_log(prepared)) in line
    taken = fault in ("duplicated", "foreign folder", "save of another step")
    assert records(prepared) == (5 if taken else 4)
    assert not solver.address.exists()


@pytest.mark.parametrize(
    "change, expected",
    [
        ({"viscosity": 0.02}, "nu = 0.02, the case"),
        ({"time_step": 0.01}, "deltaT = 0.01, the case"),
        ({"box_max": (1.0, 6.283185307179586, 6.283185307179586)}, "box length in x = 1, the case"),
        ({"viscosity": NAN}, "values that are not finite"),
        ({"folder": "../elsewhere"}, "is not a time folder"),
    ],
    ids=lambda x: next(iter(x)) if isinstance(x, dict) else "",
)
def test_daemon_with_a_solver_on_another_case(change, expected, prepared):
    with FakeSolver(prepared) as solver:
        solver.connect(**change)
        assert expected in solver.last_word()
        solver.close()
        line = one_line(solver.daemon, "daemon")
    assert expected in line and "log.boxFoam" in line


@pytest.mark.parametrize("transport", ["socket", "tcp"])
def test_daemon_with_a_solver_that_goes_on_after_its_end(transport, copy):
    prepared = copy(transport, PATIENT)
    with FakeSolver(prepared) as solver:
        solver.connect()
        solver.serve_until(4)
        solver.raw(Message(Kind.END, 3, 0.06).encode() + b"and more")
        while solver.receive().kind is not Kind.GOODBYE:
            pass
        solver.close()
        line = one_line(solver.daemon, "daemon")
    assert "END is followed by 8 bytes: what is recorded is kept" in line
    assert records(prepared) == 4


# --- a daemon that misbehaves, against the real boxFoam --------------------------------------------------


def _after_greeting(make):
    """The fault in place of the positions of step 1."""

    def misbehave(channel, first, beads):
        greet(channel, first, beads)
        data = make(beads)
        if data is not None:
            channel._write(data)

    return misbehave


def _welcome(*numbers):
    import struct

    def misbehave(channel, first, beads):
        channel.send(Message(Kind.WELCOME, 0, 0.0, struct.pack(f"<{len(numbers)}q", *numbers)))

    return misbehave


def _cut(channel, first, beads):
    greet(channel, first, beads)
    channel._write(positions(1, beads).encode()[:500])
    if hasattr(channel, "_socket"):
        channel._socket.close()


DIFFERENT = (
    "WELCOME and constant/fiberProperties have different families (their number; fibers, beads and first fiber of "
    "each)"
)
DAEMON_FAULTS = {
    "truncated": (_cut, "the daemon closed the connection"),
    "short": (
        _after_greeting(lambda n: positions(1, n - 1).encode()),
        f"has {24 * 71} bytes, expected {24 * 72}",
    ),
    "duplicated": (
        _after_greeting(lambda n: positions(0, n).encode()),
        "POSITIONS is of step 0, expected step 1",
    ),
    "out of order": (
        _after_greeting(lambda n: positions(2, n).encode()),
        "POSITIONS is of step 2, expected step 1",
    ),
    "late": (
        _after_greeting(lambda n: positions(1, n, time=0.03).encode()),
        "are of time 0.03, expected time 0.02",
    ),
    "version": (
        _after_greeting(lambda n: header(positions(1, n), version=9)),
        "version 9 of the coupling protocol",
    ),
    "unknown kind": (
        _after_greeting(lambda n: header(positions(1, n), kind=77)),
        "message of unknown type 77",
    ),
    "kind of the other side": (
        _after_greeting(lambda n: header(positions(1, n), kind=4)),
        "expected POSITIONS, received SAMPLE",
    ),
    "not a message": (
        _after_greeting(lambda n: b"HTTP/1.1 400 Bad Request\r\n" + b"." * 80),
        "is not a gbm daemon",
    ),
    "oversize": (
        _after_greeting(lambda n: header(positions(1, n), size=1 << 50)),
        f"announces {1 << 50} bytes",
    ),
    "NaN": (_after_greeting(lambda n: positions(1, n, NAN).encode()), "POSITIONS are not finite at bead 0"),
    "infinite": (_after_greeting(lambda n: positions(1, n, float("inf")).encode()), "not finite at bead 0"),
    "NaN time": (
        _after_greeting(lambda n: header(positions(1, n), time=NAN)),
        "POSITIONS has the time nan",
    ),
    "unknown flags": (
        _after_greeting(lambda n: header(positions(1, n), flags=9)),
        "POSITIONS has unknown flags: 9",
    ),
    "reserved word": (
        _after_greeting(lambda n: header(positions(1, n), reserved=1)),
        "POSITIONS has 1 where 0 is reserved",
    ),
    "NaN time of WELCOME": (
        lambda channel, first, beads: channel._write(header(welcome(), time=NAN)),
        "WELCOME has the time nan",
    ),
    "flags of WELCOME": (
        lambda channel, first, beads: channel._write(header(welcome(), flags=1)),
        "WELCOME has unknown flags: 1",
    ),
    "error of many lines": (
        _after_greeting(lambda n: Message(Kind.ERROR, 0, 0.0, b"out of\n\x1b[2Jtea").encode()),
        "the daemon stopped: out of??[2Jtea",
    ),
    "error": (
        _after_greeting(lambda n: Message(Kind.ERROR, 0, 0.0, b"out of tea").encode()),
        "the daemon stopped: out of tea",
    ),
    "silence": (_after_greeting(lambda n: None), f"the daemon was silent for {IMPATIENT} s"),
    "half a message, then silence": (
        _after_greeting(lambda n: positions(1, n).encode()[:500]),
        "was silent for",
    ),
    "welcome without families": (_welcome(1, 0, 0), DIFFERENT),
    "welcome with a negative count": (_welcome(1, 0, 1, -3, 4, 0), DIFFERENT),
    "welcome with too many beads": (
        _welcome(1, 0, 1, 1 << 40, 1 << 40, 0),
        DIFFERENT,
    ),
    "welcome with fewer families than said": (
        _welcome(1, 0, 9, 3, 4, 0),
        DIFFERENT,
    ),
    "welcome that wants the unknown": (
        _welcome(7, 0, 1, 12, 6, 0),
        "WELCOME asks for the unknown number 7 beside the velocity",
    ),
    "welcome with 179 million beads": (
        _welcome(1, 0, 1, 178_956_970, 1, 0),
        f"{DIFFERENT}: 1 178956970 1 0, and 1 12 6 0",
    ),
    "welcome with feedback that nobody asked for": (
        _welcome(1, 1, 1, 12, 6, 0),
        "WELCOME has feedback 1 and constant/fiberProperties 0",
    ),
    "welcome with an odd byte": (
        lambda channel, first, beads: channel.send(replace(welcome(), payload=welcome().payload + b"!")),
        DIFFERENT,
    ),
}


def _talkative(channel, first, beads):
    """A whole run, and then a word too many: in the same packet, or in a further file."""
    greet(channel, first, beads)
    step = 1
    while True:
        channel.send(positions(step, beads))
        while (message := channel.receive(1 << 20)).kind is Kind.SAVE:
            pass
        if message.kind is Kind.END:
            break
        if channel.feedback:
            channel.send(forces(step, beads))
        step += 1
    goodbye = Message(Kind.GOODBYE, message.step, message.time)
    if hasattr(channel, "_socket"):
        channel._write(goodbye.encode() + b"!")
    else:
        (channel._folder / f"{channel._session}.fibers.{channel._sent + 1}").write_bytes(b"!")
        channel.send(goodbye)


DAEMON_FAULTS["bytes after GOODBYE"] = (_talkative, "GOODBYE is followed by")

DAEMON_FAULTS_ELSEWHERE = (
    "truncated",
    "short",
    "duplicated",
    "out of order",
    "version",
    "NaN",
    "bytes after GOODBYE",
)


@pytest.mark.parametrize(
    "transport, fault",
    [("socket", fault) for fault in DAEMON_FAULTS]
    + [(transport, fault) for transport in ("tcp", "file") for fault in DAEMON_FAULTS_ELSEWHERE],
)
def test_solver_with_a_daemon_that_is(transport, fault, copy):
    prepared = copy(transport, IMPATIENT if "silence" in fault else PATIENT, feedback=transport != "socket")
    misbehave, expected = DAEMON_FAULTS[fault]
    if transport == "file" and fault == "truncated":
        expected = "message of the wrong length in"
    line = fake_daemon(prepared, misbehave)
    assert expected in line
    assert "daemon on" in line and f"its log: {prepared}/log.gbmDaemon" in line


def test_solver_without_a_daemon(copy):
    """It waits for one as long as it is told."""
    prepared = copy(timeout=IMPATIENT)
    began = time.monotonic()
    solver = start_solver(prepared)
    assert solver.wait() == 1
    assert time.monotonic() - began > IMPATIENT
    line = fatal_message(solver_log(prepared))
    assert "no daemon answers: No such file or directory; start it with 'gbm daemon" in line
    assert "log.gbmDaemon" in line


def test_daemon_without_a_solver_waits_until_it_is_stopped(copy):
    """No timeout: a solver that is started by hand may come late."""
    prepared = copy(timeout=0.1)
    daemon = start_gbm("daemon", prepared)
    until((prepared / "gbm.sock").exists, "the socket")
    assert stat.S_IMODE((prepared / "gbm.sock").stat().st_mode) == 0o600
    before = _wakes(daemon.pid)  # each to look whether it is to give up, after more than the timeout
    until(lambda: daemon.poll() is not None or _wakes(daemon.pid) > before + 8, "its waking up")
    assert daemon.poll() is None
    daemon.terminate()
    assert "stopped before OpenFOAM came" in one_line(daemon, "daemon", code=3)
    assert not (prepared / "gbm.sock").exists()


def _wakes(pid: int) -> int:
    """How often a process has gone to sleep and was woken."""
    status = Path(f"/proc/{pid}/status").read_text()
    return int(re.search(r"^voluntary_ctxt_switches:\s+(\d+)", status, re.M)[1])


# --- addresses ----------------------------------------------------------------------------------------------


def test_stale_socket_is_replaced_and_one_in_use_is_not(prepared):
    with socket.socket(socket.AF_UNIX) as left_by_a_killed_daemon:
        left_by_a_killed_daemon.bind(str(prepared / "gbm.sock"))
    with FakeSolver(prepared) as solver:
        solver.connect()
        solver.serve_until(1)
        second = start_gbm("daemon", prepared)
        line = one_line(second, "daemon")
        assert f"another daemon is under way in {prepared} (process {solver.daemon.pid}" in line
        line = one_line(start_gbm("run", prepared), "run")  # which moves nothing away under a living daemon
        assert "another daemon is under way" in line and (prepared / "postProcessing/fibers/0").is_dir()
        solver.raw(solver.sample(1).encode())
        solver.serve_until(3)  # unharmed


def test_address_that_is_a_folder(prepared):
    (prepared / "gbm.sock").mkdir()
    try:
        line = one_line(start_gbm("daemon", prepared), "daemon")
    finally:
        (prepared / "gbm.sock").rmdir()
    assert f"cannot make the socket {prepared}/gbm.sock: " in line


def test_case_that_cannot_be_written(prepared, tmp_path):
    case = tmp_path / "read-only"
    case.mkdir()
    if os.geteuid() == 0:
        mount = ["mount", "--bind", "-o", "ro", prepared, case]
        if subprocess.run(mount, capture_output=True).returncode:
            pytest.skip("root may write everywhere and cannot mount a read-only folder here")
    else:
        shutil.copytree(prepared, case, dirs_exist_ok=True)
        case.chmod(0o500)
    try:
        for command in ("daemon", "run"):
            line = one_line(start_gbm(command, case), command)
            assert f"cannot write {case}/.gbm." in line
    finally:
        if os.geteuid() == 0:
            subprocess.run(["umount", case], check=True)
        else:
            case.chmod(0o700)


def test_second_solver_is_told_so(prepared):
    with FakeSolver(prepared) as solver:
        solver.connect()
        solver.serve_until(4)
        second = start_solver(prepared)
        assert second.wait() == 1
        text = fatal_message(solver_log(prepared))
        assert "another solver is connected to this daemon: two runs in one case?" in text
        solver.raw(solver.sample(4).encode())
        solver.serve_until(6)  # unharmed


def test_strangers_on_tcp_are_refused_and_the_run_goes_on(tmp_path):
    case = make_case(tmp_path / "case", transport="tcp", application="boxFoam")
    with FakeSolver(case) as solver:
        for token in ("", "0" * 32):
            solver.connect(token=token)
            assert "does not know the token of this daemon" in solver.last_word()
            solver.close()
        until((case / "gbm.tcp").exists, "the address")
        assert stat.S_IMODE((case / "gbm.tcp").stat().st_mode) == 0o600
        host, port, _ = (case / "gbm.tcp").read_text().split()
        assert host == "127.0.0.1"
        with socket.create_connection((host, int(port))) as stranger:
            stranger.sendall(b"GET / HTTP/1.1\r\nHost: localhost\r\n\r\n" + b"." * 40)
            assert b"not a message of a gbm plugin" in stranger.recv(4096)
        assert start_solver(case).wait() == 0
        output, _ = solver.daemon.communicate()
        assert solver.daemon.returncode == 0
        assert output.count("refused 3 connections that were not the solver's") == 1
        assert "HTTP" not in output  # what strangers say is not the log's


def test_stale_files_and_the_session_of_a_killed_daemon(tmp_path):
    """A solver that finds the session of a killed daemon is served by the next one, which clears the rest."""
    case = make_case(tmp_path / "case", transport="file", application="boxFoam")
    killed = start_gbm("daemon", case)
    session = until(
        lambda: (case / "exchange/session").exists() and (case / "exchange/session").read_text(), "it"
    )
    killed.kill()
    killed.communicate()
    for name in ("flow.0", "fibers.3", "fibers.4.part"):
        (case / f"exchange/{session.strip()}.{name}").write_bytes(b"stale")
        (case / f"exchange/0123456789abcdef.{name}").write_bytes(b"stale")
    solver = start_solver(case)
    hello = case / f"exchange/{session.strip()}.flow.0"
    until(lambda: hello.read_bytes() != b"stale", "a HELLO to nobody")
    daemon = start_gbm("daemon", case)
    assert solver.wait() == 0, solver_log(case).read_text()[-2000:]
    output, _ = daemon.communicate()
    assert daemon.returncode == 0, output
    assert records(case) == 21
    assert not list((case / "exchange").iterdir())


def test_case_path_longer_than_a_socket_address(tmp_path):
    case = make_case(
        tmp_path / ("long" * 20) / ("path" * 20) / "case", steps=3, write_every=3, application="boxFoam"
    )
    assert len(str(case / "gbm.sock")) > 200
    done = gbm("run", case)
    assert done.returncode == 0, done.stderr
    assert records(case) == 4


# --- processes that die or hang -----------------------------------------------------------------------------


def _continues(case, from_at_least: int) -> None:
    """A rerun ends at endTime and its recording has no gap."""
    shortened(case)
    done = gbm("run", case)
    assert done.returncode == 0, done.stderr
    assert "continuing from time" in done.stdout or "falling back" in done.stdout
    with open_recording(case / "postProcessing/fibers") as recording:
        steps = recording.steps
    assert list(steps) == list(range(len(steps))) and len(steps) > from_at_least


@pytest.mark.parametrize("victim", ["daemon", "solver"])
@pytest.mark.parametrize("harm", [signal.SIGKILL, signal.SIGSTOP], ids=["killed", "stopped"])
def test_of_a_run(victim, harm, long_case, silence):
    """Two of four with forces between sample and positions."""
    feedback = (victim == "daemon") == (harm is signal.SIGKILL)
    set_coupling(long_case, "socket", silence if harm is signal.SIGSTOP else PATIENT, feedback)
    run = Run(long_case)
    both = run.at_step(12)
    os.kill(both[victim], harm)
    line = run.line()
    other = {"daemon": "boxFoam", "solver": "gbmDaemon"}[victim]
    if harm is signal.SIGKILL:
        assert {"daemon": "the daemon", "solver": "boxFoam"}[victim] + " was ended by SIGKILL" in line
    else:
        assert {"daemon": "the daemon", "solver": "OpenFOAM"}[
            victim
        ] + f" was silent for {silence:g} s" in line
        assert f"log.{other}" in line
    assert {"daemon": "log.gbmDaemon", "solver": "log.boxFoam"}[victim] in line
    assert not any(os.path.exists(f"/proc/{pid}") for pid in both.values())
    assert records(long_case) >= 12
    _continues(long_case, 12)


def test_run_that_hangs_before_its_first_step(long_case, silence):
    """Nobody waits for anybody with a timeout yet: `gbm run` itself ends it and says where it stood."""
    set_coupling(long_case, "socket", silence)
    divide(long_case, 3, (1, 1, 3))
    run = Run(long_case, "--parallel")
    until(lambda: "solver" in children(run.process.pid), "the solver's start")
    solver = children(run.process.pid)["solver"]
    victim = until(lambda: [pid for pid, _ in members(solver) if is_solver(pid)], "a rank")[-1]
    os.kill(victim, signal.SIGSTOP)
    line = run.line()
    assert f"no step for {silence + 5:g} s" in line
    assert f"boxFoam was stopped by a signal (process {victim}; {long_case}/log.boxFoam)" in line
    assert "the daemon said last 'waiting for OpenFOAM (socket)'" in line
    assert not list(members(solver))


@pytest.mark.parametrize(
    "number",
    [pytest.param(signal.SIGINT, marks=pytest.mark.exhaustive), signal.SIGTERM],
    ids=["Ctrl-C", "SIGTERM"],
)
def test_run_stopped_on_request(number, long_case):
    """Flow and fibers are written at the step under way, though no write was due."""
    set_coupling(long_case, "socket", PATIENT, feedback=number == signal.SIGTERM)
    set_entry(long_case / "system/controlDict", "writeInterval", "100000")
    run = Run(long_case)
    run.at_step(7)
    run.process.send_signal(number)
    line = run.line(code=3)
    assert "stopped on request; everything is written" in line
    last = records(long_case) - 1
    folder = long_case / f"{0.02 * last:g}"
    assert (folder / "U").is_file() and (folder / "uniform/fibers.npz").is_file()
    _continues(long_case, last)


def test_stopped_before_the_first_step(long_case):
    run = Run(long_case)
    until(lambda: "daemon" in children(run.process.pid), "the daemon's start")
    run.process.terminate()
    assert "stopped" in run.line(code=3)


def test_two_runs_in_one_case(long_case):
    run = Run(long_case)
    both = run.at_step(3)
    line = one_line(start_gbm("run", long_case), "run")
    assert f"another run is under way in {long_case} (process {run.process.pid}" in line
    os.kill(run.process.pid, signal.SIGKILL)  # leaves solver and daemon at work
    run.process.communicate()
    line = one_line(start_gbm("run", long_case), "run")
    assert "another run is under way" in line
    os.kill(both["daemon"], signal.SIGTERM)
    until(lambda: not any(os.path.exists(f"/proc/{pid}") for pid in both.values()), "their end")
    _continues(long_case, 3)


# --- full disk ----------------------------------------------------------------------------------------------


@pytest.fixture
def small_disk(tmp_path):
    """mount(folder, size): a file system of that size there."""
    mounted = []

    def mount(folder, size: str) -> None:
        folder.mkdir(parents=True, exist_ok=True)
        done = subprocess.run(
            ["mount", "-t", "tmpfs", "-o", f"size={size}", "tmpfs", folder], capture_output=True
        )
        if done.returncode:
            pytest.skip("a small file system can only be mounted by root")
        mounted.append(folder)

    yield mount
    for folder in mounted:
        subprocess.run(["umount", folder], check=True)


def test_disk_full_while_recording(long_case, small_disk):
    small_disk(long_case / "postProcessing/fibers", "200k")
    line = Run(long_case).line()
    assert "fibers.h5: step" in line and "no room for" in line and "all records up to step" in line
    assert "log.gbmDaemon" in line
    kept = int(line.split("all records up to step ")[1].split()[0])
    assert records(long_case) == kept + 1
    assert kept > 10


def test_disk_full_while_the_state_of_the_fibers_is_written(long_case, small_disk):
    set_coupling(long_case, "socket", PATIENT, feedback=True)
    small_disk(long_case / "0.08/uniform", "8k")
    with FakeSolver(long_case) as solver:
        solver.connect()
        solver.serve_until(4)
        solver.raw(solver.sample(4, keep=True).encode() + Message(Kind.SAVE, 4, 0.08, b"0.08").encode())
        assert "No space left" in solver.last_word()
        solver.close()
        line = one_line(solver.daemon, "daemon")
    assert f"No space left on device: '{long_case}/0.08/uniform/fibers.npz'" in line
    assert not list((long_case / "0.08/uniform").iterdir())
    assert records(long_case) == 5  # a step is recorded before it is saved


def test_disk_full_while_openfoam_writes(prepared, small_disk, tmp_path):
    """The truncated time folder is set aside and the run falls back to the one before."""
    disk = tmp_path / "disk"
    small_disk(disk, "3m")
    case = disk / "case"
    shutil.copytree(prepared, case, ignore=shutil.ignore_patterns("log.*", "postProcessing", "gbm.*"))
    set_coupling(case, "socket", PATIENT, feedback=True)
    set_entry(case / "system/controlDict", "endTime", "1000")
    set_entry(case / "system/controlDict", "writeInterval", "5")
    line = Run(case).line()
    assert "the disk of" in line and "is full" in line
    subprocess.run(["mount", "-o", "remount,size=20m", disk], check=True)
    _continues(case, 4)
    set_aside = [p for p in (case / "previous/1").iterdir() if p.name[0].isdigit()]
    assert len(set_aside) == 1
