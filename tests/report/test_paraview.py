import base64
import itertools
from dataclasses import dataclass
from pathlib import Path
from xml.etree import ElementTree

import meshio
import numpy as np
import pytest

from gbm_plugin import Fibers, simulate
from gbm_plugin.flow import LinearFlow
from gbm_plugin.output.recording import FamilyRecord, Recorder, open_recording
from gbm_plugin.report.paraview import _of_trajectories, cut_at_faces, line_mesh, polylines, write_series
from gbm_plugin.statistics.fibers import curvature

from sample_records import BOX, FAMILIES, SCENE, records

STEPS = range(3, 12, 2)
TYPES = {"Float64": "<f8", "Int32": "<i4", "Int64": "<i8"}


@dataclass
class Lines:
    """A .vtp as it stands in the file."""

    points: np.ndarray
    offsets: np.ndarray
    point_data: dict
    line_data: dict

    def segments(self):
        """Pairs of points that a line joins."""
        ranges = itertools.pairwise([0, *self.offsets])
        return np.array([(i, i + 1) for start, end in ranges for i in range(start, end - 1)])


def read_vtp(path) -> Lines:
    """Read by the format's own rules: base64, a length in 8 bytes, little endian."""
    piece = ElementTree.parse(path).getroot().find("PolyData/Piece")
    found = {}
    for section in piece:
        found[section.tag] = {}
        for array in section:
            data = base64.b64decode(array.text)
            assert int.from_bytes(data[:8], "little") == len(data) - 8
            values = np.frombuffer(data[8:], TYPES[array.get("type")])
            components = int(array.get("NumberOfComponents", 1))
            found[section.tag][array.get("Name")] = (
                values.reshape(-1, components) if components > 1 else values
            )
    points = found["Points"]["Points"].reshape(-1, 3)
    assert len(points) == int(piece.get("NumberOfPoints"))
    assert len(found["Lines"]["offsets"]) == int(piece.get("NumberOfLines"))
    np.testing.assert_array_equal(found["Lines"]["connectivity"], np.arange(len(points)))
    return Lines(points, found["Lines"]["offsets"], found["PointData"], found["CellData"])


@pytest.fixture(params=[False, True], ids=["unwrapped", "wrapped"])
def series(request, tmp_path, write):
    with open_recording(write(STEPS)) as recording:
        path = write_series(recording, tmp_path / "series", request.param)
    entries = ElementTree.parse(path).getroot().findall("Collection/DataSet")
    meshes = [read_vtp(path.parent / entry.get("file")) for entry in entries]
    return request.param, [float(entry.get("timestep")) for entry in entries], meshes


def test_every_time_is_there_and_points_move(series):
    _, times, meshes = series
    np.testing.assert_allclose(times, 0.1 * np.array(STEPS), atol=1e-12)
    for one, other in itertools.pairwise(meshes):
        ends = [mesh.points[mesh.point_data["bead"] == 0] for mesh in (one, other)]
        assert np.linalg.norm(ends[0][:4] - ends[1][:4], axis=1).min() > 1e-3


def test_whole_fibers_are_one_line_each(series):
    wrapped, _, meshes = series
    count = sum(family.count for family in FAMILIES)
    for mesh in meshes:
        assert len(mesh.offsets) >= count if wrapped else len(mesh.offsets) == count
        assert set(mesh.line_data["fiber"]) == set(range(count))
        for name in ("family", "fiber"):  # a line's number is that of all its points
            lengths = np.diff([0, *mesh.offsets])
            np.testing.assert_array_equal(np.repeat(mesh.line_data[name], lengths), mesh.point_data[name])


def test_radius_stiffness_and_velocity(series):
    _, times, meshes = series
    firsts = np.cumsum([0, *(family.count for family in FAMILIES)])
    for number, (step, mesh) in enumerate(zip(STEPS, meshes, strict=True)):
        data = mesh.point_data
        near = [STEPS[max(number - 1, 0)], STEPS[min(number + 1, len(STEPS) - 1)]]
        for f, family in enumerate(FAMILIES):
            own = data["family"] == f
            assert np.all(data["radius"][own] == family.radius)
            stiffness = np.broadcast_to(family.bending_stiffness, family.count)
            np.testing.assert_array_equal(data["stiffness"][own], stiffness[data["fiber"][own] - firsts[f]])
            before, after = (records(s)[f] for s in near)
            expected = (after - before)[0, 0] / (0.1 * (near[1] - near[0]))
            at = own & (data["fiber"] == firsts[f]) & (data["bead"] == 0)
            np.testing.assert_allclose(data["velocity"][at][0], expected, rtol=1e-9)
        assert step in STEPS and len(times) == len(STEPS)


def test_beads_are_where_they_were_recorded(series):
    wrapped, _, meshes = series
    for step, mesh in zip(STEPS, meshes, strict=True):
        data = mesh.point_data
        first = 0
        for number, (family, positions) in enumerate(zip(FAMILIES, records(step), strict=True)):
            bent = curvature(positions, family.radius)
            for fiber in range(family.count):
                for bead in range(family.beads):
                    at = (
                        (data["family"] == number) & (data["fiber"] == first + fiber) & (data["bead"] == bead)
                    )
                    assert at.sum() == 1
                    shift = (mesh.points[at][0] - positions[fiber, bead]) / BOX
                    boxes = np.round(shift) if wrapped else 0
                    np.testing.assert_allclose(shift, boxes, atol=1e-14)
                    expected = bent[fiber, np.clip(bead - 1, 0, family.beads - 3)]
                    assert data["curvature"][at][0] == pytest.approx(expected, rel=1e-12)
            first += family.count


def test_lines_follow_the_fibers(series):
    """Each line joins neighbours of one fiber, and together they are as long as the fibers."""
    _, _, meshes = series
    expected = sum(family.count * (family.beads - 1) * 2 * family.radius for family in FAMILIES)
    for mesh in meshes:
        ends = mesh.segments()
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
    assert np.all(read_vtp(folder / "wrapped" / "fibers_000000.vtp").point_data["curvature"] == 0)


def test_other_formats_through_meshio(tmp_path, write):
    with open_recording(write(STEPS)) as recording:
        mesh = line_mesh(recording, 1, wrapped=True)
    mesh.write(tmp_path / "fibers.vtu")
    back = meshio.read(tmp_path / "fibers.vtu")
    np.testing.assert_array_equal(back.points, mesh.points)
    np.testing.assert_array_equal(back.point_data["curvature"], mesh.point_data["curvature"])


def test_a_series_of_trajectories(tmp_path):
    """Families that simulate moved together, whole and wrapped: ends of the polylines are where the beads are."""
    families = [Fibers.straight(3, n, 1.0, 1e-3, 1.0, box=2.0, seed=n) for n in (4, 6)]
    flow = LinearFlow(np.zeros((3, 3)), (1.0, 0, 0))
    paths = simulate(families, flow, 0.5, 2.0, record_every=1)
    for wrapped in (False, True):
        series = write_series(paths, tmp_path, wrapped, box=2.0)
        files = [d.get("file") for d in ElementTree.parse(series).iter("DataSet")]
        assert len(files) == 5
    lines = polylines(_of_trajectories(paths, None, False), 4, wrapped=False)
    beads = np.concatenate([path.positions[4].reshape(-1, 3) for path in paths])
    np.testing.assert_array_equal(lines.points, beads)
    np.testing.assert_allclose(
        lines.point_data["velocity"], np.tile([1.0, 0, 0], (len(beads), 1)), atol=1e-12
    )
    with pytest.raises(ValueError, match="give box to wrap them"):
        write_series(paths[0], tmp_path, wrapped=True)


@pytest.mark.parametrize("wrapped", [False, True])
def test_recorded_tension_is_in_the_series(tmp_path, wrapped):
    """At a bead the mean of the links beside it; the ends have that of their only one."""
    values = [np.arange(f.count * (f.beads - 1), dtype=float).reshape(f.count, -1) for f in FAMILIES]
    path = tmp_path / "fibers.h5"
    with Recorder(path, FAMILIES, **SCENE, tension=True) as recorder:
        recorder.append(0, 0.0, records(0), values)
    with open_recording(path) as recording:
        write_series(recording, tmp_path, wrapped)
    data = read_vtp(next(tmp_path.glob("*/fibers_000000.vtp"))).point_data
    own = (data["family"] == 1) & (data["fiber"] == FAMILIES[0].count + 2)
    expected = {0: 18.0, 1: 18.5, 5: 22.5, 9: 26.0}  # links 18 … 26 of the third fiber of ten beads
    assert {b: data["tension"][own & (data["bead"] == b)][0] for b in expected} == expected
