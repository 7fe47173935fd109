"""The study of write intervals, on a small case."""

from __future__ import annotations

import numpy as np
import pytest

from gbm_plugin.studies.validate import replay

from conftest import DEFAULT_CASE

pytestmark = pytest.mark.openfoam


def test_distance_to_the_coupled_run_by_interval():
    """Every field: the run itself. Every k-th: the mean of the error over the steps between two fields, of which
    those at a field have none, times the second or fourth power of the interval."""
    result = replay.run(DEFAULT_CASE, [20], 0.05, steps=32, development=1.6, fibers=15)
    rows = {(row["in_time"], row["every"]): row for row in result["rows"]}
    for in_time, error, power, pairs, slack in (
        ("linear", lambda s: s * (1 - s), 2, [(2, 4), (4, 8)], 0.1),
        # between fewer steps OpenFOAM's own roughness in time is larger
        ("cubic", lambda s: (1 + s) * s * (1 - s) * (2 - s), 4, [(4, 8)], 0.5),
    ):
        mean = {k: k**power * error(np.arange(k) / k).mean() for k in (2, 4, 8)}
        for name in ("stiff_distance", "medium_distance", "soft_distance"):
            assert rows[in_time, 1][name] < 1e-12
            for fine, coarse in pairs:
                found = np.log2(rows[in_time, coarse][name] / rows[in_time, fine][name])
                expected = np.log2(mean[coarse] / mean[fine])
                assert found == pytest.approx(expected, abs=slack), replay.table(result)


@pytest.mark.parametrize("cells, steps", [([16, 32], 32), ([15], 32), ([16], 24)])
def test_bad_numbers_are_refused(cells, steps):
    with pytest.raises(ValueError, match=r"needed|allowed"):
        replay.run(DEFAULT_CASE, cells, steps=steps)
