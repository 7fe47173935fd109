"""The parts of the study of accuracy, small: what theory says of each must be seen in its rows."""

import pytest

from gbm_plugin.studies.accuracy import front, integrators


def test_front():
    rows = [
        {"seconds": 1.0, "error": 1e-2},
        {"seconds": 2.0, "error": 1e-3},
        {"seconds": 2.1, "error": 1e-2},
        {"seconds": 2.1, "error": 9e-4},
    ]
    front.mark_front(rows)
    assert [row["on_front"] for row in rows] == [True, True, False, True]


def test_ab3_and_extrapolation_are_of_third_order(monkeypatch):
    monkeypatch.setattr(integrators, "REGIMES", {"flexible": (0.3, 5, 8)})
    monkeypatch.setattr(integrators, "TOLERANCES", (1e-3,))
    rows = integrators._regime(integrators.cellular(), "freeDrain", "flexible", (0.1, 0.05), 1.0, 1e8)
    errors = [row["error"] for row in rows if row["integrator"] == "ab3"]
    assert errors[0] / errors[1] == pytest.approx(2**3, rel=0.25)
    assert all(row["microseconds"] > 0 for row in rows)
