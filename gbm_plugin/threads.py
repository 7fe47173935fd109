"""Kernels in several threads: each works on its share of the blocks, without Python's lock."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from typing import Any

from numba import config

BEADS_PER_THREAD = 2000  # fewer bead-steps are not worth a second thread,
COPYING = 0.05  # and copying a bead is worth so much of a step

# the cores of this process, or the environment variable of that name
_most: int = config.NUMBA_NUM_THREADS  # type: ignore[attr-defined]
_pool: ThreadPoolExecutor | None = None
_workers = 0  # of the pool


def available() -> int:
    """How many threads kernels may use."""
    return _most


@contextmanager
def limited_to(threads: int) -> Iterator[None]:
    """At most so many threads, inside a with."""
    global _most
    before, _most = _most, threads
    try:
        yield
    finally:
        _most = before


def in_shares(kernel: Callable[..., None], beads: float, *arguments: Any, most: int | None = None) -> None:
    """kernel(share, shares, *arguments) for every share, as many as so many bead-steps are worth, at most `most`.

    A kernel does its part of the blocks, compiled.part_of: what it writes does not depend on their number, and each
    thread finds in its cache what it wrote there before.
    """
    global _pool, _workers
    shares = max(1, min(most or _most, _most, int(beads / BEADS_PER_THREAD)))
    others = []
    if shares > 1:
        if _pool is None or _workers < shares - 1:
            _pool, _workers = ThreadPoolExecutor(shares - 1, "gbm"), shares - 1
        others = [_pool.submit(kernel, share, shares, *arguments) for share in range(1, shares)]
    kernel(0, shares, *arguments)
    for other in others:
        other.result()


def _forget_pool() -> None:
    global _pool
    _pool = None


os.register_at_fork(after_in_child=_forget_pool)  # a fork has none of the threads
