"""Fibers in one flow at two resolutions, where the difference is known."""

from __future__ import annotations

import numpy as np
import pytest

from gbm_plugin.output.recording import FamilyRecord
from gbm_plugin.studies.paper import resolution

from known_runs import record_run, rods, unit

COUNT, BEADS, RADIUS = 30, 5, 0.1
TIMES = np.arange(60) * 0.5


def turning(rate, noise):
    """Rods that turn in a plane at this rate [1/s], and chains bent by random angles of this size."""
    random = np.random.default_rng(2)
    phase = random.uniform(0, 2 * np.pi, COUNT)
    record = FamilyRecord("rods", COUNT, BEADS, RADIUS, 1.0)
    bent = FamilyRecord("bent", COUNT, BEADS, RADIUS, 1e-3)

    def straight(time):
        angle = phase + rate * time
        return rods(np.stack([np.cos(angle), np.sin(angle), 0 * angle], axis=-1), BEADS, RADIUS)

    def chains(time):
        links = unit(np.array([1.0, 0, 0]) + noise * random.normal(size=(COUNT, BEADS - 1, 3)))
        steps = np.cumsum(2 * RADIUS * links, axis=1)
        return np.concatenate([np.zeros((COUNT, 1, 3)), steps], axis=1)

    return [(record, straight), (bent, chains)]


@pytest.fixture(scope="module")
def cases(tmp_path_factory):
    folder = tmp_path_factory.mktemp("two")
    return [
        record_run(folder / "coarse", turning(0.11, 0.4), TIMES[:50]),
        record_run(folder / "fine", turning(0.10, 0.3), TIMES[10:]),
    ]


def test_differences_are_those_that_were_made(cases):
    result = resolution.run(cases, since=0.0)
    assert [(r["from"], r["to"], r["records"]) for r in result["runs"]] == [(5, 24.5, 40)] * 2
    rows = {(r["run"], r["family"], r["quantity"]): r for r in result["rows"]}
    one, two = rows["coarse", "rods", "tumbling"], rows["fine", "rods", "tumbling"]
    scale = [r["dissipation"] for r in result["runs"]]  # τ² is ν/ε
    assert one["average"] * scale[0] / (two["average"] * scale[1]) == pytest.approx(1.21, rel=1e-6)
    assert one["difference"] == pytest.approx(one["average"] - two["average"])
    bent = rows["coarse", "bent", "curvature"]
    assert bent["difference"] > 10 * bent["difference_error"] > 0
    assert "difference" not in rows["fine", "bent", "curvature"] and ("fine", "bent", "tumbling") not in rows
    assert "differences over their errors" in resolution.table(result) and resolution.draw(result)


def test_runs_that_cannot_be_compared_are_refused(cases, tmp_path):
    with pytest.raises(ValueError, match="two runs"):
        resolution.run(cases[:1])
    with pytest.raises(ValueError, match="0 times of records in common"):
        resolution.run([cases[0], record_run(tmp_path / "late", turning(0.1, 0.3), TIMES + 0.1)])
    other = record_run(tmp_path / "other", turning(0.1, 0.3)[:1], TIMES)
    with pytest.raises(ValueError, match="not the same families"):
        resolution.run([cases[0], other])
