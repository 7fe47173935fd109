"""The fibers of the study of buckling through OpenFOAM, with its flow held there."""

from __future__ import annotations

from gbm_plugin.studies.validate import buckling_openfoam


def test_paths_converge_to_those_of_simulate(second_order):
    result = buckling_openfoam.run(second_order, cells=[16, 24], steps=64, halvings=2, count=24, end=1.0)
    text = buckling_openfoam.table(result)
    (orders,) = result["orders"]
    assert 1.6 < orders["paths_error"] < 2.6, text
    assert result["rows"][1]["paths_error"] < 0.05, text
    assert 2 < result["temporal_orders"][0]["paths_error"] < 4, text  # the coupling's quadratic extrapolation
    held, analytic, apart = result["probability_rows"]
    assert held["tracks"] > 10 and analytic["tracks"] > 10, text
    assert abs(apart["probability"]) < 4 * max(apart["standard_error"], 0.02), text
