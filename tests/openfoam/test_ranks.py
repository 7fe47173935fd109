"""Two to eight ranks in every direction, evenly or not: the serial result, or a refusal, and never a hang."""

from __future__ import annotations

import re

import numpy as np
import pytest

from gbm_plugin.case.openfoam import fatal_message

from conftest import DEFAULT_CASE, divide, make_case, start_solver
from probe import probe

pytestmark = pytest.mark.openfoam

LAYERS = 20
SLABS = [(2, "x"), (3, "y"), (4, "z"), (5, "x"), (6, "y"), (7, "z"), (8, "x")]  # each number, each direction
LAYERED = [(2, "z"), (3, "z"), (4, "x"), (5, "z"), (5, "y"), (8, "z")]
POSITIONS = np.random.default_rng(1).uniform(0, 2 * np.pi, (40, 3))


def blocks(ranks: int, direction: str) -> tuple[int, int, int]:
    return tuple(ranks if d == direction else 1 for d in "xyz")


@pytest.fixture(scope="module")
def serial(tmp_path_factory):
    """Forcing, leanCubic and fibers of the default case with stock solvers of the linear equations."""
    path = make_case(
        tmp_path_factory.mktemp("ranks") / "serial", cells=LAYERS, steps=1, application="pimpleFoam"
    )
    return probe(path, POSITIONS)[1]


@pytest.mark.parametrize(("ranks", "direction"), SLABS)
def test_any_slabs_give_the_serial_samples(case, serial, ranks, direction):
    path = case(cells=LAYERS, steps=1, application="pimpleFoam")
    divide(path, ranks, blocks(ranks, direction))
    samples = probe(path, POSITIONS, ranks=ranks)[1]
    assert sorted(samples) == sorted(serial)
    for step, (_, velocity, rotation) in serial.items():
        np.testing.assert_allclose(samples[step][1], velocity, rtol=0, atol=1e-8)
        np.testing.assert_allclose(samples[step][2], rotation, rtol=0, atol=1e-8)


@pytest.mark.parametrize(("ranks", "direction"), LAYERED)
def test_transforms_run_on_even_slabs_of_z_and_refuse_others(case, ranks, direction):
    """The pressure of the pimpleFoam preset: its transforms have whole layers of z, equally many on each rank."""
    path = case(cells=LAYERS, steps=2, application="pimpleFoam", tight=False)
    (path / "constant/fiberProperties").unlink()
    control = path / "system/controlDict"
    text = control.read_text()
    control.write_text(text[: text.index("functions")])
    divide(path, ranks, blocks(ranks, direction))
    returned = start_solver(path, ranks).wait()
    message = fatal_message(path / "log.pimpleFoam")
    if direction == "z" and LAYERS % ranks == 0:
        assert returned == 0, message
        assert re.search(r"periodicFFTPCG:  Solving for p", (path / "log.pimpleFoam").read_text())
    else:
        assert returned != 0
        assert f"divides {LAYERS} layers" in message
        assert f"method simple; simpleCoeffs {{ n (1 1 {ranks}); }}" in message


def test_the_default_case_has_the_transforms():
    assert "periodicFFT" in (DEFAULT_CASE / "system/fvSolution").read_text()
