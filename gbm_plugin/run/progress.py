"""What a run shows while it goes on: a bar with the time remaining on a terminal, a line now and then elsewhere."""

from __future__ import annotations

import logging
import sys
import time as clock
from pathlib import Path

from rich.console import Console
from rich.progress import BarColumn, TextColumn, TimeRemainingColumn
from rich.progress import Progress as Bar

from ..case.layout import FIBERS, RESULTS, flow_table

log = logging.getLogger(__name__)

TAIL = 4096  # bytes of a table that surely hold its last row
QUIET = 60.0  # between lines where there is no terminal [s]
NAMED = 4  # families in a line
BAR_WIDTH = 14  # columns: the rest of 80 is for what happens


class Progress:
    """A context manager; `update` reads the newest rows of the run's tables and shows them."""

    def __init__(self, scene, start_time: float):
        self._case: Path = scene.case
        self._start = start_time
        self._end = scene.end_time
        self._flow = f"{scene.forcing.name}/*/{flow_table(scene.forcing.name)}" if scene.forcing else ""
        columns = (
            TextColumn("t = {task.fields[now]} of " + f"{self._end:g} s"),
            BarColumn(BAR_WIDTH),
            TimeRemainingColumn(compact=True),
            TextColumn("{task.fields[state]}"),
        )
        console = Console(file=sys.stderr)
        self._bar = Bar(*columns, console=console, disable=not console.is_terminal)
        self._task = self._bar.add_task("", total=self._end - self._start, now=f"{start_time:g}", state="")
        self._said = clock.monotonic()

    def __enter__(self) -> Progress:
        self._bar.start()
        return self

    def __exit__(self, *_) -> None:
        self._bar.stop()

    def update(self) -> None:
        if self._bar.disable and clock.monotonic() - self._said < QUIET:
            return
        flow = newest_row(self._case, self._flow) if self._flow else {}
        fibers = newest_row(self._case, f"{FIBERS}/*/daemon*.dat")
        time = fibers.get("Time", flow.get("Time", self._start))
        parts = [f"Re_λ {flow['ReLambda']:.3g}"] if "ReLambda" in flow else []
        ratios = {n.removeprefix("R2_"): r for n, r in fibers.items() if n.startswith("R2_")}
        if ratios:
            parts.append(f"⟨R²⟩/L² {_words(ratios)}")
        state = "  ".join(parts)
        if self._bar.disable:
            self._said = clock.monotonic()
            log.info("t = %g of %g s  %s", time, self._end, state)
        else:
            self._bar.update(self._task, completed=time - self._start, now=f"{time:g}", state=state)


def _words(ratios: dict[str, float]) -> str:
    """One number for each family, or where there are many the range that they span."""
    if len(ratios) > NAMED:
        return f"{min(ratios.values()):.3f} to {max(ratios.values()):.3f} in {len(ratios)} families"
    return " ".join(f"{name} {ratio:.3f}" for name, ratio in ratios.items())


def newest_row(case: Path, pattern: str) -> dict[str, float]:
    """The last whole row of the newest table in postProcessing that fits the pattern; empty without one."""
    tables = sorted((case / RESULTS).glob(pattern), key=lambda p: p.stat().st_mtime)
    if not tables:
        return {}
    with tables[-1].open("rb") as file:
        head = file.read(TAIL)
        file.seek(max(0, file.seek(0, 2) - TAIL))
        lines = (
            file.read().decode(errors="replace").split("\n")[:-1]
        )  # what follows the last newline is partial
    header = [line for line in head.decode(errors="replace").splitlines() if line.startswith("#")]
    try:
        names = header[-1].lstrip("# ").split()
        values = [float(x) for x in lines[-1].split()]
    except (IndexError, ValueError):
        return {}
    return dict(zip(names, values, strict=False))
