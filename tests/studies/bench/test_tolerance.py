"""The study of the tolerance, with few runs: the error follows it, in flows at any time and at own times."""

import pytest

from gbm_plugin.studies.bench import tolerance


def test_the_error_follows_the_tolerance(monkeypatch):
    monkeypatch.setattr(tolerance, "STEPS", (0.5,))
    monkeypatch.setattr(tolerance, "TOLERANCES", (1e-3, 1e-5))
    chosen = ("Taylor-Green", "decaying, in the solver")
    monkeypatch.setattr(tolerance, "FLOWS", {name: tolerance.FLOWS[name] for name in chosen})
    monkeypatch.setattr(tolerance, "REFERENCE", 1e-6)
    result = tolerance.run(fibers=3, beads=5)
    loose, tight = tolerance.rows(result)[:2]
    assert tight["error"] < 0.1 * loose["error"] < 1e-3
    assert tight["samples"] > loose["samples"]
    assert tight["error"] == pytest.approx(tight["flow_error"], abs=30 * 1e-5)
    assert len(tolerance.table(result).splitlines()) == 3
