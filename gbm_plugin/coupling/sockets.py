"""Stream sockets: a Unix socket in the case, or TCP with a token in a file that only the owner reads."""

from __future__ import annotations

import contextlib
import logging
import os
import secrets
import select
import socket
import time
from abc import abstractmethod
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

from ..case.scene import Coupling
from ..case.share import Share
from ..errors import CouplingError
from ..files import write_text
from .channel import Channel, Listener
from .greeting import greeting
from .message import HEADER_SIZE, MAX_TEXT, Hello, Kind, Message, ProtocolError, decode_header

PARTING = 1.0  # how long the other side may take to end a connection [s]
POLL = 0.2  # how often a wait for the first connection looks whether to give up [s]
PATIENCE = 5.0  # for a greeting: a solver says HELLO at once [s]
GUESTS = 200  # who may be waiting to be greeted
BACKLOG = 128  # and to be let in

logger = logging.getLogger(__name__)


class SocketChannel(Channel):
    """The connection to the solver. server: where a second one may knock; it is told that it is the second."""

    def __init__(
        self, connection: socket.socket, timeout: float, log: Path, server: socket.socket | None = None
    ):
        super().__init__(timeout, log)
        self._socket = connection
        self._server = server
        self._socket.setblocking(False)

    def _wait(self, event: int, deadline: float) -> None:
        """Until the socket is ready."""
        poll = select.poll()
        poll.register(self._socket, event)
        if self._server is not None:
            poll.register(self._server, select.POLLIN)
        while True:
            left = deadline - time.monotonic()
            if left <= 0:
                raise self.silent()
            ready = [fd for fd, _ in poll.poll(1000 * left)]
            if self._server is not None and self._server.fileno() in ready:
                self._refuse_second(self._server)
            if self._socket.fileno() in ready:
                return

    def _refuse_second(self, server: socket.socket) -> None:
        with contextlib.suppress(OSError):
            second, _ = server.accept()
            with second:
                dismiss(second, "another solver is connected to this daemon: two runs in one case?")

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

    def close(self) -> int:
        """Take what is on its way: bytes that nobody reads would reset the connection before the other side has
        read our last word. For a moment only, however much it sends."""
        late = 0
        with contextlib.suppress(OSError), self._socket:
            self._socket.shutdown(socket.SHUT_WR)
            end = time.monotonic() + PARTING
            while (left := end - time.monotonic()) > 0:
                self._socket.settimeout(left)
                if not (got := len(self._socket.recv(1 << 16))):
                    break
                late += got
        return late


def dismiss(connection: socket.socket, text: str) -> None:
    """A last word to somebody for whom nobody waits."""
    connection.setblocking(False)
    with contextlib.suppress(OSError):
        connection.send(Message(Kind.ERROR, 0, 0.0, text.encode()[:MAX_TEXT]).encode())


class Guest:
    """A connection that has not shown yet that it is the solver's."""

    def __init__(self, connection: socket.socket, token: str):
        self.socket = connection
        self.socket.setblocking(False)
        self.deadline = time.monotonic() + PATIENCE
        self.heard = bytearray()
        self._dialogue = greeting(token)
        next(self._dialogue)

    def hear(self) -> tuple[Message, Hello] | None:
        """Take what has come; the greeting when it is whole. ProtocolError or OSError where it is not the
        solver's."""
        data = self.socket.recv(MAX_TEXT)
        if not data:
            raise ProtocolError("the connection was closed before HELLO")
        self.heard += data
        while (message := self._next()) is not None:
            try:
                answer = self._dialogue.send(message)
            except StopIteration as end:
                if self.heard:
                    raise ProtocolError(f"{message.kind.name} is followed by further bytes") from None
                return end.value
            self.socket.send(answer.encode())
        return None

    def _next(self) -> Message | None:
        if len(self.heard) < HEADER_SIZE:
            return None
        head, size = decode_header(self.heard[:HEADER_SIZE])
        if len(self.heard) < HEADER_SIZE + size:
            return None
        payload = bytes(self.heard[HEADER_SIZE : HEADER_SIZE + size])
        del self.heard[: HEADER_SIZE + size]
        return replace(head, payload=payload)


class SocketListener(Listener):
    """What Unix sockets and TCP have in common: all who have come are greeted at the same time, each with a deadline
    of its own, so that nobody keeps another one waiting."""

    server: socket.socket

    def __init__(self, case: Path, coupling: Coupling, log: Path):
        self.log = log
        self.timeout = coupling.timeout
        self._guests: dict[int, Guest] = {}

    @abstractmethod
    def _invite(self, connection: socket.socket) -> Guest: ...

    @abstractmethod
    def _refuse(self, guest: Guest, why: str) -> None:
        """What becomes of somebody who is not the solver."""

    @abstractmethod
    def _channel(self, connection: socket.socket) -> SocketChannel:
        """The solver has come: nobody else is listened to."""

    def greet(self, give_up: Callable[[], bool]) -> tuple[Channel, Message, Hello] | None:
        self.server.setblocking(False)
        self._poll = select.poll()
        self._poll.register(self.server, select.POLLIN)
        try:
            while not give_up():
                for fd, _ in self._poll.poll(1000 * POLL):
                    if fd == self.server.fileno():
                        self._admit()
                    elif (guest := self._guests.get(fd)) and (greeted := self._hear(guest)):
                        del self._guests[fd]
                        return self._channel(guest.socket), *greeted
                for guest in [g for g in self._guests.values() if time.monotonic() > g.deadline]:
                    self._show_out(guest, f"no greeting came within {PATIENCE:g} s")
        finally:
            for guest in self._guests.values():
                guest.socket.close()
            self._guests.clear()
        return None

    def _admit(self) -> None:
        with contextlib.suppress(OSError):  # it may have gone again
            guest = self._invite(self.server.accept()[0])
            if len(self._guests) == GUESTS:  # the solver speaks at once
                silent = [g for g in self._guests.values() if not g.heard]
                self._show_out((silent or list(self._guests.values()))[0], "too many connections")
            self._guests[guest.socket.fileno()] = guest
            self._poll.register(guest.socket, select.POLLIN)

    def _hear(self, guest: Guest) -> tuple[Message, Hello] | None:
        try:
            return guest.hear()
        except (ProtocolError, OSError) as error:
            self._show_out(guest, str(error))
            return None

    def _show_out(self, guest: Guest, why: str) -> None:
        self._poll.unregister(guest.socket)
        del self._guests[guest.socket.fileno()]
        with guest.socket:
            dismiss(guest.socket, why)
        self._refuse(guest, why)


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
        self.server.listen(BACKLOG)

    def _invite(self, connection: socket.socket) -> Guest:
        return Guest(connection, token="")

    def _refuse(self, guest: Guest, why: str) -> None:
        raise CouplingError(
            f"{why} (OpenFOAM's log: {self.log})"
        )  # it is the same user: not to be overlooked

    def _channel(self, connection: socket.socket) -> SocketChannel:
        return SocketChannel(connection, self.timeout, self.log, self.server)

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
    """A port, by default on the loopback address, named with a secret in `gbm.tcp`, mode 0600. Both are gone when the
    solver has come. Whoever else came is counted and not more: not even the log is theirs to fill."""

    def __init__(self, case: Path, coupling: Coupling, log: Path, share: Share):
        super().__init__(case, coupling, log)
        self._token = secrets.token_hex(16)
        self._strangers = 0
        self.path = case / share.name("gbm", ".tcp")
        try:
            family = socket.getaddrinfo(coupling.host, coupling.port, type=socket.SOCK_STREAM)[0][0]
            self.server = socket.create_server((coupling.host, coupling.port), family=family, backlog=BACKLOG)
        except OSError as error:
            raise CouplingError(
                f"cannot listen on {coupling.host} port {coupling.port}: {error.strerror}"
            ) from None
        host, port = self.server.getsockname()[:2]  # numbers, so that the solver need not ask for a name
        write_secret(self.path, f"{host} {port} {self._token}\n")

    def _invite(self, connection: socket.socket) -> Guest:
        connection.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        return Guest(connection, self._token)

    def _refuse(self, guest: Guest, why: str) -> None:
        self._strangers += 1

    def _channel(self, connection: socket.socket) -> SocketChannel:
        self.close()
        return SocketChannel(connection, self.timeout, self.log)

    def close(self) -> None:
        if self._strangers:
            logger.warning("refused %d connections that were not the solver's", self._strangers)
            self._strangers = 0
        self.server.close()
        with contextlib.suppress(OSError):
            self.path.unlink()


def write_secret(path: Path, text: str) -> None:
    """A whole file that only the owner reads, in one step."""
    try:
        write_text(path, text, private=True)
    except OSError as error:
        raise CouplingError(f"cannot write {path}: {error.strerror}") from None
