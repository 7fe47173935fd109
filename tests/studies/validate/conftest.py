"""The default case as pimpleFoam runs it, and with less accurate interpolations, whose order is known."""

from __future__ import annotations

import pytest

from gbm_plugin.case.new import new_case

from conftest import set_entry

LINEAR = {
    "div(phi,U)": "Gauss linear",
    "grad(p)": "Gauss linear",
    '"(flux|dotInterpolate)\\(.*\\)"': "linear",
}


@pytest.fixture(scope="session")
def pimple_case(tmp_path_factory):
    """The preset pimpleFoam; studies copy it."""
    return new_case(tmp_path_factory.mktemp("pimple") / "case", "pimpleFoam")


@pytest.fixture(scope="session")
def second_order(tmp_path_factory):
    """The preset pimpleFoam with nothing but second-order schemes."""
    case = new_case(tmp_path_factory.mktemp("second-order") / "case", "pimpleFoam")
    for name, scheme in LINEAR.items():
        set_entry(case / "system/fvSchemes", name, scheme)
    set_entry(case / "constant/fiberProperties", "interpolation", "trilinear")
    return case
