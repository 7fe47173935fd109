"""A test that hangs is ended, with the stacks of all its processes in its report.

After `hang_after` seconds of one test (pyproject.toml; many times what the longest takes on a busy machine) a thread
of this file writes the Python stacks of the test process, asks every process below it for its own, kills them, and so
lets the test go on to its failure. A test that does not even then come to an end takes the whole process with it.
"""

from __future__ import annotations

import faulthandler
import os
import signal
import sys
import tempfile
import threading
import time
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path

import pytest

REST = 60.0  # for a test to end once its processes are gone [s]
MOMENT = 20.0  # for processes to write their stacks, on which they end [s]
TAIL = 6000  # characters of the end of a log

# what each writes a stack on: OpenFOAM's own handler, and Python's under PYTHONFAULTHANDLER
OPENFOAM, PYTHON = signal.SIGQUIT, signal.SIGABRT


def pytest_addoption(parser: pytest.Parser) -> None:
    parser.addini("hang_after", "seconds after which a test is taken to hang", default="600")


def pytest_configure(config: pytest.Config) -> None:
    os.environ["PYTHONFAULTHANDLER"] = "1"  # of all that tests start


@pytest.hookimpl(wrapper=True)
def pytest_runtest_protocol(item: pytest.Item):
    watch = Watch(item)
    item.stash[WATCH] = watch
    watch.start()
    try:
        return (yield)
    finally:
        watch.stop()


@pytest.hookimpl(wrapper=True)
def pytest_runtest_makereport(item: pytest.Item, call: pytest.CallInfo):
    report = yield
    with item.stash[WATCH].at_work:
        found = item.stash[WATCH].found
    if found:
        report.outcome = "failed"
        report.sections.append(("what stood where when the test hung", found))
        report.longrepr = report.longrepr or f"the test hung in its {call.when}"
    return report


class Watch(threading.Thread):
    """Waits beside one test, and acts where it takes too long."""

    def __init__(self, item: pytest.Item):
        super().__init__(name="hang", daemon=True)
        self.name_of_test = item.nodeid
        self.patience = float(item.config.getini("hang_after"))
        self.found = ""  # the stacks, if it came to that
        self.at_work = threading.Lock()
        self._over = threading.Event()

    def stop(self) -> None:
        self._over.set()
        self.join()

    def run(self) -> None:
        if self._over.wait(self.patience):
            return
        with self.at_work:
            self.found = f"{self.name_of_test} did not end in {self.patience:g} s\n\n{stacks()}"
        if not self._over.wait(REST):
            print(self.found, file=sys.__stderr__, flush=True)
            os._exit(3)


WATCH = pytest.StashKey[Watch]()


def stacks() -> str:
    """Of this process and of all below it, which are ended."""
    with tempfile.TemporaryFile("w+") as file:
        faulthandler.dump_traceback(file, all_threads=True)
        file.seek(0)
        parts = [f"--- process {os.getpid()}, the tests\n{file.read()}"]
    family = list(descendants(os.getpid()))
    states = {pid: state(pid) for pid in family}
    outputs = {pid: output(pid) for pid in family}
    for pid in family:
        send(pid, PYTHON if "python" in states[pid] else OPENFOAM)
        send(pid, signal.SIGCONT)  # those that a test has stopped
    end = time.monotonic() + MOMENT
    while any(map(alive, family)) and time.monotonic() < end:
        time.sleep(0.05)
    for pid in family:
        send(pid, signal.SIGKILL)
    parts += [f"--- process {pid}: {words}" for pid, words in states.items()]
    for path in dict.fromkeys(filter(None, outputs.values())):
        parts.append(f"--- the end of {path}\n{path.read_text(errors='replace')[-TAIL:]}")
    return "\n".join(parts)


def send(pid: int, number: int) -> None:
    with suppress(ProcessLookupError):
        os.kill(pid, number)


def alive(pid: int) -> bool:
    """Whether it is there and not only a number that its parent has not asked for."""
    try:
        return ") Z " not in Path(f"/proc/{pid}/stat").read_text()
    except OSError:
        return False


def descendants(pid: int) -> Iterator[int]:
    """Processes that this one started, and those that they did."""
    for task in Path(f"/proc/{pid}/task").glob("*/children"):
        try:
            children = task.read_text().split()
        except OSError:
            continue
        for child in map(int, children):
            yield child
            yield from descendants(child)


def state(pid: int) -> str:
    """Its command, state and what it waits for in the kernel."""
    folder = Path(f"/proc/{pid}")
    try:
        words = (folder / "cmdline").read_text().replace("\0", " ")
        about = dict(line.split(":\t", 1) for line in (folder / "status").read_text().splitlines())
        return f"{words}\n    {about['State'].strip()} in {(folder / 'wchan').read_text()}"
    except OSError:
        return "has ended"


def output(pid: int) -> Path | None:
    """The file that it writes its errors to."""
    try:
        path = Path(os.readlink(f"/proc/{pid}/fd/2"))
    except OSError:
        return None
    return path if path.is_file() else None
