"""The log of a solver: what it says of a run, read by PyFoam, and how it is kept from growing without bound."""

from __future__ import annotations

import os
import re
from pathlib import Path

import numpy as np

MOST = 32 << 20  # bytes of a log, beyond which its middle is left out
HEAD, TAIL = 64 << 10, 8 << 20  # what is kept of it
GAP = "bytes left out by gbm run"
WARNING = re.compile(
    rb"^--> FOAM Warning[^\n]*\n(?:[ \t]+[^\n]*\n)*", re.MULTILINE
)  # with what is indented below it


def shorten(log: Path, most: int = MOST, head: int = HEAD, tail: int = TAIL) -> None:
    """Cut the middle out of a log that has more than `most` bytes, and that another process appends to (O_APPEND).

    OpenFOAM's warnings stay, each kind once, as many as have room beside the head.
    """
    if log.stat().st_size <= most:
        return
    with log.open("r+b") as file:  # written in place: after truncate(0) the other process could come first
        first = file.read(head)
        first = first[: first.rfind(b"\n") + 1]
        file.seek(len(first))
        middle = file.read(log.stat().st_size - tail - len(first))
        warnings = b"".join(dict.fromkeys(WARNING.findall(middle)))[:head]
        start = file.seek(-tail, os.SEEK_END)
        last = file.read()
        cut = last.find(b"\n") + 1
        end = file.tell()
        gap = f"\n[... {start + cut - len(first) - len(warnings)} {GAP} ...]\n".encode() + warnings
        kept = first + gap + last[cut:]
        length = os.pwrite(file.fileno(), kept, 0)
        while newest := os.pread(file.fileno(), most, end):  # what came meanwhile
            length += os.pwrite(file.fileno(), newest, length)
            end += len(newest)
        os.ftruncate(file.fileno(), length)


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
