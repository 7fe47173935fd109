"""Stream sockets: a Unix socket in the case, or TCP with a token in a file that only the owner reads."""

from __future__ import annotations

import contextlib
import os
import secrets
import select
import socket
import time
from collections.abc import Callable
from pathlib import Path

from ..case.scene import Coupling
from ..case.share import Share
from ..errors import CouplingError
from ..files import write_text
from .channel import Channel, Listener
from .message import MAX_TEXT, Kind, Message

PARTING = 1.0  # how long the other side may take to end a connection [s]
POLL = 0.2  # how often a wait for the first connection looks whether to give up [s]


class SocketChannel(Channel):
    def __init__(self, connection: socket.socket, server: socket.socket, timeout: float, log: Path):
        super().__init__(timeout, log)
        self._socket = connection
        self._server = server
        self._socket.setblocking(False)

    def _wait(self, event: int, deadline: float) -> None:
        """Until the socket is ready; a second solver that knocks meanwhile is told so. While this one has not
        said HELLO it may be a stranger, and the next one, who waits, the solver."""
        poll = select.poll()
        poll.register(self._socket, event)
        if self.greeted:
            poll.register(self._server, select.POLLIN)
        while True:
            left = deadline - time.monotonic()
            if left <= 0:
                raise self.silent()
            ready = [fd for fd, _ in poll.poll(1000 * left)]
            if self._server.fileno() in ready:
                self._refuse_second()
            if self._socket.fileno() in ready:
                return

    def _refuse_second(self) -> None:
        second, _ = self._server.accept()
        text = b"another solver is connected to this daemon: two runs in one case?"
        with second, contextlib.suppress(OSError):
            second.settimeout(1.0)
            second.sendall(Message(Kind.ERROR, 0, 0.0, text).encode())
            _part(second)

    def _write(self, *parts: bytes | memoryview) -> None:
        deadline = time.monotonic() + self.timeout
        if sum(map(len, parts)) <= MAX_TEXT:  # a small message in one packet
            parts = (b"".join(parts),)
        for view in map(memoryview, parts):
            while view:
                self._wait(select.POLLOUT, deadline)
                try:
                    view = view[self._socket.send(view) :]
                except BlockingIOError:
                    continue
                except OSError as error:
                    raise self.error(f"OpenFOAM is gone: {error.strerror}") from None

    def _read(self, size: int) -> bytearray:
        deadline = time.monotonic() + self.timeout
        data = bytearray(size)
        view = memoryview(data)
        while view:
            self._wait(select.POLLIN, deadline)
            try:
                got = self._socket.recv_into(view)
            except BlockingIOError:
                continue
            except OSError as error:
                raise self.error(f"OpenFOAM is gone: {error.strerror}") from None
            if not got:
                raise self.error("OpenFOAM closed the connection before its end")
            view = view[got:]
        return data

    def close(self) -> None:
        with contextlib.suppress(OSError):
            _part(self._socket)
        self._socket.close()


def _part(connection: socket.socket) -> None:
    """Take what is on its way: bytes that nobody reads would reset the connection before the other side has
    read our last word. For a moment only, however much it sends."""
    connection.shutdown(socket.SHUT_WR)
    end = time.monotonic() + PARTING
    while (left := end - time.monotonic()) > 0:
        connection.settimeout(left)
        if not connection.recv(1 << 16):
            return


class SocketListener(Listener):
    """What Unix sockets and TCP have in common."""

    server: socket.socket

    def __init__(self, case: Path, coupling: Coupling, log: Path):
        self.log = log
        self.timeout = coupling.timeout

    def accept(self, give_up: Callable[[], bool]) -> Channel | None:
        self.server.settimeout(POLL)
        while not give_up():
            with contextlib.suppress(TimeoutError):
                connection, _ = self.server.accept()
                return SocketChannel(connection, self.server, self.timeout, self.log)
        return None


class UnixListener(SocketListener):
    """`gbm.sock` in the case, mode 0600."""

    def __init__(self, case: Path, coupling: Coupling, log: Path, share: Share):
        super().__init__(case, coupling, log)
        # through the folder's descriptor: a socket's path holds 107 characters, and a case may lie deeper
        self._folder = os.open(case, os.O_PATH | os.O_DIRECTORY)
        self.path = case / share.name("gbm", ".sock")
        address = f"/proc/self/fd/{self._folder}/{self.path.name}"
        self.server = socket.socket(socket.AF_UNIX, socket.SOCK_STREAM)
        try:
            self._remove_stale(address)
            old = os.umask(0o177)
            try:
                self.server.bind(address)
            finally:
                os.umask(old)
        except OSError as error:
            raise CouplingError(f"cannot make the socket {self.path}: {error.strerror}") from None
        self.server.listen(4)

    def _remove_stale(self, address: str) -> None:
        with socket.socket(socket.AF_UNIX, socket.SOCK_STREAM) as probe:
            try:
                probe.connect(address)
            except FileNotFoundError:
                return
            except ConnectionRefusedError:  # left by a daemon that was killed
                os.unlink(address)
                return
        raise CouplingError(f"another daemon serves this case on {self.path}")

    def close(self) -> None:
        self.server.close()
        with contextlib.suppress(OSError):
            self.path.unlink()
        os.close(self._folder)


class TcpListener(SocketListener):
    """A port, by default on the loopback address, named with a secret in `gbm.tcp`, mode 0600."""

    def __init__(self, case: Path, coupling: Coupling, log: Path, share: Share):
        super().__init__(case, coupling, log)
        self.token = secrets.token_hex(16)
        self.path = case / share.name("gbm", ".tcp")
        try:
            family = socket.getaddrinfo(coupling.host, coupling.port, type=socket.SOCK_STREAM)[0][0]
            self.server = socket.create_server((coupling.host, coupling.port), family=family, backlog=4)
        except OSError as error:
            raise CouplingError(
                f"cannot listen on {coupling.host} port {coupling.port}: {error.strerror}"
            ) from None
        port = self.server.getsockname()[1]
        write_secret(self.path, f"{coupling.host} {port} {self.token}\n")

    def accept(self, give_up: Callable[[], bool]) -> Channel | None:
        channel = super().accept(give_up)
        if channel is not None:
            channel._socket.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        return channel

    def close(self) -> None:
        self.server.close()
        with contextlib.suppress(OSError):
            self.path.unlink()


def write_secret(path: Path, text: str) -> None:
    """A whole file that only the owner reads, in one step."""
    try:
        write_text(path, text, private=True)
    except OSError as error:
        raise CouplingError(f"cannot write {path}: {error.strerror}") from None
