"""Either side of the coupling played by the test, against the real other one; and processes to do harm to."""

from __future__ import annotations

import hmac
import os
import re
import secrets
import signal
import socket
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np

from gbm_plugin.case.openfoam import fatal_message
from gbm_plugin.case.scene import read_scene
from gbm_plugin.case.share import Share
from gbm_plugin.coupling.listen import listen
from gbm_plugin.coupling.message import (
    KEEP,
    NONCE_SIZE,
    Hello,
    Kind,
    Message,
    encode_array,
    encode_header,
    encode_welcome,
)

from conftest import solver_log, start_solver

BOX = 2 * np.pi
FAMILIES = [(12, 6, 0)]  # of conftest.FAMILY
PATIENCE = 300  # s, for what must happen; how long it takes is nobody's fault
ADDRESSES = {"socket": "gbm.sock", "tcp": "gbm.tcp", "file": "exchange/session"}
SOLVERS = ("boxFoam", "pimpleFoam")


def start_gbm(*arguments, **options) -> subprocess.Popen:
    """The command line in the background, what it says in one pipe."""
    return subprocess.Popen(
        [sys.executable, "-m", "gbm_plugin.cli", *map(str, arguments)],
        **{"stdout": subprocess.PIPE, "stderr": subprocess.STDOUT, "text": True, **options},
    )


def until(condition: Callable[[], object], what: str, patience: float = PATIENCE):
    """Wait for a condition, and give its value back."""
    end = time.monotonic() + patience
    while not (value := condition()):
        assert time.monotonic() < end, f"{what} did not happen within {patience} s"
        time.sleep(0.002)
    return value


def one_line(process: subprocess.Popen, command: str, code: int = 1) -> str:
    """What a gbm process that failed, or with code 3 was stopped, said in its one line."""
    output, _ = process.communicate()
    assert process.returncode == code, output
    assert "Traceback" not in output
    errors = [line for line in output.splitlines() if line.startswith(f"gbm {command}: ")]
    assert len(errors) == 1 and output.splitlines()[-1] == errors[0], output
    return errors[0]


class Files:
    """The transport `file` as OpenFOAM uses it, with the methods of a socket: one file for each `sendall`."""

    def __init__(self, folder: Path, session: str):
        self._folder, self._session = folder, session
        self._sent = self._received = 0
        self._data = b""
        self._open = True

    def sendall(self, data: bytes) -> None:
        target = self._folder / f"{self._session}.flow.{self._sent}"
        part = target.with_name(target.name + ".part")
        part.write_bytes(data)
        part.rename(target)
        self._sent += 1

    def recv(self, size: int) -> bytes:
        if not self._data:
            path = self._folder / f"{self._session}.fibers.{self._received}"
            until(path.exists, f"the file {path}")
            self._data = path.read_bytes()
            path.unlink()
            self._received += 1
        data, self._data = self._data[:size], self._data[size:]
        return data

    def settimeout(self, _: float) -> None:
        pass

    def fileno(self) -> int:
        return 0 if self._open else -1

    def close(self) -> None:
        self._open = False


class FakeSolver:
    """OpenFOAM's side against a real `gbm daemon`."""

    def __init__(self, case: Path):
        self.case = case
        self.scene = read_scene(case)
        (case / "exchange/session").unlink(missing_ok=True)  # that of a daemon that was killed
        self.daemon = start_gbm("daemon", case)
        self.socket: socket.socket | Files | None = None

    @property
    def address(self) -> Path:
        """Where the daemon can be found."""
        return self.case / ADDRESSES[self.scene.coupling.transport]

    def connect(
        self,
        *,
        pieces: int = 1 << 20,
        proof: Callable[[bytes], bytes] | None = None,
        more: bytes = b"",
        **changes,
    ) -> None:
        """The connection and HELLO, with other values where the test wants them; in TCP also the proof, another one
        where the test makes it of the challenge, and more bytes behind it. pieces: of how many bytes, in TCP."""
        transport, path = self.scene.coupling.transport, self.address
        until(lambda: path.exists() or self.daemon.poll() is not None, "the daemon's address")
        self.token = ""
        if transport == "file":
            self.socket = Files(path.parent, path.read_text().strip())
        elif transport == "tcp":
            host, port, self.token = path.read_text().split()
            self.socket = socket.create_connection((host, int(port)))
        else:
            self.socket = socket.socket(socket.AF_UNIX)
            until(lambda: self.socket.connect_ex(str(path)) == 0, "a connection to the daemon")
        self.socket.settimeout(PATIENCE)
        values = {
            "viscosity": self.scene.kinematic_viscosity,
            "time_step": self.scene.time_step,
            "box_min": (0.0, 0.0, 0.0),
            "box_max": (BOX, BOX, BOX),
            "cells": 4096,
            "share": Share(),
            "folder": "0",
            "nonce": secrets.token_bytes(NONCE_SIZE),
        }
        self.token = changes.get("token", self.token)
        hello = Message(
            Kind.HELLO, 0, 0.0, Hello(**values | {k: v for k, v in changes.items() if k != "token"}).encode()
        ).encode()
        if transport != "tcp":
            self.raw(hello)
            return
        for i in range(0, len(hello), pieces):
            self.raw(hello[i : i + pieces])
        self.challenge = self.receive()
        nonce, code = self.challenge.payload[:NONCE_SIZE], self.challenge.payload[NONCE_SIZE:]
        assert self.challenge.kind is Kind.CHALLENGE and len(code) == NONCE_SIZE
        if "token" not in changes:
            assert code == self.code(hello + nonce, "fibers")
        answer = proof(self.challenge.payload) if proof else self.code(hello + nonce)
        self.raw(Message(Kind.PROOF, 0, 0.0, answer).encode() + more)

    def code(self, said: bytes, side: str = "flow") -> bytes:
        return hmac.digest(self.token.encode(), side.encode() + said, "sha256")

    def raw(self, data: bytes) -> None:
        self.socket.sendall(data)

    def receive(self) -> Message:
        def exactly(size: int) -> bytes:
            data = b""
            while len(data) < size:
                part = self.socket.recv(size - len(data))
                if not part:
                    raise EOFError
                data += part
            return data

        magic, _version, kind, flags, _, step, moment, size = _header(exactly(40))
        assert magic == b"GBMC"
        return Message(Kind(kind), step, moment, exactly(size), flags)

    def sample(self, step: int, value: float = 0.1, keep: bool = False) -> Message:
        beads = sum(f.count * f.beads for f in self.scene.families)
        values = np.full(6 * beads, value)
        return Message(
            Kind.SAMPLE, step, step * self.scene.time_step, encode_array(values), KEEP if keep else 0
        )

    def serve_until(self, step: int) -> None:
        """A run like any other until the positions of this step are there."""
        while True:
            message = self.receive()
            if message.kind is Kind.POSITIONS:
                if message.step == step:
                    return
                self.raw(self.sample(message.step).encode())

    def last_word(self) -> str:
        """The daemon's ERROR, which ends the connection."""
        while (message := self.receive()).kind is not Kind.ERROR:
            pass
        return message.payload.decode()

    def close(self) -> None:
        if self.socket is not None:
            self.socket.close()

    def __enter__(self):
        return self

    def __exit__(self, *_) -> None:
        self.close()
        if self.daemon.poll() is None:
            self.daemon.kill()
        self.daemon.wait()
        self.daemon.stdout.close()


def _header(data: bytes):
    import struct

    return struct.unpack("<4sHHIIqdQ", data)


def fake_daemon(case: Path, misbehave: Callable) -> str:
    """The case's solver against a daemon that is fine until it calls misbehave(channel, first, beads) in place of
    sending the positions of step 1. Returns the one line that it ends with."""
    scene = read_scene(case)
    beads = sum(f.count * f.beads for f in scene.families)
    with listen(case, scene.coupling, solver_log(case)) as listener:
        solver = start_solver(case)
        try:
            channel, first, _ = listener.greet(lambda: solver.poll() is not None)
            channel.feedback = scene.coupling.feedback
            misbehave(channel, first, beads)
            assert solver.wait() == 1
            channel.close()
        finally:
            solver.kill()
            solver.wait()
    text = fatal_message(solver_log(case))
    assert text is not None
    return text


def welcome(feedback: bool = False) -> Message:
    return Message(Kind.WELCOME, 0, 0.0, encode_welcome("rotation", feedback, FAMILIES))


def greet(channel, first: Message, beads: int) -> None:
    """WELCOME, and step 0 as it should be."""
    channel.send(welcome(channel.feedback))
    channel.send(positions(0, beads))
    channel.receive(1 << 20)
    if channel.feedback:
        channel.send(forces(0, beads))


def positions(step: int, beads: int, value: float = 1.0, **changes) -> Message:
    values = {"step": step, "time": 0.02 * step, "payload": encode_array(np.full((beads, 3), value))}
    return Message(Kind.POSITIONS, **{**values, **changes})


def forces(step: int, beads: int, value: float = 0.0, **changes) -> Message:
    values = {"step": step, "time": 0.02 * step, "payload": encode_array(np.full((2, beads, 3), value))}
    return Message(Kind.FORCES, **{**values, **changes})


def header(message: Message, **fields) -> bytes:
    """The bytes of a message with single fields of its header replaced."""
    import struct

    names = ["magic", "version", "kind", "flags", "reserved", "step", "time", "size"]
    values = dict(zip(names, _header(encode_header(message)), strict=True))
    return struct.pack("<4sHHIIqdQ", *{**values, **fields}.values()) + message.payload


def children(pid: int) -> dict[str, int]:
    """The solver and the daemon that a `gbm run` has started, by what they are."""
    found = {}
    for child in Path(f"/proc/{pid}/task/{pid}/children").read_text().split():
        try:
            words = Path(f"/proc/{child}/cmdline").read_text().split("\0")
        except OSError:
            continue
        if "daemon" in words:
            found["daemon"] = int(child)
        elif words[0] in (*SOLVERS, "mpirun"):
            found["solver"] = int(child)
    return found


def is_solver(pid: int) -> bool:
    try:
        return Path(f"/proc/{pid}/comm").read_text().strip() in SOLVERS
    except OSError:
        return False


class Run:
    """A `gbm run` in the background."""

    def __init__(self, case: Path, *options: str):
        self.case = case
        self.process = start_gbm("run", case, *options)

    def at_step(self, step: int) -> dict[str, int]:
        """Its two processes, once the daemon has seen this step."""
        until(lambda: self.process.poll() is not None or last_step(self.case) >= step, f"step {step}")
        assert self.process.poll() is None, self.process.communicate()[0]
        return children(self.process.pid)

    def killed_at(self, step: int) -> None:
        """All three processes gone at once."""
        both = self.at_step(step)
        for pid in (*both.values(), self.process.pid):
            os.kill(pid, signal.SIGKILL)
        self.process.communicate()
        for pid in both.values():
            until(lambda pid=pid: not alive(pid), f"the end of {pid}")

    def line(self, code: int = 1) -> str:
        return one_line(self.process, "run", code)


def kill_all_of(case: Path) -> None:
    """Whatever a failed test has left at work in its case."""
    for process in Path("/proc").glob("[0-9]*/cmdline"):
        try:
            if str(case) in process.read_text().split("\0"):
                os.kill(int(process.parent.name), signal.SIGKILL)
        except OSError:
            continue


def alive(pid: int) -> bool:
    try:
        return ") Z " not in Path(f"/proc/{pid}/stat").read_text()
    except OSError:
        return False


def last_step(case: Path) -> int:
    """The latest step in the daemon's newest table; -1 without one."""
    tables = sorted(case.glob("postProcessing/fibers/*/daemon*.dat"), key=lambda p: p.stat().st_mtime)
    rows = re.findall(r"^[\d.e+-]+\t(\d+)\t.*\n", tables[-1].read_text(), re.M) if tables else []
    return int(rows[-1]) if rows else -1
