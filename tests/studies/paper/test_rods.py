"""Tumbling of rods that turn in a known way, and gradients of a stored field that is known."""

import shutil
from pathlib import Path

import numpy as np
import pytest

from gbm_plugin.case.initial import write_velocity
from gbm_plugin.case.mesh import read_box
from gbm_plugin.cli import main
from gbm_plugin.output.recording import FamilyRecord
from gbm_plugin.studies.fields import fields_of
from gbm_plugin.studies.paper import rods as study
from gbm_plugin.studies.recorded import FinishedRun, even_records

from known_runs import DISSIPATION, VISCOSITY, record_run, rods, unit

SHIPPED = Path(__file__).parents[3] / "openfoam_case"
RATE, CELLS = 0.7, 16
TIMES = np.arange(41) * 0.25
UNIT = VISCOSITY / DISSIPATION


def turning(axis_angle):
    """Rods that turn about z with RATE: in the plane, or from random directions."""
    random = np.random.default_rng(7)
    start = random.normal(size=(200, 3))
    if axis_angle:
        start[:, 2] = 0
    start = unit(start)

    def positions(time):
        c, s = np.cos(RATE * time), np.sin(RATE * time)
        p = start @ np.array([[c, s, 0], [-s, c, 0], [0, 0, 1]])
        return rods(p, 10, 0.01) + 0.3 * time

    return start, positions


@pytest.fixture(scope="module")
def case(tmp_path_factory):
    """Rods in the field of a periodic shear with a twist, u = (sin y, sin z, sin x + cos y)."""
    case = tmp_path_factory.mktemp("known") / "turning"
    flat, random = turning(True)[1], turning(False)[1]
    families = [
        (FamilyRecord("flat", 200, 10, 0.01, 1.0), flat),
        (FamilyRecord("random", 200, 10, 0.01, 1.0), random),
    ]
    record_run(case, families, TIMES)
    shutil.copytree(SHIPPED / "system", case / "system")
    block = case / "system/blockMeshDict"
    lines = [f"n {CELLS};" if line.startswith("n ") else line for line in block.read_text().splitlines()]
    block.write_text("\n".join(lines) + "\n")
    return case


def velocity(box):
    k = 2 * np.pi / box
    x = k * (np.arange(CELLS) + 0.5) * box / CELLS
    x, y, z = np.meshgrid(x, x, x, indexing="ij")
    return np.stack([np.sin(y), np.sin(z), np.sin(x) + np.cos(y)])


@pytest.fixture(scope="module")
def with_field(case):
    mesh = read_box(case)
    assert mesh.cells == (CELLS,) * 3
    write_velocity(SHIPPED / "0.orig/U", case / "2.6/U", velocity(mesh.size[0]))
    return case, mesh


def test_rates(case):
    result = study.run([case], since=0.0)
    flat, random = result["rows"]
    assert flat["tumbling_settled"] == pytest.approx(RATE**2 * UNIT, rel=1e-9)
    sine2 = (turning(False)[0][:, :2] ** 2).sum(axis=1).mean()
    assert random["tumbling_settled"] == pytest.approx(RATE**2 * sine2 * UNIT, rel=1e-3)
    # of the first records, with the dissipation of their time: a tenth above or below the mean
    first = flat["tumbling_first"] / (RATE**2 * UNIT)
    assert min(abs(first * 1.1 - 1), abs(first * 0.9 - 1)) < 0.02
    assert flat["tumbling_random_theory"] == pytest.approx(1 / 6 + (49.5 / 51.5) ** 2 / 10)  # r² = 101/2


def test_gradients_of_a_stored_field(with_field):
    case, mesh = with_field
    k = 2 * np.pi / mesh.size[0]
    with FinishedRun(case, since=0.0) as run:
        (field,) = fields_of(run, 5)
        assert field.time == pytest.approx(2.6)
        places = field.origin + np.random.default_rng(1).uniform(0, 1, (50, 3)) * field.box
        x, y, z = ((places - field.origin) * k).T
        expected = np.zeros((50, 3, 3))
        expected[:, 0, 1], expected[:, 1, 2] = np.cos(y), np.cos(z)
        expected[:, 2, 0], expected[:, 2, 1] = np.cos(x), -np.sin(y)
        np.testing.assert_allclose(field.gradient(places), k * expected, atol=2e-3 * k)
        assert field.dissipation == pytest.approx(VISCOSITY * k**2 * 2, rel=1e-6)  # ν<|∇u|²> = νk²·4/2
        exact = turning(False)[1](2.6)
        np.testing.assert_allclose(field.positions(run.families[1]), exact, atol=1e-5)


def test_random_rods_and_figure(with_field, tmp_path):
    """4/15 and 1/6 hold in any incompressible periodic flow."""
    case, _ = with_field
    found = study.run([case], since=0.0)["fields"]
    assert found[0]["rods"] == pytest.approx(4 / 15, rel=0.02)
    assert found[0]["spheres"] == pytest.approx(1 / 6, rel=0.02)
    assert main(["study", "rods", str(case), "--save", str(tmp_path / "r")]) == 0
    assert sorted(p.name for p in tmp_path.iterdir()) == ["r.csv", "r.json", "r.png"]


def test_a_restart_leaves_no_uneven_interval():
    steps = np.array([0, 9, 18, 20, 27, 36, 45])  # one more where a run went on at step 20
    assert even_records(steps).tolist() == [0, 1, 2, 4, 5, 6]
    assert even_records(np.array([7])).tolist() == [0]


def test_records_that_are_too_far_apart_are_refused(tmp_path):
    tau = np.sqrt(UNIT)
    family = (FamilyRecord("random", 20, 10, 0.01, 1.0), lambda t: turning(False)[1](t)[:20])
    record_run(tmp_path, [family], np.arange(5) * 1.3 * tau)
    with pytest.raises(ValueError, match=r"its records are 1\.3 Kolmogorov times apart"):
        study.run([tmp_path], since=0.0)
