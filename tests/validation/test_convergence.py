"""The coupling as a whole: OpenFOAM, the plugin, the daemon and the fibers against the spectral solver."""

from __future__ import annotations

from gbm_plugin.validation import convergence

from conftest import DEFAULT_CASE


def test_flow_and_fibers_converge_at_second_order():
    """Finite volumes, trilinear sampling and a step in proportion to the cells: all second order; the velocity is
    better than that on coarse meshes, where cubic interpolation removes most of its error. The reference resolves the
    initial modes, samples them exactly and shares none of the code of the flow."""
    result = convergence.run(DEFAULT_CASE, [16, 24], 0.06)
    for name, order in result["orders"][0].items():
        most = 3.5 if name == "velocity_error" else 2.4
        assert 1.6 < order < most, f"{name}\n{convergence.table(result)}"
    assert result["rows"][1]["velocity_error"] < 0.05
