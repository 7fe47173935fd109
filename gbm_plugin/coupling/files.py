"""Messages as files in the folder `exchange` of the case, for sides that share only a file system."""

from __future__ import annotations

import contextlib
import re
import secrets
import time
from collections.abc import Callable
from pathlib import Path

from ..case.scene import Coupling
from ..case.share import Share
from ..errors import CouplingError
from ..files import private_folder, replaced
from .channel import Channel, Listener
from .greeting import greeting
from .message import HEADER_SIZE, MAX_TEXT, Hello, Message, ProtocolError
from .sockets import POLL, write_secret

# messages of an earlier session, whole or not; not `session`, which is replaced: a solver may be waiting with it
OWN = re.compile(r"(\.[0-9a-f]{16}\.)?[0-9a-f]{16}\.(flow|fibers)\.\d+(\.part)?")


class FileChannel(Channel):
    """`<session>.flow.<n>` come in, `<session>.fibers.<n>` go out: written aside, then renamed."""

    def __init__(self, folder: Path, session: str, timeout: float, log: Path):
        super().__init__(timeout, log)
        self._folder = folder
        self._session = session
        self._sent = 0
        self._received = 0
        self._data = memoryview(b"")

    def incoming(self) -> Path:
        return self._folder / f"{self._session}.flow.{self._received}"

    def _write(self, *parts: bytes | memoryview) -> None:
        target = self._folder / f"{self._session}.fibers.{self._sent}"
        try:
            with replaced(target, "wb", private=True) as file:
                file.writelines(parts)
        except OSError as error:
            raise self.error(f"cannot write {target}: {error.strerror}") from None
        self._sent += 1

    def receive(self, most: int = MAX_TEXT) -> Message:
        # of a view of the file parts are no copies
        self._data = memoryview(self._next_file(HEADER_SIZE + max(most, MAX_TEXT)))
        message = super().receive(most)
        if self._data:
            raise self.error(
                f"{message.kind.name} of step {message.step} is followed by {len(self._data)} bytes"
            )
        return message

    def _next_file(self, most: int) -> bytes:
        path = self.incoming()
        deadline = time.monotonic() + self.timeout
        pause = 5e-5
        while not path.exists():
            if time.monotonic() > deadline:
                raise self.silent()
            time.sleep(pause)
            pause = min(1.1 * pause, 0.02)  # a part of what was waited for already: hardly late, never busy
        try:
            with path.open("rb") as file:
                data = file.read(most + 1)
            path.unlink()
        except OSError as error:
            raise self.error(f"cannot read {path}: {error.strerror}") from None
        self._received += 1
        return data

    def _read(self, size: int) -> memoryview:
        data, self._data = self._data[:size], self._data[size:]
        if len(data) < size:
            raise self.error("short message")
        return data

    def close(self) -> int:
        with contextlib.suppress(FileNotFoundError):
            return self.incoming().stat().st_size
        return 0


class FileListener(Listener):
    """Owns `exchange`: a new session word tells messages of this run from stale ones, which it removes."""

    def __init__(self, case: Path, coupling: Coupling, log: Path, share: Share):
        self.log = log
        self.timeout = coupling.timeout
        self.folder = case / share.name("exchange")
        self.session = secrets.token_hex(8)
        try:
            for stale in private_folder(self.folder).iterdir():
                if OWN.fullmatch(stale.name):
                    stale.unlink()
        except OSError as error:
            raise CouplingError(f"cannot use {error.filename or self.folder}: {error.strerror}") from None
        write_secret(self.folder / "session", self.session + "\n")

    def greet(self, give_up: Callable[[], bool]) -> tuple[Channel, Message, Hello] | None:
        channel = FileChannel(self.folder, self.session, self.timeout, self.log)
        while not channel.incoming().exists():
            if give_up():
                return None
            time.sleep(POLL / 10)
        dialogue = greeting(token="")
        next(dialogue)
        try:
            dialogue.send(channel.receive())
        except StopIteration as end:
            return channel, *end.value
        except (ProtocolError, CouplingError) as error:
            channel.say_why(str(error))
            raise channel.error(str(error)) if isinstance(error, ProtocolError) else error from None
        raise AssertionError("nobody else reads this folder: HELLO is enough")

    def close(self) -> None:
        with contextlib.suppress(OSError):
            (self.folder / "session").unlink()
