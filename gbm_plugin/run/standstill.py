"""When a run of several processes no longer moves, and what is known of why."""

from __future__ import annotations

import os
import signal
import time
from collections.abc import Iterator, Sequence
from pathlib import Path

STATE, SESSION = 0, 3  # fields of /proc/<pid>/stat, after the name


class Pulse:
    """Signs of life: rows in the daemons' tables, one a step, and lines in anybody's log."""

    def __init__(self, case: Path, logs: Sequence[Path]):
        self._case = case
        self._logs = logs
        self._sizes: dict[Path, int] = {}
        self._since = time.monotonic()

    def silence(self) -> float:
        """Time since the last one that was seen [s]."""
        files = [*self._logs, *self._case.glob("postProcessing/fibers/*/daemon*.dat")]
        sizes = {file: file.stat().st_size for file in files if file.exists()}
        if sizes != self._sizes:
            self._sizes, self._since = sizes, time.monotonic()
        return time.monotonic() - self._since


def where_it_stands(name: str, session: int, log: Path) -> str:
    """One side of a run that stands still: whether it was stopped, else what it said last."""
    stopped = [str(pid) for pid, state in members(session) if state == "T"]
    if stopped:
        return f"{name} was stopped by a signal (process {', '.join(stopped)}; {log})"
    lines = log.read_text(errors="replace").split("\n")
    last = next((line.strip() for line in reversed(lines) if line.strip()), "")
    return f"{name} said last '{last}' ({log})" if last else f"{name} said nothing yet ({log})"


def kill_session(session: int) -> None:
    """End all that the leader of a session started, the ranks of mpirun too, which are groups of their own."""
    for pid, _ in members(session):
        try:
            os.kill(pid, signal.SIGKILL)
        except ProcessLookupError:
            continue


def members(session: int) -> Iterator[tuple[int, str]]:
    """Number and state (R, S, T ...) of the living processes of a session."""
    for entry in Path("/proc").glob("[0-9]*/stat"):
        try:
            fields = entry.read_text().rpartition(")")[2].split()
        except OSError:  # it has ended
            continue
        if int(fields[SESSION]) == session and fields[STATE] != "Z":
            yield int(entry.parent.name), fields[STATE]
