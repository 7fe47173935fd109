"""Fibers of a coupled run in a flow that is known: the ABC flow, held in OpenFOAM by the linear forcing."""

from __future__ import annotations

from gbm_plugin.validation import steady

from conftest import DEFAULT_CASE


def test_fibers_converge_to_those_in_the_analytic_flow():
    result = steady.run(DEFAULT_CASE, [16, 24], 0.025, halvings=2)
    text = steady.table(result)
    for name, order in result["orders"][0].items():
        assert 1.7 < order < 2.6, f"{name}\n{text}"
    assert result["rows"][1]["soft_error"] < 0.02, text
    (orders,) = result["temporal_orders"]
    assert orders["velocity_error"] > 1.8, text
    assert orders["soft_error"] > 1.8 and orders["stiff_error"] > 1.8, text
    # quadratic extrapolation of the flow along the paths
    assert 2.8 < orders["extrapolation_error"] < 3.2, text
