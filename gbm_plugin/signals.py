"""The signals that ask a run to end: from a terminal, from `kill`, and from queues, before the time of a job is over.

Queues send them to every process of a job alike, so the programs that a run starts are kept from them.
"""

from __future__ import annotations

import contextlib
import signal
from collections.abc import Callable, Iterator

ASKS = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP, signal.SIGUSR1, signal.SIGUSR2)
TELL = signal.SIGUSR2  # how a run asks its daemons: once more does no harm


@contextlib.contextmanager
def handled(action: Callable[[int], None]) -> Iterator[None]:
    """`action` takes the number of each of these signals, but for those that were ignored (nohup)."""
    earlier = {number: signal.getsignal(number) for number in ASKS}
    for number, handler in earlier.items():
        if handler is not signal.SIG_IGN:
            signal.signal(number, lambda number, _: action(number))
    signal.pthread_sigmask(signal.SIG_UNBLOCK, ASKS)  # what came before there was an answer, too
    try:
        yield
    finally:
        for number, handler in earlier.items():
            signal.signal(number, handler)


@contextlib.contextmanager
def kept_from_children() -> Iterator[None]:
    """Programs that are started in the block do not get them before they ask; nor does this process meanwhile."""
    earlier = signal.pthread_sigmask(signal.SIG_BLOCK, ASKS)
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, earlier)


class Asked:
    """What came so far; true once there was any. `again`: the same one a second time, which means at once."""

    def __init__(self) -> None:
        self._seen: set[int] = set()
        self.again = False

    def note(self, number: int) -> None:
        self.again = self.again or (number in self._seen and number != TELL)
        self._seen.add(number)

    def __bool__(self) -> bool:
        return bool(self._seen)
