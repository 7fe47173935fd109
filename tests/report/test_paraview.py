import itertools
from pathlib import Path
from xml.etree import ElementTree

import meshio
import numpy as np
import pytest

from gbm_plugin.output.recording import FamilyRecord, Recorder, open_recording
from gbm_plugin.report.paraview import cut_at_faces, write_series
from gbm_plugin.statistics.fibers import curvature

from sample_records import BOX, FAMILIES, SCENE, records

STEPS = range(3, 12, 2)


@pytest.fixture(params=[False, True], ids=["unwrapped", "wrapped"])
def series(request, tmp_path, write):
    with open_recording(write(STEPS)) as recording:
        path = write_series(recording, tmp_path / "series", request.param)
    entries = ElementTree.parse(path).getroot().findall("Collection/DataSet")
    meshes = [meshio.read(path.parent / entry.get("file")) for entry in entries]
    return request.param, [float(entry.get("timestep")) for entry in entries], meshes


def test_every_time_is_there_and_points_move(series):
    _, times, meshes = series
    np.testing.assert_allclose(times, 0.1 * np.array(STEPS), atol=1e-12)
    for mesh in meshes:
        assert [block.type for block in mesh.cells] == ["line"]
        assert mesh.points.dtype == np.float64
    for one, other in itertools.pairwise(meshes):
        ends = [mesh.points[mesh.point_data["bead"] == 0] for mesh in (one, other)]
        assert np.linalg.norm(ends[0][:4] - ends[1][:4], axis=1).min() > 1e-3


def test_beads_are_where_they_were_recorded(series):
    wrapped, _, meshes = series
    for step, mesh in zip(STEPS, meshes, strict=True):
        data = mesh.point_data
        for number, (family, positions) in enumerate(zip(FAMILIES, records(step), strict=True)):
            bent = curvature(positions, family.radius)
            for fiber in range(family.count):
                for bead in range(family.beads):
                    at = (data["family"] == number) & (data["fiber"] == fiber) & (data["bead"] == bead)
                    assert at.sum() == 1
                    shift = (mesh.points[at][0] - positions[fiber, bead]) / BOX
                    boxes = np.round(shift) if wrapped else 0
                    np.testing.assert_allclose(shift, boxes, atol=1e-14)
                    expected = bent[fiber, np.clip(bead - 1, 0, family.beads - 3)]
                    assert data["curvature"][at][0] == pytest.approx(expected, rel=1e-12)


def test_lines_follow_the_fibers(series):
    """Each line joins neighbours of one fiber, and together they are as long as the fibers."""
    _, _, meshes = series
    expected = sum(family.count * (family.beads - 1) * 2 * family.radius for family in FAMILIES)
    for mesh in meshes:
        ends = mesh.cells[0].data
        lengths = np.linalg.norm(np.diff(mesh.points[ends], axis=1), axis=2)
        assert lengths.max() < 2 * max(family.radius for family in FAMILIES) * (1 + 1e-12)
        assert lengths.sum() == pytest.approx(expected, rel=1e-12)
        for name in ("family", "fiber"):
            values = mesh.point_data[name][ends]
            assert np.all(values[:, 0] == values[:, 1])
        bead = mesh.point_data["bead"][ends]
        assert np.all((bead[:, 1] > bead[:, 0]) & (bead[:, 1] - bead[:, 0] <= 1))


def test_wrapped_lines_lie_in_the_box(series):
    wrapped, _, meshes = series
    outside = [np.any((mesh.points < 0) | (mesh.points > BOX)) for mesh in meshes]
    assert any(outside) is not wrapped  # the fibers of this test do leave the box


def test_cut_through_an_edge_a_corner_and_several_boxes():
    """A straight line through corners and many boxes: pieces lie in the box, each a part of the same line."""
    direction = np.array([1.0, 1.0, 0.25])
    chain = np.array([[-0.6, -0.6, 0.1], [-0.6, -0.6, 0.1] + 5.3 * direction])[None]
    points, lines = cut_at_faces(chain, np.zeros(3), np.ones(3))
    pieces = points[lines]
    assert np.all((pieces >= 0) & (pieces <= 1))
    steps = np.diff(pieces, axis=1)[:, 0]
    np.testing.assert_allclose(steps.sum(axis=0), 5.3 * direction, atol=1e-12)
    np.testing.assert_allclose(np.cross(steps, direction), 0, atol=1e-12)


def test_beads_on_faces_and_another_origin():
    chain = np.array([[[1.0, 1.5, 1.5], [2.0, 1.5, 1.5], [3.0, 1.5, 1.5], [3.5, 1.5, 1.5]]])
    points, lines = cut_at_faces(chain, np.ones(3), np.ones(3))
    pieces = points[lines][..., 0]
    np.testing.assert_allclose(np.sort(pieces, axis=0), [[1, 1.5], [1, 2], [1, 2]], atol=1e-15)


def test_series_is_replaced_and_empty_or_two_bead_fibers_are_written(tmp_path):
    path = tmp_path / "fibers.h5"
    recorder = Recorder(path, [FamilyRecord("rods", 2, 2, 0.5, 1.0)], **SCENE)
    folder = tmp_path / "series"
    (folder / "wrapped").mkdir(parents=True)
    (folder / "wrapped" / "fibers_000099.vtu").write_text("of an older, longer run")
    with open_recording(path) as recording:
        assert Path(write_series(recording, folder, True)).exists()
    assert list((folder / "wrapped").iterdir()) == []
    recorder.append(0, 0.0, [np.array([[[0.0, 0, 0], [1, 0, 0]]] * 2)])
    with open_recording(path) as recording:
        write_series(recording, folder, True)
    assert np.all(meshio.read(folder / "wrapped" / "fibers_000000.vtu").point_data["curvature"] == 0)
