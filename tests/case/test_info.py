"""`gbm info`: the numbers that tell whether the model holds, against their definitions."""

from __future__ import annotations

import json

import numpy as np
import pytest

from gbm_plugin.case.info import figures
from gbm_plugin.case.scene import read_scene

from conftest import gbm, make_case, set_entry


@pytest.fixture
def path(tmp_path):
    families = "one { count 2; beads 20; length 2; bendingStiffness 1e-5; }"
    power = "linearForcing { type linearForcing; mode constantPower; power 0.0015; }"
    path = make_case(tmp_path / "case", cells=128, prepared=False, families=families, fv_options=power)
    set_entry(path / "constant/transportProperties", "nu", "0.001")
    return path


def test_flow_one_of_the_paper(path):
    """Flow I: eta = 0.0286 (table 1), and d/eta = 3.5 of its fibers, which are d = 0.1 wide."""
    result = figures(read_scene(path))
    family = result["families"]["one"]
    assert result["flow"]["kolmogorov_length"] == pytest.approx(0.0286, rel=2e-3)
    assert family["diameter"] == pytest.approx(0.1)
    assert family["diameter_over_eta"] == pytest.approx(3.5, rel=5e-3)
    assert family["persistence_length"] == pytest.approx(
        (1e-5) ** 0.25 / (1e-3 * 1.5e-3) ** 0.125
    )  # eq. (15)
    assert family["time_step_limit"] == pytest.approx(1e-3 * 0.1**4 / 1e-5)  # eq. (10)
    assert result["flow"]["cell_size"] == pytest.approx(2 * np.pi / 128)


def test_the_command_says_them(path, tmp_path):
    done = gbm("info", path, "--json", tmp_path / "figures.json")
    assert done.returncode == 0, done.stderr
    assert "kolmogorov length           0.028" in done.stdout
    assert json.loads((tmp_path / "figures.json").read_text())["families"]["one"]["sub_steps"] == 2


def test_a_bead_too_large_is_remarked(path):
    fibers = path / "constant/fiberProperties"
    fibers.write_text(fibers.read_text().replace("length 2", "length 8"))
    remarks = figures(read_scene(path))["families"]["one"]["remarks"]
    assert any("Kolmogorov lengths wide" in r for r in remarks)
    assert any("Stokes" in r for r in remarks)
