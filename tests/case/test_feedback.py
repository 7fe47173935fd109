"""A scene with feedback: what `gbm info` says of it, and what is refused."""

from __future__ import annotations

import math

import numpy as np
import pytest

from gbm_plugin.case.check import check_openfoam
from gbm_plugin.case.disk import needed
from gbm_plugin.case.feedback import exchange_step
from gbm_plugin.case.info import figures
from gbm_plugin.case.scene import read_scene
from gbm_plugin.errors import CaseError

from conftest import gbm, make_case, set_entry

CELL = 2 * np.pi / 16


def coupled(path, family, words="", **options):
    make_case(path, prepared=False, families=f"one {{ {family} bendingStiffness 1; }}", **options)
    properties = path / "constant/fiberProperties"
    properties.write_text(properties.read_text().replace("coupling {", f"coupling {{ feedback yes; {words}"))
    return path


def test_info_says_what_fibers_are_to_the_flow(tmp_path):
    path = coupled(tmp_path / "case", "count 100; beads 20; length 1;")
    scene = read_scene(path)
    family, a, n = figures(scene)["families"]["one"], 0.025, 100 / (2 * np.pi) ** 3
    assert family["own_disturbance"] == pytest.approx(a / (math.sqrt(math.pi) * CELL))
    assert family["own_disturbance_is"] == "kept"
    assert family["volume_fraction"] == pytest.approx(n * 20 * 4 / 3 * np.pi * a**3)
    assert family["added_viscosity_ratio"] == pytest.approx(2 * np.pi / 15 * n * a**3 * 20 * 399)
    nu = scene.kinematic_viscosity
    assert exchange_step(scene) == pytest.approx(6 * np.pi * nu * a * 20 * n * 0.02, rel=1e-6)
    told = " ".join(gbm("info", path).stdout.split())
    set_entry(path / "constant/fiberProperties", "coupling { feedback", "no")
    more = needed(scene)["time_folder"] - needed(read_scene(path))["time_folder"]
    assert more == 24 * 16**3 and "U, p, phi, fiberForce," in told
    assert "forces and torques of the beads" in told and "6 pi nu a n dt: stable to 0.5" in told


@pytest.mark.parametrize(("words", "is_"), [("", "removed"), ("ownDisturbance kept;", "kept")])
def test_own_disturbance_of_larger_beads_is_removed(tmp_path, words, is_):
    path = coupled(tmp_path / "case", "count 10; beads 10; length 1.5;", words)
    family = figures(read_scene(path))["families"]["one"]
    assert 0.05 < family["own_disturbance"] < 0.5
    assert family["own_disturbance_is"] == is_


def test_what_cannot_be_is_refused_in_one_line(tmp_path):
    path = coupled(tmp_path / "large", "count 10; beads 3; length 3;")
    with pytest.raises(
        CaseError, match=r"beads of family one are too large for the cells: radius 0.5 .* at most 0.5"
    ):
        read_scene(path)
    path = coupled(tmp_path / "many", "count 100000; beads 40; length 1;", time_step=0.2)
    with pytest.raises(
        CaseError, match=r"too many beads for deltaT 0.2: 6 pi nu a n deltaT is .* stable up to 0.5"
    ):
        read_scene(path)
    path = coupled(tmp_path / "word", "count 10; beads 20; length 1;", interpolation="cellPoint")
    with pytest.raises(CaseError, match="interpolation is cellPoint, whose weights OpenFOAM does not tell"):
        check_openfoam(read_scene(path))
    path = coupled(
        tmp_path / "solver", "count 10; beads 20; length 1;", application="icoFoam", fv_options="// none\n"
    )
    with pytest.raises(CaseError, match="icoFoam, which does not look at fvOptions: the fibers' feedback"):
        check_openfoam(read_scene(path))
    path = make_case(tmp_path / "alone", prepared=False)
    set_entry(path / "system/controlDict", "endTime", "1")
    properties = path / "constant/fiberProperties"
    properties.write_text(properties.read_text().replace("coupling {", "coupling { ownDisturbance kept;"))
    with pytest.raises(CaseError, match="'ownDisturbance' goes with feedback yes"):
        read_scene(path)
