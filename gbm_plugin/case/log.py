"""What the log of a solver says of a run, read by PyFoam."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from PyFoam.LogAnalysis.ContinuityLineAnalyzer import GeneralContinuityLineAnalyzer
from PyFoam.LogAnalysis.ExecutionTimeLineAnalyzer import GeneralExecutionLineAnalyzer
from PyFoam.LogAnalysis.FoamLogAnalyzer import FoamLogAnalyzer


def summary(log: Path) -> str | None:
    """Steps, CPU time of a step on one rank, and the largest continuity error; None where no step was finished."""
    analyzer = FoamLogAnalyzer()
    analyzer.addAnalyzer("time", GeneralExecutionLineAnalyzer(doFiles=False))
    analyzer.addAnalyzer("continuity", GeneralContinuityLineAnalyzer(doFiles=False))
    with log.open(errors="replace") as lines:
        analyzer.analyze(lines)
    steps = analyzer.getAnalyzer("time").lines.getValues("cpu")
    if not len(steps):
        return None
    error = np.max(np.abs(analyzer.getAnalyzer("continuity").lines.getValues("Global")), initial=0.0)
    return f"{len(steps)} steps, {np.median(steps):.3g} s of CPU each; continuity errors below {error:.1e}"
