"""The time that `gbm info` estimates beside the time that a run takes, preset by preset.

Each preset is cut to a few seconds of its flow and run by OpenFOAM. `processor` is the time of the solver, which
samples for the fibers too: the estimate of flow and coupling. `wall` is that of all, the estimate of an idle machine:
on one that others use it is longer.
"""

from __future__ import annotations

import argparse
import re
import subprocess
import sys
import tempfile
import time
from collections.abc import Sequence
from pathlib import Path

from ...case.cost import cost, machine
from ...case.edit import set_entries
from ...case.new import PRESETS, new_case
from ...case.scene import read_scene
from ...errors import RunError
from ..study import option
from ..study import steps as progress

DEFAULT = ("default", "quick", "pimpleFoam", "flow-I", "taylor-green")
LEAST = 10  # steps


def add_arguments(parser: argparse.ArgumentParser) -> None:
    option(parser, run, "presets", "which", nargs="+", choices=list(PRESETS), metavar="NAME")
    option(parser, run, "seconds", "of the flow in each, estimated")


def run(presets: Sequence[str] = DEFAULT, seconds: float = 10.0) -> dict:
    """Seconds, estimated and taken. Raises RunError where a run fails."""
    found = []
    with tempfile.TemporaryDirectory(prefix="gbm-estimate-") as folder:
        for preset in progress(presets, len(presets), "presets"):
            case = new_case(Path(folder) / preset, preset)
            slower = machine()
            scene = read_scene(case)
            whole = cost(scene, slower)
            steps = round((scene.end_time - scene.start_time) / scene.time_step)
            cut = min(steps, max(LEAST, round(steps * seconds / whole.flow)))
            set_entries(case / "system/controlDict", {"endTime": scene.start_time + cut * scene.time_step})
            set_entries(case / "system/controlDict", {"writeInterval": cut})
            found.append(_measured(case, slower) | {"preset": preset, "steps": cut, "slower": slower})
    return {"runs": found}


def _measured(case: Path, slower: float) -> dict[str, float]:
    estimate = cost(read_scene(case), slower)
    start = time.perf_counter()
    done = subprocess.run(
        [sys.executable, "-m", "gbm_plugin.cli", "run", str(case)], capture_output=True, text=True
    )
    wall = time.perf_counter() - start
    if done.returncode:
        raise RunError(f"{case}: {done.stderr.strip()}")
    log = next(case.glob("log.*Foam")).read_text()
    spent = [float(x) for x in re.findall(r"^ExecutionTime = ([\d.]+) s", log, re.MULTILINE)]
    solver = (spent[-1] - spent[0]) * len(spent) / (len(spent) - 1)  # without the start of the program
    return {
        "solver_estimated": estimate.solver,
        "solver": solver,
        "wall_estimated": estimate.total,
        "wall": wall,
    }


def rows(result: dict) -> list[dict]:
    return result["runs"]


def table(result: dict) -> str:
    lines = [
        f"{'':<14}{'steps':>6} {'processor: estimated':>21}{'taken':>8}{'ratio':>7} {'wall: estimated':>16}{'taken':>8}"
    ]
    for r in result["runs"]:
        ratio = r["solver_estimated"] / r["solver"]
        lines.append(
            f"{r['preset']:<14}{r['steps']:>6} {r['solver_estimated']:>19.2f} s{r['solver']:>6.2f} s{ratio:>7.2f} "
            f"{r['wall_estimated']:>14.1f} s{r['wall']:>6.1f} s"
        )
    return "\n".join(lines)
