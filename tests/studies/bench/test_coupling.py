"""`gbm study coupling` on real processes: what it says of the runs that it makes."""

from __future__ import annotations

import json

import pytest

from conftest import DEFAULT_CASE, gbm

pytestmark = pytest.mark.openfoam


@pytest.mark.parametrize("ranks, daemons", [pytest.param(1, 1, marks=pytest.mark.exhaustive), (2, 2)])
def test_shares_of_a_step(tmp_path, ranks, daemons):
    file = tmp_path / "bench.json"
    sizes = ("--cells", 24, "--fibers", 6, "--beads", 5, "--steps", 9, "--ranks", ranks, "--daemons", daemons)
    done = gbm("study", "coupling", DEFAULT_CASE, *sizes, "--json", file)
    assert done.returncode == 0, done.stderr
    result = json.loads(file.read_text())
    parts = [result[name] for name in ("wait", "location", "sampling", "sending")]
    assert all(part > 0 for part in parts) and sum(parts) < result["step"]
    assert result["share"] == pytest.approx(result["held"] / result["step"])
    assert result["daemon"] > 0 and (result["ranks"], result["daemons"]) == (ranks, daemons)
    assert (result["positions_bytes"], result["sample_bytes"]) == (24 * 30, 48 * 30)
    assert f"{ranks} rank(s), {daemons} daemon(s)" in done.stdout
