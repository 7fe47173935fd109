"""The study of estimates, small: a case of each engine cut and run, with both times of it. How near they are is not
for a test, which shares its machine."""

import pytest

from gbm_plugin.studies.bench import estimate


@pytest.mark.openfoam
@pytest.mark.filterwarnings("ignore:the Courant number")
def test_both_engines_are_estimated_and_timed(monkeypatch):
    monkeypatch.setattr(estimate, "machine", lambda: 1.0)
    result = estimate.run(("quick",), mobilities=("rpy",), seconds=0.5)
    openfoam, spectral = estimate.rows(result)
    assert (openfoam["flow"], spectral["flow"]) == estimate.FLOWS
    for row in (openfoam, spectral):
        assert estimate.LEAST < row["steps"] < 100 and row["mobility"] == "rpy"
        assert all(row[name] > 0 and row[f"{name}_estimated"] > 0 for name in ("step", "wall"))
    assert openfoam["daemon"] > 0 and "daemon" not in spectral
    assert spectral["step_estimated"] > openfoam["daemon_estimated"]  # with its fibers
    lines = estimate.table(result).splitlines()
    assert len({len(line) for line in lines[2:]}) == 1
