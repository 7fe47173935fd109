"""The log of a solver: what it says of a run, read by PyFoam, and how it is kept from growing without bound."""

from __future__ import annotations

import ctypes
import os
import re
from pathlib import Path

import numpy as np

MOST = 32 << 20  # bytes of a log, beyond which its middle is left out
HEAD, TAIL = 64 << 10, 8 << 20  # what is kept of it
GAP = "bytes left out by gbm run"
EARLIER = re.compile(rb"\[\.\.\. (\d+) " + GAP.encode() + rb" \.\.\.\] *\n")
WARNING = re.compile(
    rb"^--> FOAM Warning[^\n]*\n(?:[ \t]+[^\n]*\n)*", re.MULTILINE
)  # with what is indented below it
_LIBC = ctypes.CDLL(None)  # Python's os.posix_fallocate has no modes
_LIBC.fallocate.argtypes = [ctypes.c_int, ctypes.c_int, ctypes.c_long, ctypes.c_long]
_COLLAPSE_RANGE = 0x08  # linux/falloc.h


def shorten(log: Path, most: int = MOST, head: int = HEAD, tail: int = TAIL) -> None:
    """Cut the middle out of a log that has more than `most` bytes, and that another process appends to (O_APPEND).

    OpenFOAM's warnings stay, each kind once, as many as have room beside the head.
    """
    size = log.stat().st_size
    if size <= most:
        return
    with log.open("r+b") as file:  # written in place: the other process keeps its own descriptor
        block = os.fstatvfs(file.fileno()).f_frsize
        end = (size - tail) // block * block  # of what goes, a whole number of blocks
        first = file.read(head)
        first = first[: first.rfind(b"\n") + 1]
        file.seek(len(first))
        middle = file.read(end - len(first))
        warnings = b"".join(dict.fromkeys(WARNING.findall(middle)))[:head]
        torn = file.readline(tail).rpartition(b"\n")[0]  # the rest of a line whose beginning goes
        earlier = EARLIER.match(middle)
        count = len(middle) + len(torn) - len(warnings)
        if earlier:
            count += int(earlier[1]) - len(earlier[0])
        gap = f"[... {count} {GAP} ...]".encode()
        whole = -(-len(first + gap + b"\n" + warnings) // block) * block
        kept = first + gap.ljust(whole - len(first) - 1 - len(warnings)) + b"\n" + warnings
        if len(kept) < end:
            os.pwrite(file.fileno(), kept, 0)
            os.pwrite(file.fileno(), b" " * len(torn), end)
            _cut(file.fileno(), len(kept), end)


def _cut(file: int, begin: int, end: int) -> None:
    """Take the bytes [begin, end) out of an open file that others append to."""
    if _LIBC.fallocate(file, _COLLAPSE_RANGE, begin, end - begin) == 0:
        return  # at once, under the file's lock
    # not on NFS, Lustre, tmpfs: there a line may be lost that comes between the last read and ftruncate
    while newest := os.pread(file, 1 << 20, end):
        begin += os.pwrite(file, newest, begin)
        end += len(newest)
    os.ftruncate(file, begin)


def summary(log: Path) -> str | None:
    """Steps, CPU time of a step on one rank, and the largest continuity error; None where no step was finished."""
    # here, as importing PyFoam starts 19 processes
    from PyFoam.LogAnalysis.ContinuityLineAnalyzer import GeneralContinuityLineAnalyzer
    from PyFoam.LogAnalysis.ExecutionTimeLineAnalyzer import GeneralExecutionLineAnalyzer
    from PyFoam.LogAnalysis.FoamLogAnalyzer import FoamLogAnalyzer

    analyzer = FoamLogAnalyzer()
    analyzer.addAnalyzer("time", GeneralExecutionLineAnalyzer(doFiles=False))
    analyzer.addAnalyzer("continuity", GeneralContinuityLineAnalyzer(doFiles=False))
    with log.open(errors="replace") as lines:
        analyzer.analyze(lines)
    steps = analyzer.getAnalyzer("time").lines.getValues("cpu")
    if not len(steps):
        return None
    error = np.max(np.abs(analyzer.getAnalyzer("continuity").lines.getValues("Global")), initial=0.0)
    with log.open(errors="replace") as lines:
        some = "the last " if GAP in lines.read(2 * HEAD) else ""
    return (
        f"{some}{len(steps)} steps, {np.median(steps):.3g} s of CPU each; continuity errors below {error:.1e}"
    )
