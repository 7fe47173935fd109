"""Fibers of a coupled run in a flow that is known: the ABC flow, held in OpenFOAM by the linear forcing."""

from __future__ import annotations

import numpy as np
import pytest

from gbm_plugin.output.tables import read_dat
from gbm_plugin.studies.validate import steady

from conftest import make_case, run_case, set_entry

pytestmark = pytest.mark.openfoam


def test_fibers_converge_to_those_in_the_analytic_flow(second_order):
    result = steady.run(second_order, [16, 20], 0.04, halvings=2)
    text = steady.table(result)
    for name in ("stiff_error", "medium_error", "soft_error"):
        assert 1.7 < result["orders"][0][name] < 2.6, f"{name}\n{text}"
    # the discrete Laplacian of waves k = 1 is weaker by h^2/12, so that the flow grows; less, as the fluxes'
    # interpolation dissipates at a higher order
    grown = [np.expm1(steady.VISCOSITY * (2 * np.pi / n) ** 2 / 12 * steady.END_TIME) for n in (16, 20)]
    shares = np.divide([row["velocity_error"] for row in result["rows"]], grown)
    assert 0.6 < shares[0] < shares[1] < 1, text
    assert result["rows"][1]["soft_error"] < 0.02, text
    (orders,) = result["temporal_orders"]
    # of the flow's step little is left: a small, non-monotonic part of the fluxes' interpolation, which vanishes with
    # the mesh
    for row in result["temporal_rows"]:
        for name in ("velocity_error", "stiff_error", "medium_error", "soft_error"):
            assert row[name] < 0.1 * result["rows"][0][name], f"{name}\n{text}"
    # quadratic extrapolation of the flow along the paths
    assert 2.8 < orders["extrapolation_error"] < 3.2, text


def test_long_viscous_steps_of_the_default_case_are_stable(tmp_path):
    """nu deltaT/dx^2 = 0.39 and a Courant number of 4: with a single pressure solve in each outer corrector the energy
    triples here. It must grow by no more than the discrete Laplacian is too weak."""
    viscosity, steps, step, cells = 0.2, 8, 0.3, 16
    forcing, nobody = (
        steady.FORCING.format(viscosity=viscosity),
        "one { count 1; beads 2; length 0.1; bendingStiffness 0; }",
    )
    sizes = {"cells": cells, "steps": steps, "time_step": step, "tight": False, "prepared": False}
    sizes |= {"application": "pimpleFoam"}
    case = make_case(tmp_path / "case", **sizes, fv_options=forcing, initial=steady.FLOW, families=nobody)
    set_entry(case / "constant/transportProperties", "nu", str(viscosity))
    run_case(case)
    energy = read_dat(case / "postProcessing/linearForcing", "linearForcing.dat")["k"]
    growth = np.exp(2 * viscosity * (2 * np.pi / cells) ** 2 / 12 * steps * step)
    np.testing.assert_allclose(energy[-1] / energy[0], growth, rtol=2e-3)
