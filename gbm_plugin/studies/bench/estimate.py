"""The time that `gbm info` estimates beside the time that a run takes: presets, both engines, both mobilities.

Each preset is cut to a few seconds of its flow and run. Times are processor time of a step: of the flow, with what it
samples for the fibers (of OpenFOAM, by its log; of the spectral solver with its fibers, all one process), and of the
daemon, between a sample and the next positions (lower quartile, with OpenFOAM alone). `wall` is that of the whole run,
the estimate of an idle machine: on one that others use it is longer. Transforms before and after each run tell how fast
the machine is at that time.
"""

from __future__ import annotations

import argparse
import math
import os
import re
import resource
import shutil
import subprocess
import sys
import tempfile
import time
from collections.abc import Sequence
from dataclasses import replace
from itertools import product
from pathlib import Path

import numpy as np

from ...case.cost import cost, machine
from ...case.edit import set_entries
from ...case.layout import SPECTRAL, daemon_table, log_file, results
from ...case.new import PRESETS, new_case
from ...case.scene import Scene, read_scene
from ...errors import RunError
from ...fiber.model import MOBILITIES
from ...output.tables import read_dat
from ..study import option
from ..study import steps as progress

DEFAULT = ("default", "quick", "pimpleFoam", "flow-I", "taylor-green")
FLOWS = ("openfoam", SPECTRAL)
LEAST = 30  # steps
START = 5  # steps that are corrected
UNDISTURBED = 0.25  # of the steps of the daemon, which has no clock but that of the wall


def add_arguments(parser: argparse.ArgumentParser) -> None:
    option(parser, run, "presets", "which", nargs="+", choices=list(PRESETS), metavar="NAME")
    option(parser, run, "flows", "of gbm run --flow", nargs="+", choices=FLOWS, metavar="FLOW")
    option(parser, run, "mobilities", "of all fibers", nargs="+", choices=MOBILITIES, metavar="WORD")
    option(parser, run, "seconds", "of the flow and its fibers in each, estimated")


def run(
    presets: Sequence[str] = DEFAULT,
    flows: Sequence[str] = FLOWS,
    mobilities: Sequence[str] = MOBILITIES,
    seconds: float = 5.0,
) -> dict:
    """Seconds, estimated and taken. Raises RunError where a run fails."""
    found, cases = [], list(product(presets, flows, mobilities))
    with tempfile.TemporaryDirectory(prefix="gbm-estimate-") as folder:
        for preset, flow, mobility in progress(cases, len(cases), "runs"):
            case = _case(Path(folder) / f"{preset}-{flow}-{mobility}", preset, mobility)
            count = _cut(case, flow, machine(), seconds)
            row = {"preset": preset, "flow": flow, "mobility": mobility, "steps": count}
            found.append(row | _measured(case, flow, count))
    return {"runs": found}


def _case(folder: Path, preset: str, mobility: str) -> Path:
    """A preset; one that begins from an earlier run begins as the shipped case does. Tracers have no mobility."""
    case = new_case(folder, preset)
    properties, field = case / "constant/fiberProperties", case / "system/initialFieldDict"
    if re.search(r"^mobility\b", properties.read_text(), re.MULTILINE):
        set_entries(properties, {"mobility": mobility})
    if re.search(r"^from\b", field.read_text(), re.MULTILINE):
        shutil.copy(new_case(folder.with_suffix(".start")) / "system/initialFieldDict", field)
    return case


def _scene(case: Path, flow: str) -> Scene:
    scene = read_scene(case)
    return replace(scene, application=SPECTRAL) if flow == SPECTRAL else scene


def _cut(case: Path, flow: str, slower: float, seconds: float) -> int:
    """The case ends after so many steps as take `seconds`."""
    scene = _scene(case, flow)
    whole = cost(scene, slower)
    count = min(scene.steps, max(LEAST, round(scene.steps * seconds / (whole.solver + whole.daemon))))
    _end_after(case, scene, count)
    return count


def _end_after(case: Path, scene: Scene, count: int) -> None:
    times = {"endTime": scene.start_time + count * scene.time_step, "writeInterval": count}
    set_entries(case / "system/controlDict", times)


def _measured(case: Path, flow: str, count: int) -> dict[str, float]:
    before, scene, first = machine(), _scene(case, flow), 0.0
    if flow == SPECTRAL:  # the same process begins and takes steps: what START of them take is taken off
        _end_after(case, scene, START)
        first = min(_timed(case, flow)[1] for _ in range(2))  # the first may compile
        _end_after(case, scene, count)
    wall, own = _timed(case, flow)
    slower = math.sqrt(before * machine())
    estimate = cost(scene, slower)
    row = {"slower": slower, "wall_estimated": estimate.total, "wall": wall}
    if flow == SPECTRAL:
        begun = cost(replace(scene, end_time=scene.start_time + START * scene.time_step), slower)
        estimated = (estimate.solver + estimate.daemon - begun.solver - begun.daemon) / (count - START)
        return {"step_estimated": estimated, "step": (own - first) / (count - START)} | row
    log = log_file(case, scene.application).read_text()
    spent = [float(t) for t in re.findall(r"^ExecutionTime = ([\d.]+) s", log, re.MULTILINE)]
    daemon = read_dat(results(case), daemon_table())
    busy = float(np.quantile((daemon["sentAt"][1:] - daemon["arrivedAt"][:-1])[START:], UNDISTURBED))
    row |= {"daemon_estimated": estimate.daemon / count, "daemon": busy}
    spent = spent[2:-1]  # without the start of the program and of the scheme, and the writing at the end
    step = (spent[-1] - spent[0]) / (len(spent) - 1)
    return {"step_estimated": estimate.solver / count, "step": step} | row


def _timed(case: Path, flow: str) -> tuple[float, float]:
    """Seconds of `gbm run`, with one thread for the fibers: by the clock, and processor time of all its processes."""
    argv = [sys.executable, "-m", "gbm_plugin.cli", "run", str(case), "--flow", flow, "--fresh"]
    begin, own = time.perf_counter(), _processor_time()
    done = subprocess.run(argv, env=os.environ | {"NUMBA_NUM_THREADS": "1"}, capture_output=True, text=True)
    if done.returncode:
        raise RunError(f"{case}: {done.stderr.strip()}")
    return time.perf_counter() - begin, _processor_time() - own


def _processor_time() -> float:
    """Of all processes that this one started and that have ended [s]."""
    used = resource.getrusage(resource.RUSAGE_CHILDREN)
    return used.ru_utime + used.ru_stime


def rows(result: dict) -> list[dict]:
    return result["runs"]


def table(result: dict) -> str:
    head = f"{'a step [ms]: estimated, taken, ratio':>79}{'wall [s]':>24}"
    lines = [head, f"{'preset':<16}{'flow':<10}{'mobility':<10}{'steps':>6}{'flow':>20}{'daemon':>26}"]
    for r in result["runs"]:
        daemon = _pair(r, "daemon", 1e3) if "daemon" in r else " " * 26
        lines.append(
            f"{r['preset']:<16}{r['flow']:<10}{r['mobility']:<10}{r['steps']:>6}{_pair(r, 'step', 1e3)}{daemon}"
            f"{_pair(r, 'wall', 1.0)}"
        )
    return "\n".join(lines)


def _pair(r: dict, name: str, unit: float) -> str:
    estimated, taken = unit * r[f"{name}_estimated"], unit * r[name]
    return f"{estimated:>10.3g}{taken:>9.3g}{estimated / taken:>7.2f}"
