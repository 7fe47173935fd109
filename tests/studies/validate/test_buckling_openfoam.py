"""The fibers of the study of buckling through OpenFOAM, with its flow held there."""

from __future__ import annotations

import pytest

from gbm_plugin.studies.validate import buckling_openfoam

from conftest import DEFAULT_CASE

pytestmark = pytest.mark.openfoam


def test_paths_converge_to_those_of_simulate():
    result = buckling_openfoam.run(DEFAULT_CASE, cells=[12, 16], steps=32, halvings=1, count=24, end=1.0)
    text = buckling_openfoam.table(result)
    # boxFoam's force balances its viscosity to rounding; a first step of Runge-Kutta and AB3 leave the rest
    assert max(row["velocity_error"] for row in result["rows"]) < 1e-4, text
    # what is left of the paths' error is that of the step, which the run with twice the step shows
    assert result["rows"][1]["paths_error"] < 0.3 * result["temporal_rows"][0]["paths_error"], text
    held, analytic, apart = result["probability_rows"]
    assert held["tracks"] > 10 and analytic["tracks"] > 10, text
    assert abs(apart["probability"]) <= 4 * max(apart["standard_error"], 0.02), text
