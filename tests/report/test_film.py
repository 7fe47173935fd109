"""Frames of a film, and a film where there is something to make it with."""

import shutil

import numpy as np
import pytest

from gbm_plugin.cli import main
from gbm_plugin.output.recording import FamilyRecord

from known_runs import record_run, rods, unit


@pytest.fixture(scope="module")
def case(tmp_path_factory):
    direction = unit(np.random.default_rng(2).normal(size=(5, 3)))
    families = [
        (FamilyRecord(name, 5, 6, 0.1, 1e-3), lambda time: rods(direction, 6, 0.1) + 0.5 * time)
        for name in ("soft", "hard")
    ]
    return record_run(tmp_path_factory.mktemp("film") / "case", families, np.arange(9) * 0.5)


def test_frames(case, capsys):
    """As many as asked for, of the chosen families; earlier ones go; the clock of the last is the last record's."""
    folder = case / "report/film"
    folder.mkdir(parents=True)
    (folder / "frame_0099.png").touch()
    argv = ["report", str(case), "--film", "--frames", "2", "--families", "so*", "--fibers", "3"]
    assert main([*argv, "--from", "1"]) == 0
    frames = sorted(folder.iterdir())
    assert [p.name for p in frames] == ["frame_0000.png", "frame_0001.png"]
    assert all(p.read_bytes().startswith(b"\x89PNG") for p in frames)
    assert frames[0].read_bytes() != frames[1].read_bytes()
    assert (case / "report/film.mp4").is_file() == bool(shutil.which("ffmpeg"))
    assert "2 frames in" in capsys.readouterr().out


@pytest.mark.parametrize(
    ("words", "said"),
    [(["--families", "none"], "no family is named none"), (["--from", "100"], "no record from t = 100 on")],
)
def test_nothing_to_show(case, capsys, words, said):
    assert main(["report", str(case), "--film", *words]) == 1
    assert said in capsys.readouterr().err
