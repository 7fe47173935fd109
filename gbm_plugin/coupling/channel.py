"""The daemon's side of a connection, whatever carries it: sockets (sockets.py) or files (files.py)."""

from __future__ import annotations

import contextlib
from abc import ABC, abstractmethod
from collections.abc import Callable
from pathlib import Path

from ..errors import CouplingError
from .message import HEADER_SIZE, MAX_TEXT, Hello, Kind, Message, ProtocolError, decode_header, encode_header


class Channel(ABC):
    """Whole messages to and from one solver."""

    def __init__(self, timeout: float, log: Path):
        self.timeout = timeout
        self._log = log

    @abstractmethod
    def _write(self, *parts: bytes | memoryview) -> None: ...

    @abstractmethod
    def _read(self, size: int) -> bytes | bytearray:
        """Exactly this many bytes; CouplingError at the end of the connection or the timeout."""

    @abstractmethod
    def close(self) -> int:
        """How many bytes had come that nobody asked for."""

    def send(self, message: Message) -> None:
        self._write(encode_header(message), message.payload)

    def receive(self, most: int = MAX_TEXT) -> Message:
        """The next message, of at most so many bytes. CouplingError where the solver is gone, silent, or
        reports an error."""
        try:
            head, size = decode_header(self._read(HEADER_SIZE), most)
        except ProtocolError as error:
            raise self.error(str(error)) from None
        message = Message(head.kind, head.step, head.time, self._read(size), head.flags)
        if message.kind is Kind.ERROR:
            raise self.error(f"OpenFOAM stopped: {message.text()}")
        return message

    def say_why(self, text: str) -> None:
        """A last word to the solver, which may be gone: then nobody is left to tell."""
        with contextlib.suppress(CouplingError):
            self.send(Message(Kind.ERROR, 0, 0.0, text.encode()[:MAX_TEXT]))

    def error(self, what: str) -> CouplingError:
        return CouplingError(f"{what} (OpenFOAM's log: {self._log})")

    def silent(self) -> CouplingError:
        return self.error(
            f"OpenFOAM was silent for {self.timeout:g} s (entry timeout of constant/fiberProperties)"
        )


class Listener(ABC):
    """Where one solver can find the daemon. A context manager that leaves nothing behind."""

    @abstractmethod
    def greet(self, give_up: Callable[[], bool]) -> tuple[Channel, Message, Hello] | None:
        """Wait for the solver, as long as it takes: its channel, and the HELLO that it said; None when `give_up`
        says so. CouplingError where something else has come that nobody but the user can have sent."""

    @abstractmethod
    def close(self) -> None: ...

    def __enter__(self) -> Listener:
        return self

    def __exit__(self, *_) -> None:
        self.close()
