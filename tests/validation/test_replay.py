"""The study of write intervals, on a small case."""

from __future__ import annotations

import pytest

from gbm_plugin.validation import replay

from conftest import DEFAULT_CASE


def test_distance_to_the_coupled_run_by_interval():
    """Every field: the run itself. Fewer: second order with linear interpolation in time, fourth with cubic."""
    result = replay.run(DEFAULT_CASE, [16], 0.02, steps=32, development=0.4)
    names = ("stiff_distance", "medium_distance", "soft_distance")
    for row in result["rows"]:
        if row["every"] == 1:
            assert max(row[n] for n in names) < 1e-12
    for order in result["orders"]:
        expected, slack = {"linear": (2, 0.3), "cubic": (4, 0.8)}[order["in_time"]]
        if order["every"][1] <= 8:
            for name in names:
                assert order[name] == pytest.approx(expected, abs=slack), replay.table(result)


@pytest.mark.parametrize("cells, steps", [([16, 32], 32), ([15], 32), ([16], 24)])
def test_bad_numbers_are_refused(cells, steps):
    with pytest.raises(ValueError, match=r"needed|allowed"):
        replay.run(DEFAULT_CASE, cells, steps=steps)
