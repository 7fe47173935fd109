"""All writing in a case: never through a link that somebody left where a file is to be, and whole or not at all.

A case may come from a stranger, with `log.pimpleFoam` a link to a file of the user's. So what was there is replaced,
whatever it is, and nothing that was there is opened for writing.
"""

from __future__ import annotations

import contextlib
import os
import secrets
import stat
from collections.abc import Iterator
from pathlib import Path
from typing import IO

_NEW = os.O_CREAT | os.O_EXCL | os.O_NOFOLLOW | os.O_CLOEXEC


def created(path: Path, mode: str = "w", *, private: bool = False, **options) -> IO:
    """A new file, open to be written while others read it, as logs and tables are. A file or link of its name is
    removed first. private: nobody else may read it. options: as those of open."""
    with contextlib.suppress(FileNotFoundError):
        path.unlink()
    return _opened(path, mode, private, **options)


@contextlib.contextmanager
def replaced(
    path: Path, mode: str = "w", *, private: bool = False, durable: bool = False, **options
) -> Iterator[IO]:
    """A file that appears under its name, in place of what was there, when the block ends well, and else not at all.

    durable: on the disk before it appears. An OSError, in the block too, names the file.
    """
    try:
        with replacement(path) as part, _opened(part, mode, private, **options) as file:
            yield file
            if durable:
                file.flush()
                os.fsync(file.fileno())
    except OSError as error:
        raise OSError(error.errno, error.strerror or str(error), str(path)) from None


@contextlib.contextmanager
def replacement(path: Path) -> Iterator[Path]:
    """A free name beside `path`, with its suffix, for a writer that opens files itself; then as `replaced`."""
    part = path.with_name(f".{secrets.token_hex(8)}.{path.name}")
    try:
        yield part
        os.replace(part, path)
    finally:
        with contextlib.suppress(OSError):
            part.unlink()


def write_text(path: Path, text: str, *, private: bool = False) -> None:
    """A whole file of this text, in one step."""
    with replaced(path, private=private, encoding="utf-8") as file:
        file.write(text)


def opened_lock(path: Path) -> IO:
    """A file to be locked, made where it is missing: nobody else can open it, and so nobody else can hold it."""
    flags = os.O_RDWR | os.O_CREAT | os.O_NOFOLLOW | os.O_CLOEXEC
    file = os.fdopen(os.open(path, flags, 0o600), "r+")
    os.fchmod(file.fileno(), 0o600)  # one of an earlier version may be open to others
    return file


def private_folder(path: Path) -> Path:
    """A folder that is the user's own and nobody else enters, made where it is missing; returns path.

    PermissionError where something else has its name: a link, a file, or another user's folder.
    """
    with contextlib.suppress(FileExistsError):
        path.mkdir(mode=0o700)
    found = path.lstat()
    if not stat.S_ISDIR(found.st_mode) or found.st_uid != os.geteuid():
        what = "a link" if stat.S_ISLNK(found.st_mode) else "not a folder of this user"
        raise PermissionError(1, f"it is {what}: remove it", str(path))
    path.chmod(0o700)
    return path


def _opened(path: Path, mode: str, private: bool, **options) -> IO:
    access = (os.O_RDWR if "+" in mode else os.O_WRONLY) | (os.O_APPEND if "a" in mode else 0)
    return os.fdopen(os.open(path, _NEW | access, 0o600 if private else 0o666), mode, **options)
