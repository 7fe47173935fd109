import matplotlib.image
import numpy as np
from matplotlib.collections import QuadMesh

from gbm_plugin.output.recording import FamilyRecord, Recorder, open_recording
from gbm_plugin.report.picture import Camera, fibers_picture

from sample_records import BOX, SCENE

ORIGIN, SIZE = np.zeros(3), np.full(3, BOX)


def picture(tmp_path, positions, radius, flow=None):
    path = tmp_path / "fibers.h5"
    with Recorder(path, [FamilyRecord("f", *positions.shape[:2], radius, 1.0)], **SCENE) as recorder:
        recorder.append(0, 0.0, [positions])
    with open_recording(path) as recording:
        figure = fibers_picture(recording, 0, flow)
    figure.savefig(tmp_path / "picture.png", dpi=300)
    return figure, matplotlib.image.imread(tmp_path / "picture.png")


def test_camera_keeps_the_centre_and_magnifies_what_is_near():
    camera = Camera(ORIGIN, SIZE)
    flat, near = camera(ORIGIN + SIZE / 2)
    np.testing.assert_allclose([*flat, near], 0, atol=1e-12)
    steps = np.array([camera.towards, -camera.towards]) + 0.1 * camera.right
    flat, near = camera(ORIGIN + SIZE / 2 + steps)
    assert near[0] > 0 > near[1] and flat[0, 0] > 0.1 > flat[1, 0]


def test_flow_is_painted_where_it_is(tmp_path):
    """Every node of the painted faces shows the field's value at the place that the camera sees there."""
    x, y, z = np.meshgrid(*[(np.arange(32) + 0.5) * BOX / 32] * 3, indexing="ij")

    def value(x, y, z):
        return 6 + np.sin(x) + 2 * np.cos(y + 1) + 1.5 * np.sin(z + 0.3) * np.cos(x)

    rod = np.array([[[3.0, 3, 3], [3.1, 3, 3]]])
    figure, _ = picture(tmp_path, rod, 0.05, (value(x, y, z), "value"))
    faces = [part for part in figure.axes[0].collections if isinstance(part, QuadMesh)]
    assert len(faces) == 3
    camera = Camera(ORIGIN, SIZE)
    nodes = np.linspace(0, BOX, 33)
    for axis, face in enumerate(faces):
        side = 0.0 if camera.towards[axis] > 0 else BOX  # the far side
        place = np.insert(np.stack(np.meshgrid(nodes, nodes, indexing="ij")), axis, side, axis=0)
        flat, _ = camera(np.moveaxis(place, 0, -1))
        np.testing.assert_allclose(face.get_coordinates(), flat, atol=1e-12)
        np.testing.assert_allclose(face.get_array(), value(*place), atol=0.03)  # averages of 8 cells: O(h²)


def test_fiber_is_as_thick_as_it_is(tmp_path):
    """A straight fiber across the picture covers length × diameter, its round ends included."""
    camera, radius = Camera(ORIGIN, SIZE), 0.15
    beads = SIZE / 2 + np.linspace(-5, 5, 11)[:, None] * 2 * radius * camera.right
    figure, image = picture(tmp_path, beads[None], radius)
    axes = figure.axes[0]
    scale = image.shape[1] / figure.bbox.width
    pixels = axes.transData.get_matrix()[0, 0] * scale
    inside = image[:, : int(axes.bbox.x1 * scale)]  # without the colour bar
    blue = inside[..., 2] - inside[..., 0] > 0.1
    area = blue.sum() / pixels**2
    expected = 20 * radius * 2 * radius + np.pi * radius**2
    assert abs(area / expected - 1) < 0.04, area / expected


def test_many_fibers_are_thinned_out_and_it_says_so(tmp_path):
    random = np.random.default_rng(0)
    first = random.uniform(0, BOX, size=(500, 1, 3))
    chains = first + np.array([[0, 0, 0], [0.002, 0, 0], [0.004, 0, 0]])
    figure, _ = picture(tmp_path, chains, 0.001)
    assert figure.axes[1].get_title(loc="left") == "f\n200 of 500 fibers\n(drawn too thick)"
