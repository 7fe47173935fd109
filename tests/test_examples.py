"""The examples of docs/examples, each with the number that it is about."""

from __future__ import annotations

import runpy
from pathlib import Path

import pytest

EXAMPLES = Path(__file__).parents[1] / "docs/examples"

# example: the theory's number and the tolerance for steps, resolution or samples
NUMBERS = {
    "jeffery_orbit": (1.0, 1e-3),
    "taylor_green_vortex": (0.124953117517, 1e-9),
    "tumbling_rods": (1.0, 0.03),
}


@pytest.mark.parametrize("name", NUMBERS)
def test_example(name):
    expected, tolerance = NUMBERS[name]
    assert runpy.run_path(str(EXAMPLES / f"{name}.py"))["main"]() == pytest.approx(expected, abs=tolerance)


def test_every_example_is_here():
    paths = list(EXAMPLES.glob("*.py"))
    assert {p.stem for p in paths} == set(NUMBERS)
    assert all(len(p.read_text().splitlines()) < 40 for p in paths)
