"""The study of buckling in cellular flow: its contract, its restart, its bad input."""

import json
import os
import signal
import subprocess
import sys
import time

import numpy as np
import pytest

from gbm_plugin.cli import main
from gbm_plugin.studies.paper import buckling
from gbm_plugin.studies.taylor_green import Run, Scene, run_scenes

SMALL = ["--count", "40", "--end", "15", "--time-step", "0.05"]


def test_command_line(tmp_path, monkeypatch, capsys):
    """What a stiff and a soft fiber must do: none below the first threshold of the chain, most far above it."""
    monkeypatch.chdir(tmp_path)
    argv = ["study", "buckling", "--sp", "2", "1e4", *SMALL, "--workers", "1", "--json", "f.json"]
    assert main([*argv, "--figure", "f.png", "--csv", "f.csv"]) == 0
    stiff, soft = json.loads((tmp_path / "f.json").read_text())["rows"]
    assert stiff["events"] == 0 and stiff["probability"] == 0
    assert soft["probability"] == soft["events"] / soft["tracks"] > 0.2
    assert 0 < soft["standard_error"] < 0.3
    assert (tmp_path / "f.png").stat().st_size > 0
    assert not (tmp_path / "buckling.state").exists()
    assert "1e+04" in capsys.readouterr().out


def test_slices_and_restarts_change_nothing(tmp_path):
    """To the last bit: saved in the middle of a track, and moved by other processes."""
    scenes = [Scene(sp, count=24, time_step=0.05) for sp in (5.0, 1e4)]
    for scene, moved in zip(scenes, run_scenes(scenes, 4.0, tmp_path / "b", workers=2), strict=True):
        whole = Run(scene)
        whole.advance(2.0)
        whole.save(tmp_path / "a")
        whole.advance(4.0)
        cut = Run.load(scene, tmp_path / "a")
        cut.advance(4.0)
        for tracks, others in zip(whole.tracks.values(), cut.tracks.values(), strict=True):
            np.testing.assert_array_equal(tracks.tracks, others.tracks)
            np.testing.assert_array_equal(tracks.events, others.events)
        np.testing.assert_array_equal(whole.stepper.positions, cut.stepper.positions)
        np.testing.assert_allclose(whole.stepper.positions, moved.stepper.positions, atol=1e-6)


@pytest.mark.exhaustive  # the slices above have what a kill leaves
def test_goes_on_after_a_kill(tmp_path):
    """SIGKILL in the middle; the same command then ends with what an undisturbed one finds."""
    argv = [sys.executable, "-m", "gbm_plugin.cli", "study", "buckling", "--sp", "1e4", "--json", "f.json"]
    argv += ["--count", "8", "--end", "60", "--time-step", "0.1", "--state"]
    process = subprocess.Popen([*argv, "killed"], cwd=tmp_path)
    while not list(tmp_path.glob("killed/*.npz")):
        assert process.poll() is None
        time.sleep(0.01)
    os.kill(process.pid, signal.SIGKILL)
    process.wait()
    assert not (tmp_path / "f.json").exists()
    found = []
    for state in ("killed", "whole"):
        subprocess.run([*argv, state], cwd=tmp_path, check=True, capture_output=True)
        row = json.loads((tmp_path / "f.json").read_text())["rows"][0]
        found.append({name: value for name, value in row.items() if name != "seconds"})
    assert found[0] == found[1]


def test_starts_are_straight_and_uniform():
    random = np.random.default_rng(0)
    beads = Scene(1.0).positions(4000, random)
    ends = beads[:, -1] - beads[:, 0]
    assert np.abs(beads[..., 2]).max() == 0
    np.testing.assert_allclose(np.linalg.norm(ends, axis=1), 0.4 * 5 / 6)
    assert abs(beads.mean(axis=(0, 1))[:2] - 1).max() < 0.05
    tilted = Scene(1.0, tilt=30.0).positions(10, random)
    np.testing.assert_allclose((tilted[:, -1] - tilted[:, 0])[:, 2], 0.5 * 0.4 * 5 / 6)
    rise = Scene(1.0, start="isotropic").positions(4000, random)
    assert np.mean((rise[:, -1] - rise[:, 0])[:, 2] ** 2) == pytest.approx((0.4 * 5 / 6) ** 2 / 3, rel=0.05)


def test_replaced_fibers(tmp_path):
    """With reseed no fiber stays without a region."""
    scenes = [Scene(1e4, count=40, time_step=0.05, reseed=10.0, seed=s) for s in (1,)]
    (run,) = run_scenes(scenes, 50.0, tmp_path)
    assert run.reseeded.sum() > 0
    assert np.isfinite(run.stepper.positions).all()


def test_slender_body_number():
    """8π/6.33 for ε = 1/12 and 8π/9.73... for 1/6 as DESIGN's numbers have it: c = −ln(ε²e)."""
    assert 8 * np.pi / buckling.slender_body_number(1.0, 1 / 12) == pytest.approx(np.log(144) - 1)


@pytest.mark.parametrize(
    "argv, text",
    [
        (["--sp", "-3"], "Sperm number is -3"),
        (["--sp", "nan"], "Sperm number is nan"),
        (["--count", "0"], "count is 0"),
        (["--beads", "2"], "beads is 2"),
        (["--end", "-1"], "end is -1"),
    ],
)
def test_bad_input(argv, text, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    assert main(["study", "buckling", *argv]) == 1
    assert text in capsys.readouterr().err
