"""`gbm new`: every preset is a case that reads, and says what it is."""

from __future__ import annotations

import pytest

from gbm_plugin.case.new import PRESETS, SHIPPED, new_case
from gbm_plugin.case.scene import read_scene
from gbm_plugin.cli import main
from gbm_plugin.errors import CaseError


@pytest.mark.parametrize("preset", PRESETS)
def test_every_preset_is_a_case(tmp_path, preset):
    case = new_case(tmp_path / "case", preset)
    scene = read_scene(case)
    assert scene.families and scene.cells and scene.end_time > scene.time_step
    assert {p.name for p in case.iterdir()} == {"0.orig", "constant", "system"}  # and nothing that a run left


def test_presets_have_their_own_numbers(tmp_path):
    flow = read_scene(new_case(tmp_path / "a", "flow-I"))
    assert flow.cells == (128, 128, 128) and flow.kinematic_viscosity == 1e-3
    assert flow.forcing.type == "eswaranPope" and flow.application == "boxFoam"
    assert read_scene(new_case(tmp_path / "c", "pimpleFoam")).application == "pimpleFoam"
    assert read_scene(new_case(tmp_path / "b", "taylor-green")).forcing is None
    two = read_scene(new_case(tmp_path / "two", "flow-II"))
    assert two.box == pytest.approx((4.1,) * 3) and max(f.length for f in two.families) < two.box[0] / 2
    assert (
        sum(f.count * f.beads for f in two.families) < 60_000
        and two.statistics.interval == two.record_interval
    )


def test_comments_and_everything_else_stay(tmp_path):
    case = new_case(tmp_path / "case", "quick")
    ours = (SHIPPED / "system/controlDict").read_text().splitlines()
    theirs = (case / "system/controlDict").read_text().splitlines()
    changed = [a for a, b in zip(ours, theirs, strict=True) if a != b]
    assert {line.split()[0] for line in changed} <= {"deltaT", "endTime", "writeInterval"}


def test_a_folder_that_is_there_and_a_preset_that_is_not(tmp_path, capsys):
    with pytest.raises(CaseError, match="is there already"):
        new_case(tmp_path)
    assert main(["new", str(tmp_path / "c"), "--preset", "flow-2"]) == 1
    assert (
        "allowed: default quick pimpleFoam flow-I flow-I-families flow-II-start flow-II flow-II-wide-start "
        "flow-II-wide taylor-green" in capsys.readouterr().err
    )
    assert not (tmp_path / "c").exists()


def test_without_a_name_the_presets_are_listed(capsys):
    assert main(["new"]) == 0
    listed = capsys.readouterr().out
    assert all(name in listed for name in PRESETS)
