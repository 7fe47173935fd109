"""The driver of flows that are sampled in this process, with flows made for the purpose."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from gbm_plugin.case.layout import time_folders
from gbm_plugin.case.scene import read_scene
from gbm_plugin.case.times import Start
from gbm_plugin.errors import PredictionError
from gbm_plugin.run.driver import Carrier, Run, results_folder

from conftest import make_case, set_entry

STEP = 0.02


class Wind(Carrier):
    """A uniform velocity along x that is `after` from some step on, and 1 before."""

    def __init__(self, step, after):
        self.step, self.after = step, after

    def sample(self, positions, time, need):
        velocity = np.zeros(positions.shape)
        velocity[:, 0] = self.after if time > (self.step - 0.5) * STEP else 1.0
        return velocity, np.zeros(positions.shape)

    def on_cells(self, time):
        return np.zeros((3, 16, 16, 16))


def run(tmp_path, wind, purge=0, **options):
    case = make_case(tmp_path / "case", steps=10, time_step=STEP, prepared=False, **options)
    set_entry(case / "system/controlDict", "purgeWrite", str(purge))
    scene = read_scene(case)
    folder = results_folder(scene.case, "wind")
    return Run(replace(scene, case=folder), wind, Start(0.0, False))


def test_fibers_go_with_a_uniform_wind(tmp_path):
    drive = run(tmp_path, Wind(99, 1.0))
    before = drive.fleet.positions
    assert drive.to_the_end()
    np.testing.assert_allclose(
        drive.fleet.positions - before, np.tile([10 * STEP, 0, 0], (len(before), 1)), atol=1e-13
    )
    assert (tmp_path / "case/wind/0.2/uniform/fibers.npz").is_file()


@pytest.mark.parametrize("purge, left", [(0, [0.04, 0.08, 0.12, 0.16, 0.2]), (2, [0.16, 0.2])])
def test_purge_write_leaves_the_newest(tmp_path, purge, left):
    drive = run(tmp_path, Wind(99, 1.0), purge, write_every=2)
    other = drive.scene.case / "0.05"  # of somebody else
    other.mkdir()
    assert drive.to_the_end()
    assert sorted(time_folders(drive.scene.case)) == sorted([0.05, *left])


def test_a_flow_that_jumps_is_refused_at_its_step(tmp_path):
    with pytest.raises(
        PredictionError, match=r"^step 7: the flow at a fiber was predicted with an error of 4 m/s"
    ):
        run(tmp_path, Wind(7, -3.0)).to_the_end()


def test_a_flow_that_is_not_finite_is_refused_at_its_step(tmp_path):
    with pytest.raises(
        FloatingPointError, match=r"sampled velocity is not finite at fiber 0, time 0\.14, after step 7"
    ):
        run(tmp_path, Wind(7, np.nan)).to_the_end()


def test_results_open_in_paraview_by_their_name(tmp_path):
    folder = results_folder(tmp_path, "spectral")
    assert (folder / "spectral.foam").is_file()
    assert (folder / "constant").is_symlink() and (folder / "system").is_symlink()
