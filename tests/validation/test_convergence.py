"""The coupling as a whole: OpenFOAM, the plugin, the daemon and the fibers against the spectral solver."""

from __future__ import annotations

from gbm_plugin.validation import convergence

from conftest import DEFAULT_CASE


def test_flow_and_fibers_converge_at_second_order():
    """Finite volumes, trilinear sampling and a step in proportion to the cells: all second order. The reference
    resolves the initial modes, samples them exactly and shares none of the code of the flow."""
    result = convergence.run(DEFAULT_CASE, [16, 24], 0.06)
    for name, order in result["orders"][0].items():
        assert 1.6 < order < 2.4, f"{name}\n{convergence.table(result)}"
    assert result["rows"][1]["velocity_error"] < 0.1
