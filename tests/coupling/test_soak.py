"""The soak of tools/soak in short: no step lost or double, memory and descriptors level."""

from __future__ import annotations

import runpy
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

TOOL = Path(__file__).parents[2] / "tools/soak"
STEPS = 500


@pytest.mark.openfoam
def test_five_hundred_steps():
    size = ("--cells", "8", "--fibers", "4", "--steps", str(STEPS))
    done = subprocess.run([sys.executable, TOOL, *size], capture_output=True, text=True)
    assert done.returncode == 0, done.stdout + done.stderr
    assert "500 steps" in done.stdout and "solver: " in done.stdout


@pytest.mark.parametrize("leak, files, said", [(0, 0, None), (3, 0, "memory"), (0, 1, "descriptors")])
def test_it_sees_what_grows(leak, files, said):
    """leak [kB in a step], files [in a hundred steps], over the noise of pages that come and go."""
    random = np.random.default_rng(1)
    rows = [
        {
            "step": n,
            "MiB": 100 + leak * n / 1024 + random.normal(0, 0.02),
            "descriptors": 20 + files * n // 100,
        }
        for n in range(0, STEPS, 8)
    ]
    problems = runpy.run_path(str(TOOL))["judged"](rows, STEPS)["problems"]
    assert [p for p in problems if said and said in p] == problems and bool(problems) == bool(said)
