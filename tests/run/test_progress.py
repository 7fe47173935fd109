"""The line of a run where there is no terminal."""

import logging
from types import SimpleNamespace

import pytest

from gbm_plugin.run import progress


@pytest.mark.parametrize(
    ("families", "words"),
    [(2, "⟨R²⟩/L² f0 0.500 f1 0.600"), (30, "⟨R²⟩/L² 0.500 to 3.400 in 30 families")],
)
def test_a_line_stays_short_with_many_families(tmp_path, caplog, monkeypatch, families, words):
    monkeypatch.setattr(progress, "QUIET", 0.0)
    table = tmp_path / "postProcessing/fibers/0/daemon.dat"
    table.parent.mkdir(parents=True)
    names = "\t".join(f"R2_f{i}" for i in range(families))
    values = "\t".join(f"{0.5 + 0.1 * i:.3f}" for i in range(families))
    table.write_text(f"# Time\tstep\t{names}\n0.5\t7\t{values}\n")
    scene = SimpleNamespace(case=tmp_path, end_time=2.0, forcing=None)
    with caplog.at_level(logging.INFO), progress.Progress(scene, 0.0) as shown:
        shown.update()
    assert caplog.messages == [f"t = 0.5 of 2 s  {words}"]
