"""Densities and slopes of rods and Gaussian coils, which are known."""

import numpy as np
import pytest

from gbm_plugin.output.recording import FamilyRecord
from gbm_plugin.studies.paper import end_to_end

from known_runs import record_run, rods, unit

TIMES = np.arange(30) * 0.5
COUNT = 100


def rod(random, length):
    record = FamilyRecord(f"rod{length:g}", COUNT, 10, length / 20, 1.0)
    return record, lambda time: rods(unit(random.normal(size=(COUNT, 3))), 10, record.radius)


def coil(random, beads):
    """A random walk with links of 0.05."""
    record = FamilyRecord(f"coil{beads}", COUNT, beads, 0.025, 1e-5)

    def positions(time):
        links = 0.05 * unit(random.normal(size=(COUNT, beads - 1, 3)))
        return np.concatenate([np.zeros((COUNT, 1, 3)), np.cumsum(links, axis=1)], axis=1)

    return record, positions


@pytest.fixture(scope="module")
def case(tmp_path_factory):
    random = np.random.default_rng(6)
    families = [rod(random, n) for n in (0.5, 1.0, 2.0)] + [coil(random, n) for n in (80, 160, 320)]
    return record_run(tmp_path_factory.mktemp("known") / "mixed", families, TIMES)


@pytest.fixture(scope="module")
def result(case):
    return end_to_end.run([case], since=0.0)


def test_goodness_tells_rods_from_coils(result):
    for row in result["rows"]:
        own, other = ("rigid", "coil") if row["family"].startswith("rod") else ("coil", "rigid")
        assert row[f"D_{own}"] < 0.03 < 0.2 < row[f"D_{other}"]
        assert row["projections_differ_by"] < 0.1


def test_sizes(result):
    """R²/R_g² is 12 (N−1)/(N+1) of rods and 6 (N−1) N/(N² − 1) of random walks."""
    for row in result["rows"]:
        n = row["beads"]
        if row["family"].startswith("rod"):
            assert row["R2_over_contour2"] == pytest.approx(1, abs=1e-12)
            assert row["gyration_over_rod"] == pytest.approx(1, abs=1e-12)
            assert row["R2_over_Rg2"] == pytest.approx(12 * (n - 1) / (n + 1), rel=1e-12)
        else:
            assert row["R2_over_Rg2"] == pytest.approx(6 * n / (n + 1), rel=0.05)
            assert abs(row["R2_over_contour2"] * (n - 1) - 1) < 4 * row["standard_error"] * (n - 1)
            assert row["gyration_over_coil"] == pytest.approx((n + 1) / n, rel=0.05)


def test_slopes(result):
    slopes = {s["slope_of"]: s for s in result["slopes"]}
    assert slopes["K^b = 1"]["slope"] == pytest.approx(2, abs=1e-9)
    assert slopes["K^b = 1e-05"]["slope"] == pytest.approx(1, abs=0.05)
    assert slopes["K^b = 1e-05"]["error"] < 0.05
