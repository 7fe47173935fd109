"""The sentences of section 3 beside the committed results."""

import csv
from pathlib import Path

import pytest

from gbm_plugin.studies.paper import buckling_claims

RESULTS = Path(__file__).parents[3] / "docs/results/buckling"


def test_every_claim_has_a_verdict():
    result = buckling_claims.run(RESULTS)
    verdicts = {row["claim"]: row["agrees"] for row in result["rows"]}
    assert len(verdicts) == len(result["rows"]) >= 9
    assert all(verdicts.values())
    (range_,) = [v for claim, v in verdicts.items() if "eight decades" in claim]
    assert range_ in ("yes", "no")
    assert buckling_claims.table(result).count("\n") == len(verdicts) + 1


def test_committed_curve_is_consistent():
    """Counts, P and threshold of what is published agree with each other."""
    with open(RESULTS / "curve.csv", newline="") as file:
        curve = list(csv.DictReader(file))
    assert len(curve) >= 25
    for row in curve:
        assert float(row["probability"]) == pytest.approx(int(row["events"]) / int(row["tracks"]))
        if (
            float(row["sperm_number"]) < 16.7
        ):  # of the chain in the strongest compression: buckling-thresholds
            assert int(row["events"]) == 0


def test_missing_files_are_named(tmp_path):
    with pytest.raises(OSError, match=r"curve\.csv"):
        buckling_claims.run(tmp_path)
