"""The study of schemes, on what is known of three of its settings."""

from __future__ import annotations

import pytest

from gbm_plugin.studies.validate import schemes

from conftest import DEFAULT_CASE

pytestmark = pytest.mark.openfoam


@pytest.mark.exhaustive
def test_what_is_known_of_schemes():
    """Implicit Euler is of first order and two outer correctors do not cure it; values averaged to
    the points of the mesh first carry beads worse than those of the cells, and leave the flow as it is."""
    result = schemes.run(DEFAULT_CASE, [12], 0.3, ["the case", "Euler", "fibers cellPoint"])
    rows = {(r["setting"], round(r["time_step"], 9)): r for r in result["rows"]}
    case, euler, points = (rows[name, 0.15] for name in ("the case", "Euler", "fibers cellPoint"))
    assert euler["velocity_in_time"] > 1.5 * case["velocity_in_time"]
    assert euler["fiber_in_time"] > 1.2 * case["fiber_in_time"]
    assert points["velocity_error"] == case["velocity_error"]
    assert points["fiber_error"] > 1.2 * case["fiber_error"]
    assert "velocity_in_time" not in points
    order = {o["setting"]: o["velocity_in_time"] for o in result["orders"]}
    assert 0.6 < order["Euler"] < 1.2
    share = (case["processor_seconds"] / rows["the case", 0.3]["processor_seconds"]) ** 0.5
    assert case["velocity_at_equal_cost"] == pytest.approx(share * case["velocity_error"])
    lines = schemes.table(result).splitlines()
    best = min(result["rows"], key=lambda r: r["velocity_at_equal_cost"])
    assert best["setting"] in lines[2] and f"{best['velocity_error']:.3e}" in lines[2]


def test_bad_input_is_named():
    with pytest.raises(ValueError, match="there is no setting 'Eular'"):
        schemes.run(DEFAULT_CASE, settings=["Eular"])
    with pytest.raises(ValueError, match=r"cells are \(7,\)"):
        schemes.run(DEFAULT_CASE, [7])
