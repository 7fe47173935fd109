"""Locks on a case, which end with the processes that hold them."""

from __future__ import annotations

import fcntl
import os
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from ..errors import CaseError, LockedError
from ..files import opened_lock

RUN, DAEMON = "run", "daemon"


@contextmanager
def locked(case: Path, who: str) -> Iterator[int]:
    """The only run or daemon of a case. Yields the lock's descriptor: a child process that gets it keeps the
    case locked although this process dies. LockedError where another process has the lock."""
    try:
        file = opened_lock(case / f".gbm.{who}.lock")
    except OSError as error:
        raise CaseError(f"cannot write {case / f'.gbm.{who}.lock'}: {error.strerror}") from None
    with file:
        try:
            fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except OSError:
            raise LockedError(
                f"another {who} is under way in {case} (process {file.read().strip()}, or one that it started)"
            ) from None
        file.truncate(0)
        file.write(f"{os.getpid()}\n")
        file.flush()
        yield file.fileno()
