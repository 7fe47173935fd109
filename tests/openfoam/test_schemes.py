"""leanCubic beside OpenFOAM's cubic."""

from __future__ import annotations

import fluidfoam
import numpy as np
import pytest

from gbm_plugin.case.openfoam import utility

from conftest import divide, make_case, set_entry, start_solver

pytestmark = pytest.mark.openfoam

STEPS, TIME = 1, "0.02"


def prepare(path, convection: str, **options):
    make_case(
        path, **{"cells": 12, "steps": STEPS, "write_every": STEPS, "application": "pimpleFoam"} | options
    )
    control = path / "system/controlDict"
    control.write_text(control.read_text().split("functions")[0])
    set_entry(path / "system/fvSchemes", "div(phi,U)", convection)
    return path


def solve(path, ranks: int = 1) -> np.ndarray:
    assert start_solver(path, ranks).wait() == 0, (path / "log.pimpleFoam").read_text()[-2000:]
    if ranks > 1:
        utility(path, "reconstructPar", "-latestTime")
    return fluidfoam.readfield(str(path), TIME, "U", verbose=False)


@pytest.mark.parametrize(
    "grading, ranks, n",
    [("2 1 0.5", 1, None), ("2 1 0.5", 2, (2, 1, 1)), ("1 1 1", 1, None), ("1 1 1", 2, (1, 2, 1))],
    ids=["graded", "graded on ranks", "uniform", "uniform on ranks"],
)
def test_the_values_of_cubic(tmp_path, grading, ranks, n):
    """On a mesh whose cells grow, where the weights of faces are not one half; and on one of equal cells, where four
    in a row are taken, those on other ranks too."""
    fields = {}
    for scheme in ("leanCubic", "cubic", "linear"):
        path = prepare(tmp_path / scheme, f"Gauss {scheme}")
        block = path / "system/blockMeshDict"
        block.write_text(block.read_text().replace("simpleGrading (1 1 1)", f"simpleGrading ({grading})"))
        utility(path, "blockMesh")
        if ranks > 1:
            divide(path, ranks, n)
        fields[scheme] = solve(path, ranks)
    scale = np.abs(fields["cubic"]).max()
    np.testing.assert_allclose(fields["leanCubic"], fields["cubic"], rtol=0, atol=1e-10 * scale)
    assert np.abs(fields["linear"] - fields["cubic"]).max() > 1e-4 * scale
