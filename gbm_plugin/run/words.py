"""What a run says when it begins and when it has ended."""

from __future__ import annotations

import logging
from pathlib import Path

from ..case.scene import Scene
from ..report.summary import summary

log = logging.getLogger(__name__)

COMPLETE = "the run to time %g is complete; --fresh repeats it"


def opening(scene: Scene, start_time: float, logs: str = "") -> None:
    """Cells, fibers, steps, and where the programs' own words go."""
    fibers = sum(f.count for f in scene.families)
    beads = sum(f.count * f.beads for f in scene.families)
    steps = round((scene.end_time - start_time) / scene.time_step)
    cells = " x ".join(map(str, scene.cells)) + " cells, " if scene.cells else ""
    families = f"{len(scene.families)} families" if len(scene.families) > 1 else "1 family"
    log.info("%s%d fibers of %s, %d beads", cells, fibers, families, beads)
    log.info("t = %g to %g s: %d steps of %g s%s", start_time, scene.end_time, steps, scene.time_step, logs)


def closing(scene: Scene, folder: Path) -> None:
    """What was found, where it is, and what comes next. folder: of the results, the case or one in it."""
    cell = (
        max(b / n for b, n in zip(scene.box, scene.cells, strict=True)) if scene.box and scene.cells else None
    )
    for line in summary(folder, cell):
        log.info(line)
    log.info("written: time folders and postProcessing in %s", _short(folder))
    log.info("next: gbm report %s    figures, tables, fibers for ParaView", _short(folder))


def _short(path: Path) -> str:
    """From here, where that is shorter."""
    try:
        return str(path.relative_to(Path.cwd()))
    except ValueError:
        return str(path)
