"""The coupling as a whole: OpenFOAM, the plugin, the daemon and the fibers against the spectral solver."""

from __future__ import annotations

import pytest

from gbm_plugin.studies.validate import convergence

from conftest import DEFAULT_CASE

pytestmark = pytest.mark.openfoam


@pytest.fixture(scope="module")
def result(second_order):
    return convergence.run(second_order, [16, 24], 0.06, fibers=15)


def test_flow_and_fibers_converge_at_second_order(result):
    """Finite volumes, trilinear sampling and a step in proportion to the cells: all second order. The reference
    resolves the initial modes, samples them exactly and shares none of the code of the flow."""
    for name, order in result["orders"][0].items():
        assert 1.6 < order < 2.4, f"{name}\n{convergence.table(result)}"
    assert result["rows"][1]["velocity_error"] < 0.1


@pytest.mark.exhaustive
def test_cubic_interpolations_take_out_the_larger_part_of_the_error(result, pimple_case):
    """The preset pimpleFoam, on a mesh where all that is left is of second order: viscosity, pressure and step."""
    plain, cubic = result["rows"][1], convergence.run(pimple_case, [24], 0.04, fibers=15)["rows"][0]
    assert plain["cells"] == cubic["cells"] and plain["time_step"] == pytest.approx(cubic["time_step"])
    for name in ("velocity_error", "stiff_error", "medium_error", "soft_error"):
        assert cubic[name] < 0.65 * plain[name], f"{name}: {cubic[name]:.3e}, {plain[name]:.3e}"


def test_boxfoam_converges_at_its_sixth_order():
    """The default case: differences and sampling of sixth order; on meshes this coarse not yet all of it."""
    result = convergence.run(DEFAULT_CASE, [24, 32], 0.06, fibers=15)
    for name, order in result["orders"][0].items():
        assert 4.5 < order < 7, f"{name}\n{convergence.table(result)}"
