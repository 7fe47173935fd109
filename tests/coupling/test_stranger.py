"""Strangers on a port that others can reach: they neither stop a run, nor slow it, nor take anybody's place in it."""

from __future__ import annotations

import contextlib
import hmac
import os
import secrets
import select
import shutil
import socket
import threading
from pathlib import Path

import pytest

from gbm_plugin.case.openfoam import fatal_message
from gbm_plugin.coupling.message import HEADER_SIZE, NONCE_SIZE, Kind, Message

from conftest import make_case, solver_log, start_solver
from fakes import PATIENCE, FakeSolver, start_gbm, until, welcome

pytestmark = pytest.mark.openfoam

LONG = 300.0  # s: a timeout that nothing here needs


@pytest.fixture(scope="module")
def prepared(tmp_path_factory):
    return make_case(
        tmp_path_factory.mktemp("tcp") / "case", steps=3, transport="tcp", timeout=LONG, application="boxFoam"
    )


@pytest.fixture
def tcp_case(prepared, tmp_path):
    return Path(shutil.copytree(prepared, tmp_path / "case"))


def set_timeout(case: Path, seconds: float) -> None:
    path = case / "constant/fiberProperties"
    text = path.read_text()
    assert f"timeout {LONG:g};" in text
    path.write_text(text.replace(f"timeout {LONG:g};", f"timeout {seconds:g};"))


def address(case: Path) -> tuple[tuple[str, int], str]:
    """Host and port, and the token, when the daemon has written them."""
    until((case / "gbm.tcp").is_file, "the daemon's address")
    host, port, token = (case / "gbm.tcp").read_text().split()
    return (host, int(port)), token


def ends_well(case: Path, solver, daemon) -> str:
    assert solver.wait() == 0, solver_log(case).read_text()[-2000:]
    output, _ = daemon.communicate()
    assert daemon.returncode == 0, output
    return output


@pytest.mark.parametrize("count", [5, 100, 300])
def test_silent_strangers_before_the_solver(count, tcp_case):
    """All are greeted at the same time. Their deadline of 5 s each would be 500 s for a hundred, one by one; and the
    kernel's queue of those who are not let in would be full."""
    daemon = start_gbm("daemon", tcp_case)
    place, _ = address(tcp_case)
    with contextlib.ExitStack() as strangers:
        for _ in range(count):
            strangers.enter_context(socket.create_connection(place))
        output = ends_well(tcp_case, start_solver(tcp_case), daemon)
    assert output.count("refused") <= 1  # those who were shown out before the solver came, in one line


def test_after_the_greeting_nobody_is_heard(tcp_case):
    """The port is closed: a stranger costs the daemon nothing, and there is nobody left to be attacked."""
    with FakeSolver(tcp_case) as solver:
        place, _ = address(tcp_case)
        solver.connect()
        solver.serve_until(1)
        assert not (tcp_case / "gbm.tcp").exists()
        for _ in range(20):
            with pytest.raises(ConnectionRefusedError):
                socket.create_connection(place)
        solver.raw(solver.sample(1).encode())
        solver.serve_until(3)


@pytest.fixture
def rogue(tcp_case):
    """Somebody who listens where a daemon's address says, and may know anything but the token. Yields the case, what
    to do with the solver's connection, and what the solver ended with."""
    server = socket.create_server(("127.0.0.1", 0))
    token = secrets.token_hex(16)

    def answer(behave, mode: int = 0o600) -> str:
        file = tcp_case / "gbm.tcp"
        file.write_text(f"127.0.0.1 {server.getsockname()[1]} {token}\n")
        file.chmod(mode)
        solver = start_solver(tcp_case)
        try:
            if mode == 0o600:
                server.settimeout(PATIENCE)
                connection, _ = server.accept()
                with connection:
                    connection.settimeout(PATIENCE)
                    said = connection.recv(1 << 16)
                    behave(connection, said)
                    assert solver.wait() == 1
            assert solver.wait() == 1
        finally:
            solver.kill()
            solver.wait()
        assert token.encode() not in said if mode == 0o600 else True
        return fatal_message(solver_log(tcp_case))

    with server:
        yield answer


def test_a_daemon_that_does_not_ask(rogue):
    line = rogue(lambda connection, _: connection.sendall(welcome().encode()))
    assert "expected CHALLENGE, received WELCOME" in line


@pytest.mark.parametrize("key", [b"", b"guess"])
def test_a_daemon_without_the_token(key, rogue):
    def behave(connection, hello: bytes) -> None:
        nonce = secrets.token_bytes(NONCE_SIZE)
        code = hmac.digest(key, b"fibers" + hello + nonce, "sha256")
        connection.sendall(Message(Kind.CHALLENGE, 0, 0.0, nonce + code).encode())

    line = rogue(behave)
    assert (
        "what answers there does not know the token in" in line and "is not the daemon of this case" in line
    )


def test_what_was_heard_in_another_run_opens_nothing(tcp_case, rogue):
    """A challenge of the real daemon's, for another HELLO."""
    with FakeSolver(tcp_case) as solver:
        solver.connect()
        heard = solver.challenge
    line = rogue(lambda connection, _: connection.sendall(heard.encode()))
    assert "does not know the token" in line


def test_a_solver_that_sends_the_challenge_back(tcp_case):
    """The daemon's own code is not the solver's."""
    with FakeSolver(tcp_case) as solver:
        solver.connect(proof=lambda challenge: challenge[NONCE_SIZE:])
        assert "does not know the token of this daemon" in solver.last_word()


def test_an_address_that_others_can_read(rogue, tcp_case):
    """Its token is no secret, and its daemon anybody."""
    set_timeout(tcp_case, 1)
    line = rogue(None, mode=0o644)
    assert "no daemon answers:" in line
    assert "gbm.tcp is not of this user, or others may read or write it" in line


def test_the_token_never_travels(tcp_case):
    """A run through somebody who writes down all that passes, and finds neither the token nor what would do for it."""
    daemon = start_gbm("daemon", tcp_case)
    place, token = address(tcp_case)
    heard = {"flow": bytearray(), "fibers": bytearray()}
    with socket.create_server(("127.0.0.1", 0)) as server:
        (tcp_case / "gbm.tcp").write_text(f"127.0.0.1 {server.getsockname()[1]} {token}\n")
        solver = start_solver(tcp_case)

        def relay() -> None:
            with server.accept()[0] as flow, socket.create_connection(place) as fibers:
                sides = {flow.fileno(): (flow, fibers, "flow"), fibers.fileno(): (fibers, flow, "fibers")}
                while sides:
                    for ready in select.select(list(sides), [], [], PATIENCE)[0]:
                        source, target, name = sides[ready]
                        data = source.recv(1 << 16)
                        heard[name] += data
                        if data:
                            target.sendall(data)
                        else:
                            with contextlib.suppress(OSError):
                                target.shutdown(socket.SHUT_WR)
                            del sides[ready]

        thread = threading.Thread(target=relay, daemon=True)
        thread.start()
        ends_well(tcp_case, solver, daemon)
        thread.join(PATIENCE)
    assert heard["flow"][HEADER_SIZE:] and heard["fibers"][HEADER_SIZE:]
    for said in heard.values():
        assert token.encode() not in said and bytes.fromhex(token) not in said


def test_a_queue_that_is_full_does_not_hold_the_solver(tcp_case):
    """The kernel would try for two minutes to connect to somebody who lets nobody in."""
    set_timeout(tcp_case, 3)
    with contextlib.ExitStack() as stack:
        server = stack.enter_context(socket.socket())
        server.bind(("127.0.0.1", 0))
        server.listen(0)
        for _ in range(8):  # fill the queue
            stranger = stack.enter_context(socket.socket())
            stranger.setblocking(False)
            stranger.connect_ex(server.getsockname())
        file = tcp_case / "gbm.tcp"
        file.write_text(f"127.0.0.1 {server.getsockname()[1]} {'0' * 32}\n")
        file.chmod(0o600)
        solver = start_solver(tcp_case)
        stack.callback(solver.kill)
        assert solver.wait() == 1
    line = fatal_message(solver_log(tcp_case))
    assert "no daemon answers: 127.0.0.1 port" in line and "Connection timed out" in line


def test_a_greeting_of_any_pieces_and_one_that_goes_on(tcp_case):
    with FakeSolver(tcp_case) as solver:
        solver.connect(pieces=7)
        solver.serve_until(1)
    with FakeSolver(tcp_case) as solver:
        solver.connect(more=b"!")
        assert "PROOF is followed by further bytes" in solver.last_word()


# --- the folder exchange ------------------------------------------------------------------------------------


@pytest.fixture
def file_case(prepared, tmp_path):
    case = Path(shutil.copytree(prepared, tmp_path / "case"))
    path = case / "constant/fiberProperties"
    path.write_text(path.read_text().replace("transport tcp", "transport file"))
    set_timeout(case, 1)
    return case


def refused(case: Path) -> str:
    assert start_solver(case).wait() == 1
    return fatal_message(solver_log(case))


def test_exchange_that_is_not_ones_own(file_case):
    exchange = file_case / "exchange"
    elsewhere = file_case / "elsewhere"
    elsewhere.mkdir(mode=0o700)
    (elsewhere / "session").write_text("0123456789abcdef\n")
    exchange.symlink_to("elsewhere")
    assert "exchange: Not a directory" in refused(file_case) or "Too many levels" in refused(file_case)
    assert [p.name for p in elsewhere.iterdir()] == ["session"]
    exchange.unlink()
    elsewhere.rename(exchange)
    exchange.chmod(0o770)
    assert "exchange is not of this user, or others may enter it" in refused(file_case)
    if os.geteuid() == 0:
        exchange.chmod(0o700)
        os.chown(exchange, 1234, 1234)
        assert "exchange is not of this user, or others may enter it" in refused(file_case)


@pytest.mark.parametrize("suffix", ["", ".part"])
def test_links_in_a_given_exchange_are_not_written_through(suffix, file_case):
    """With a session word of its own making, a stranger's case knows the names of the messages."""
    exchange = file_case / "exchange"
    exchange.mkdir(mode=0o700)
    (exchange / "session").write_text("0123456789abcdef\n")
    precious = file_case.parent / "precious"
    precious.write_text("of the user")
    (exchange / f"0123456789abcdef.flow.0{suffix}").symlink_to(precious)
    line = refused(file_case)
    assert precious.read_text() == "of the user" and not precious.is_symlink()
    assert ("File exists" if suffix else "was silent for 1 s") in line
