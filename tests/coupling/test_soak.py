"""The soak of tools/soak in short: no step lost or double, memory and descriptors level."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

pytestmark = pytest.mark.openfoam

TOOL = Path(__file__).parents[2] / "tools/soak"


def test_five_hundred_steps():
    done = subprocess.run(
        [sys.executable, TOOL, "--cells", "8", "--steps", "500"], capture_output=True, text=True, timeout=300
    )
    assert done.returncode == 0, done.stdout + done.stderr
    assert "500 steps" in done.stdout and "solver: " in done.stdout
