"""The stationary study in small: too coarse to agree, but every number is a known one or has a known sign."""

from __future__ import annotations

import numpy as np
import pytest

from gbm_plugin.studies.validate import stationary

from conftest import DEFAULT_CASE

pytestmark = pytest.mark.openfoam

POWER = 0.05


@pytest.fixture(scope="module")
def result(tmp_path_factory, pimple_case):
    folder, turnovers = tmp_path_factory.mktemp("stationary"), 12
    jobs = [("openfoam", 12, 0.2), ("spectral", 16, 0.1)]
    results = {job: stationary.solve(pimple_case, folder, *job, turnovers, fibers=2) for job in jobs}
    return stationary.compare(results, turnovers)


def test_energy_balance_of_both_engines(result):
    rows = {row["quantity"]: row for row in result["rows"]}
    for run in ("pimpleFoam 12", "spectral 16"):
        budget = rows["eps budget"]
        assert abs(budget[run] - POWER) < 4 * budget[f"{run} error"] + 0.01 * POWER
    # the spectral solver loses nothing to its scheme; finite volumes do, and read too little of gradients
    lost = rows["numerical dissipation / eps"]
    assert abs(lost["spectral 16"]) < 0.01 < lost["pimpleFoam 12"] < 0.5
    assert rows["eps gradient"]["pimpleFoam 12"] < 0.9 * rows["eps laplacian"]["pimpleFoam 12"]
    assert rows["eps spectrum"]["spectral 16"] == pytest.approx(rows["eps gradient"]["spectral 16"], rel=0.03)


def test_curves_are_whole(result):
    for run in result["runs"]:
        for curve in run["curvature"].values():
            assert 0.95 < np.sum(np.diff(curve["edges"]) * curve["mean"]) <= 1 + 1e-12
        spectrum = run["spectrum"]
        assert sum(spectrum["mean"]) == pytest.approx(run["numbers"]["k"][0], rel=0.05)  # shells of width 1
    assert "pimpleFoam 12" in stationary.table(result) and stationary.draw(result) is not None


def test_boxfoam_beside_an_earlier_result_loses_nothing_to_its_scheme(tmp_path, result):
    job = ("openfoam", 12, 0.15)
    found = {job: stationary.solve(DEFAULT_CASE, tmp_path, *job, 12, fibers=2)}
    both = stationary.compare(found, 12, result["runs"])
    rows = {row["quantity"]: row for row in both["rows"]}
    assert abs(rows["numerical dissipation / eps"]["boxFoam 12"]) < 0.01
    budget = rows["eps budget"]
    assert abs(budget["boxFoam 12"] - POWER) < 4 * budget["boxFoam 12 error"] + 0.01 * POWER
    for run in ("pimpleFoam 12", "spectral 16"):  # as they were
        assert [r[run] for r in both["rows"]] == [r[run] for r in result["rows"]]


def test_short_runs_are_refused():
    with pytest.raises(ValueError, match="at least are needed"):
        stationary.run(DEFAULT_CASE, turnovers=5)
