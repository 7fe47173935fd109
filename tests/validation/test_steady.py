"""Fibers of a coupled run in a flow that is known: the ABC flow, held in OpenFOAM by the linear forcing."""

from __future__ import annotations

import numpy as np

from gbm_plugin.validation import steady


def test_fibers_converge_to_those_in_the_analytic_flow(second_order):
    result = steady.run(second_order, [16, 24], 0.025, halvings=2)
    text = steady.table(result)
    for name in ("stiff_error", "medium_error", "soft_error"):
        assert 1.7 < result["orders"][0][name] < 2.6, f"{name}\n{text}"
    # the discrete Laplacian of waves k = 1 is weaker by h^2/12, so that the flow grows; less, as the fluxes'
    # interpolation dissipates at a higher order
    grown = [np.expm1(steady.VISCOSITY * (2 * np.pi / n) ** 2 / 12 * steady.END_TIME) for n in (16, 24)]
    shares = np.divide([row["velocity_error"] for row in result["rows"]], grown)
    assert 0.6 < shares[0] < shares[1] < 1, text
    assert result["rows"][1]["soft_error"] < 0.02, text
    (orders,) = result["temporal_orders"]
    assert orders["velocity_error"] > 1.8, text
    assert orders["soft_error"] > 1.8 and orders["stiff_error"] > 1.8, text
    # quadratic extrapolation of the flow along the paths
    assert 2.8 < orders["extrapolation_error"] < 3.2, text
