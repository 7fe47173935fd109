"""Another code's fields in HDF5, at nodes and at cell centres."""

import h5py
import numpy as np
import pytest

from gbm_plugin.flow import hdf5_flow

from waves import BOX, CELLS, ORIGIN, exact, field

TIMES = np.linspace(0, 0.3, 7)


def write(path, location="nodes", cells=CELLS, as_datasets=False, **changes):
    """A file of the documented layout; changes replace entries, None leaves them out."""
    offset = {"nodes": 0.0, "centres": 0.5}.get(location, 0.0)
    entries = {
        "time": TIMES,
        "velocity": np.stack([field(cells, offset, t) for t in TIMES]),
        "box": BOX,
        "origin": ORIGIN,
        "location": location,
        **changes,
    }
    with h5py.File(path, "w") as file:
        for name, value in entries.items():
            if value is None:
                continue
            if name in ("time", "velocity") or as_datasets:
                file[name] = value
            else:
                file.attrs[name] = value
    return path


@pytest.mark.parametrize("location", ["nodes", "centres"])
@pytest.mark.parametrize("as_datasets", [False, True])
def test_values_at_nodes_and_centres_are_those_of_the_field(tmp_path, location, as_datasets):
    """Off by half a cell, the error would be of the first order and a hundred times as large."""
    points = ORIGIN + np.random.default_rng(0).uniform(-1, 2, (200, 3)) * BOX
    flow = hdf5_flow(write(tmp_path / "u.h5", location, 3 * CELLS, as_datasets), "cubic")
    for time in (0.0, 0.12, 0.3):
        velocity, gradient = flow.sample(points, time, "gradient")
        expected = exact(points, time)
        np.testing.assert_allclose(velocity, expected[0], atol=5e-4)
        np.testing.assert_allclose(gradient, expected[2], atol=1e-2)


def test_without_an_origin_the_box_begins_at_zero(tmp_path):
    flow = hdf5_flow(write(tmp_path / "u.h5", origin=None))
    assert flow.sample(np.zeros(3), 0.0, "velocity")[0] == pytest.approx(exact(ORIGIN, 0.0)[0], abs=1e-14)


def test_single_precision_is_read(tmp_path):
    values = np.stack([field(CELLS, 0, t) for t in TIMES]).astype(np.float32)
    flow = hdf5_flow(write(tmp_path / "u.h5", velocity=values))
    assert flow.sample(ORIGIN, 0.0, "velocity")[0] == pytest.approx(exact(ORIGIN, 0.0)[0], abs=1e-6)


@pytest.mark.parametrize(
    "changes, message",
    [
        ({"time": None, "box": None}, "lacks time, box"),
        ({"location": None}, "lacks location"),
        ({"location": "edges"}, "location is 'edges'; allowed: nodes centres"),
        ({"velocity": np.zeros((7, 4, 4, 4))}, r"shape \(7, 4, 4, 4\); \(7, 3, nx, ny, nz\)"),
        ({"velocity": np.zeros((7, 4, 4, 4, 3))}, r"\(7, 3, nx, ny, nz\)"),
        ({"velocity": np.zeros((6, 3, 4, 4, 4))}, r"\(7, 3, nx, ny, nz\)"),
        ({"time": TIMES[::-1]}, "must increase, but 0.3 is followed by 0.25"),
        ({"time": TIMES[:1], "velocity": np.zeros((1, 3, 4, 4, 4))}, "at least 2"),
        ({"box": (1, 2)}, r"shapes \(2,\)"),
        ({"box": "wide"}, "could not convert"),
    ],
)
def test_other_layouts_are_refused(tmp_path, changes, message):
    path = write(tmp_path / "u.h5", **changes)
    with pytest.raises(ValueError, match=message) as caught:
        hdf5_flow(path)
    assert str(caught.value).startswith(str(path))


def test_other_files_are_refused(tmp_path):
    with pytest.raises(FileNotFoundError, match="there is no file"):
        hdf5_flow(tmp_path / "none.h5")
    (tmp_path / "text.h5").write_text("time 0 1 2")
    with pytest.raises(ValueError, match="cannot be read as HDF5"):
        hdf5_flow(tmp_path / "text.h5")
