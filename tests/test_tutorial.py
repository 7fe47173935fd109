"""The Python of the tutorial runs, on the result of a small run."""

from __future__ import annotations

import os
import re
from pathlib import Path

import pytest

from conftest import make_case, run_case

pytestmark = pytest.mark.openfoam

TUTORIAL = Path(__file__).parents[1] / "docs/tutorial.md"


def test_every_block_of_python(tmp_path):
    path = make_case(tmp_path / "mycase", steps=10, prepared=False)
    run_case(path)
    blocks = re.findall(r"```python\n(.*?)```", TUTORIAL.read_text(), re.DOTALL)
    assert len(blocks) == 2
    here = os.getcwd()
    names: dict = {}
    try:
        os.chdir(tmp_path)
        for block in blocks:
            exec(block.replace("recording.times > 5", "recording.times > 0.1"), names)
    finally:
        os.chdir(here)
    assert names["x"].shape[1:] == (12, 6, 3) and names["x"].shape[0] == 5
    assert names["trajectory"].positions.shape[1:] == (100, 20, 3)
