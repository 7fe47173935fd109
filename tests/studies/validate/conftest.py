"""The default case with less accurate interpolations, whose order is known."""

from __future__ import annotations

import shutil

import pytest

from conftest import DEFAULT_CASE, set_entry

LINEAR = {
    "div(phi,U)": "Gauss linear",
    "grad(p)": "Gauss linear",
    '"(flux|dotInterpolate)\\(.*\\)"': "linear",
}


@pytest.fixture(scope="session")
def second_order(tmp_path_factory):
    """The default case with nothing but second-order schemes; studies copy it."""
    tmp_path = tmp_path_factory.mktemp("second-order")
    for part in ("0.orig", "constant", "system"):
        shutil.copytree(DEFAULT_CASE / part, tmp_path / part, ignore=shutil.ignore_patterns("polyMesh"))
    for name, scheme in LINEAR.items():
        set_entry(tmp_path / "system/fvSchemes", name, scheme)
    set_entry(tmp_path / "constant/fiberProperties", "interpolation", "trilinear")
    return tmp_path
