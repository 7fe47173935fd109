"""OpenFOAM's own utilities, and meshio, on the result of a run."""

from __future__ import annotations

from xml.etree import ElementTree

import meshio
import numpy as np
import pytest

from gbm_plugin.case.foamfile import read_list
from gbm_plugin.case.openfoam import utility
from gbm_plugin.case.scene import read_scene
from gbm_plugin.fleet.cloud import complete_clouds
from gbm_plugin.output.recording import open_recording
from gbm_plugin.report.paraview import line_mesh, polylines
from gbm_plugin.report.report import report

from conftest import make_case, run_case

pytestmark = pytest.mark.openfoam

FAMILIES = """
    soft { count 5; beads 6; length 1.2; bendingStiffness 1e-5; seed 3; }
    stiff { count 3; beads 4; radius 0.1; youngModulus 40; seed 4; }
"""


@pytest.fixture(scope="module")
def finished(tmp_path_factory):
    path = make_case(tmp_path_factory.mktemp("run") / "case", steps=10, write_every=5, families=FAMILIES)
    fibers = path / "constant/fiberProperties"
    fibers.write_text(fibers.read_text().replace("recordInterval 1;", "recordInterval 1; record (tension);"))
    run_case(path)
    return path


@pytest.fixture(scope="module")
def reported(finished):
    """What `gbm report` makes, but for its page."""
    report(finished)
    complete_clouds(read_scene(finished))
    return finished


@pytest.fixture(scope="module")
def recording(finished):
    with open_recording(finished / "postProcessing/fibers") as recording:
        yield recording


def last_positions(recording) -> np.ndarray:
    return np.concatenate([f.positions[-1].reshape(-1, 3) for f in recording.families.values()])


def in_fleets_order(labels) -> np.ndarray:
    """OpenFOAM keeps its beads as they lie in the box."""
    return np.lexsort([labels[name] for name in ("bead", "fiber", "family")])


def test_foam_to_vtk_shows_the_cloud_beside_the_flow(finished, recording):
    utility(finished, "foamToVTK", "-latestTime", "-ascii")
    assert list(finished.glob("VTK/*.vtm")) or list(finished.glob("VTK/**/internal.vtu"))
    cloud = ElementTree.parse(next(finished.glob("VTK/lagrangian/fibers/*.vtp")))
    arrays = {
        a.get("Name"): np.array(a.text.split(), dtype=float)
        for a in cloud.iter("DataArray")
        if a.text is not None
    }
    order = in_fleets_order(arrays)
    expected = np.mod(last_positions(recording), 2 * np.pi)
    np.testing.assert_allclose(arrays["Points"].reshape(-1, 3)[order], expected, atol=1e-5)
    np.testing.assert_array_equal(arrays["family"][order], [0] * 30 + [1] * 12)
    np.testing.assert_array_equal(
        arrays["fiber"][order], [i // 6 for i in range(30)] + [5 + i // 4 for i in range(12)]
    )
    np.testing.assert_array_equal(
        arrays["bead"][order], [i % 6 for i in range(30)] + [i % 4 for i in range(12)]
    )


def test_the_field_functions_of_post_process_run(finished):
    utility(finished, "postProcess", "-func", "components(U)", "-latestTime")
    assert (finished / "0.2/Ux").is_file()


def test_the_whole_list_of_function_objects_runs_in_post_processing(finished):
    """fiberCoupling is among them, and does not look for a daemon."""
    utility(finished, "postProcess", "-latestTime")


def test_report_and_fiber_series(reported, recording):
    for name in ("energy.png", "spectrum.png", "end_to_end.png", "fibers.png", "flow.csv", "report.json"):
        assert (reported / "report" / name).stat().st_size > 100
    assert (reported / "report/fibers_wrapped.pvd").is_file()
    pieces = len(list((reported / "report/unwrapped").glob("*.vtp")))
    assert pieces == len(recording.times)
    first, last = (line_mesh(recording, row, wrapped=False) for row in (0, pieces - 1))
    last.write(reported / "last.vtu")
    last = meshio.read(reported / "last.vtu")
    np.testing.assert_allclose(last.points, last_positions(recording), atol=1e-12)
    assert np.abs(last.points - first.points).max() > 0.01
    assert last.cells_dict["line"].shape == (5 * 5 + 3 * 3, 2)


def test_the_report_completes_the_cloud(reported, recording):
    """With what the series of polylines has, at all written times; the state at a time gives the recorded tension."""
    for name, row in (("0.1", 5), ("0.2", 10)):
        cloud = reported / name / "lagrangian/fibers"
        labels = {label: read_list(cloud / label) for label in ("family", "fiber", "bead")}
        order = in_fleets_order(labels)
        lines = polylines(recording, row, wrapped=False).point_data
        for field in ("curvature", "radius", "stiffness", "tension"):
            np.testing.assert_allclose(read_list(cloud / field)[order], lines[field], rtol=1e-9, atol=1e-12)
        for label, values in labels.items():
            np.testing.assert_array_equal(values[order], lines[label])
        if name == "0.1":
            velocity = read_list(cloud / "velocity")[order]
    central = np.concatenate(
        [(f.positions[6] - f.positions[4]).reshape(-1, 3) / (2 * 0.02) for f in recording.families.values()]
    )
    assert np.abs(velocity - central).max() < 2e-3 * np.abs(central).max()
    written = (reported / "0.1/lagrangian/fibers/stiffness").stat().st_mtime_ns
    assert complete_clouds(read_scene(reported)) == []  # once is enough
    assert (reported / "0.1/lagrangian/fibers/stiffness").stat().st_mtime_ns == written


def test_openfoam_reads_the_completed_cloud(reported):
    utility(reported, "foamToVTK", "-latestTime", "-ascii", "-overwrite")
    cloud = ElementTree.parse(next(reported.glob("VTK/lagrangian/fibers/*.vtp")))
    arrays = {a.get("Name"): np.array(a.text.split(), float) for a in cloud.iter("DataArray") if a.text}
    for field in ("curvature", "velocity", "radius", "stiffness", "tension"):
        there = read_list(reported / "0.2/lagrangian/fibers" / field).ravel()
        np.testing.assert_allclose(arrays[field], there, rtol=1e-5, atol=1e-12)


def test_the_recording_says_where_it_comes_from(finished, recording):
    assert recording.metadata["schema_version"] == 1
    assert recording.metadata["program_version"]
    assert "families" in recording.metadata["dictionaries"]["constant/fiberProperties"]
    soft, stiff = recording.families["soft"], recording.families["stiff"]
    assert (soft.seed, stiff.seed) == (3, 4)
    assert stiff.radius == pytest.approx(0.1)
    assert stiff.bending_stiffness == pytest.approx(40 * np.pi * 0.2**4 / 64)  # eq. (10)


def test_lengths_are_exact(recording):
    for family in recording.families.values():
        links = np.linalg.norm(np.diff(family.positions[:], axis=2), axis=-1)
        assert np.abs(links / (2 * family.radius) - 1).max() < 1e-12
