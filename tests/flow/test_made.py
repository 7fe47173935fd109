"""Flows of one's own: from functions, arrays, and cut-outs of a public database."""

import h5py
import numpy as np
import pytest

from gbm_plugin import Fibers, simulate
from gbm_plugin.flow import LinearFlow, StoredFlow, TaylorGreen, from_array, from_function, jhtdb_flow

from waves import BOX, CELLS, ORIGIN, exact, field

POINTS = ORIGIN + np.random.default_rng(2).random((50, 3)) * BOX


def wave(positions, time):
    return exact(positions, time)[0]


@pytest.mark.parametrize("difference", [None, 1e-4])
def test_derivatives_of_a_function_by_differences(difference):
    """Error h²u'''/6, u''' about 5³, and rounding."""
    flow = from_function(wave, difference=difference)
    velocity, rotation, gradient = exact(POINTS, 0.7)
    assert (flow.sample(POINTS, 0.7, "velocity")[0] == velocity).all()
    assert np.abs(flow.sample(POINTS, 0.7, "rotation")[1] - rotation).max() < 1e-6
    assert np.abs(flow.sample(POINTS, 0.7, "gradient")[1] - gradient).max() < 1e-6


def test_what_is_given_is_taken():
    flow = from_function(wave, rotation=lambda x, t: exact(x, t)[1], gradient=lambda x, t: exact(x, t)[2])
    for need, value in zip(("rotation", "gradient"), exact(POINTS, 0.7)[1:], strict=True):
        assert (flow.sample(POINTS, 0.7, need)[1] == value).all()
    only_gradient = from_function(wave, gradient=lambda x, t: exact(x, t)[2])
    assert np.abs(only_gradient.sample(POINTS, 0.7, "rotation")[1] - exact(POINTS, 0.7)[1]).max() < 1e-14


def test_fibers_move_in_a_function_as_in_the_flow():
    fibers = Fibers.straight(4, 6, 1.0, 1e-3, 1.0, box=2.0)
    flow = TaylorGreen(1.0, 1.0)
    made = from_function(lambda x, t: flow.sample(x, t, "velocity")[0])
    ends = [simulate(fibers, f, 0.05, 1.0).positions[-1] for f in (flow, made)]
    assert np.abs(ends[0] - ends[1]).max() < 1e-6


def test_a_bare_function_is_no_flow():
    fibers = Fibers.straight(1, 4, 1.0, 1e-3, 1.0)
    with pytest.raises(TypeError, match=r"no sample\(positions, time, need\); .*from_function"):
        simulate(fibers, wave, 0.1, 1.0)
    with pytest.raises(ValueError, match=r"velocity gives shape \(3,\) for positions of shape \(50, 3\)"):
        from_function(lambda x, t: np.zeros(3)).sample(POINTS, 0.0)


@pytest.mark.parametrize(("word", "order"), [("trilinear", 2), ("cubic", 4)])
@pytest.mark.parametrize("periodic", [True, False])
@pytest.mark.parametrize("location", ["nodes", "centres"])
def test_order_of_an_array(word, order, periodic, location):
    """Bounded too, up to its ends: there values are taken of a whole box, with its last nodes."""
    errors = []
    for n in (1, 2, 4):
        cells = n * CELLS
        if location == "centres":
            values, at = field(cells, 0.5, 0.0), POINTS
            if not periodic:  # between the outermost centres
                at = ORIGIN + BOX * (0.5 / CELLS + (POINTS - ORIGIN) / BOX * (1 - 1 / CELLS))
        else:
            count = cells + (not periodic)
            x = ORIGIN + np.moveaxis(np.indices(count), 0, -1) * BOX / cells
            values, at = np.moveaxis(exact(x, 0.0)[0], -1, 0), POINTS
        flow = from_array(values, BOX, ORIGIN, location, periodic, word)
        velocity, extra = flow.sample(at, 3.0, "gradient")
        errors.append([np.abs(velocity - exact(at, 0)[0]).max(), np.abs(extra - exact(at, 0)[2]).max()])
    orders = np.log2(np.array(errors[-2]) / errors[-1])
    assert orders[0] == pytest.approx(order, abs=0.4)
    assert orders[1] == pytest.approx(2 if word == "trilinear" else 3, abs=0.5)


def test_fibers_that_leave_a_bounded_field_stop_there():
    """Uniform flow to the right: one fiber reaches the end of the field at time 3, the other not before 9."""
    values = np.zeros((3, 6, 6, 6))
    values[0] = 1.0
    flow = from_array(values, 10.0, periodic=False)
    beads = np.array([[6.5, 5.0, 5.0], [7.0, 5.0, 5.0], [0.5, 5.0, 5.0], [1.0, 5.0, 5.0]]).reshape(2, 2, 3)
    fibers = Fibers(beads, 1e-3, 1.0)
    for integrator in ("ab3", "implicit"):
        with pytest.warns(UserWarning, match="fibers 0 of family 0 left the flow"):
            run = simulate(fibers, flow, 0.25, 5.0, integrator, record_every=1)
        assert run.report["left"].tolist() == [0]
        assert run.positions[-1, 0, 1, 0] == pytest.approx(10.0, abs=0.26)
        assert run.positions[-1, 0, 1, 0] <= 10.0
        np.testing.assert_allclose(run.positions[-1, 1], beads[1] + [5.0, 0, 0], atol=1e-12)
    with pytest.raises(ValueError, match=r"fibers \[0\] start outside of the flow"):
        simulate(Fibers(np.add(beads[:1], (5.0, 0, 0)), 1e-3, 1.0), flow, 0.25, 1.0)


def test_a_trajectory_that_runs_out_of_fields_keeps_what_it_has():
    u = np.ones((3, 4, 4, 4))
    flow = StoredFlow([0.0, 1.0, 2.0], lambda _: u, (1, 1, 1))
    fibers = Fibers.straight(2, 4, 0.5, 1e-3, 1.0)
    for integrator in ("ab3", "implicit"):
        with pytest.warns(UserWarning, match="ends at time 2: time .* is not within the stored fields"):
            run = simulate(fibers, flow, 0.3, 5.0, integrator, record_every=1)
        assert run.times[-1] == pytest.approx(2.0)
        np.testing.assert_allclose(run.positions[-1], fibers.positions + 2.0, atol=1e-12)


def cut_out(path, numbers, start, count, spacing, time=lambda n: 0.0):
    """A file as giverny writes it: (z, y, x, 3), single precision, and the coordinates of its points."""
    axes = [s + h * np.arange(n) for s, h, n in zip(start, spacing, count, strict=True)]
    x = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1)
    with h5py.File(path, "w") as file:
        for number in numbers:
            u = exact(x, time(number))[0]
            file[f"velocity_{number:04d}"] = np.transpose(u, (2, 1, 0, 3)).astype(np.float32)
        for name, axis in zip("xyz", axes, strict=True):
            file[f"{name}coor"] = axis.astype(np.float32)
    return path


def test_a_cut_out_of_the_whole_box_is_periodic(tmp_path):
    path = cut_out(tmp_path / "a.h5", [1], ORIGIN, 2 * CELLS, BOX / (2 * CELLS))
    flow = jhtdb_flow(path, box=BOX)
    assert flow.periodic
    beyond = POINTS + BOX * [1, -2, 3]
    assert np.abs(flow.sample(beyond, 5.0)[0] - exact(POINTS, 0)[0]).max() < 2e-3


def test_a_part_of_the_box_is_bounded_and_has_its_times(tmp_path):
    """Two stored times of isotropic1024coarse, 0.002 apart."""
    path = cut_out(
        tmp_path / "b.h5", [1, 11, 21], ORIGIN, (9, 8, 7), BOX / (2 * CELLS), lambda n: (n - 1) * 0.002
    )
    flow = jhtdb_flow(path, "isotropic1024coarse")
    assert flow.times == pytest.approx([0, 0.02, 0.04])
    assert not flow.periodic
    inner = ORIGIN + np.random.default_rng(3).random((20, 3)) * BOX / (2 * CELLS) * [8, 7, 6]
    assert flow.inside(inner).all()
    assert np.abs(flow.sample(inner, 0.03)[0] - exact(inner, 0.03)[0]).max() < 2e-3
    assert not flow.inside(inner + BOX / 2).any()
    with pytest.raises(ValueError, match="the flow is not known at"):
        flow.sample(inner + BOX / 2, 0.0)


@pytest.mark.parametrize(
    ("change", "options", "message"),
    [
        (lambda f: f.__delitem__("xcoor"), {}, "it lacks xcoor"),
        (lambda f: f.__delitem__("velocity_0001"), {}, "it lacks velocity_0001"),
        (lambda f: f.move("velocity_0001", "u"), {}, "it lacks velocity_0001"),
        (
            lambda f: f.__setitem__("velocity_0002", f["velocity_0001"][()]),
            {},
            "give their times, or the data set",
        ),
        (lambda f: f["ycoor"].__setitem__(2, 0.0), {}, "ycoor is not even"),
        (lambda f: None, {"times": [0, 1]}, "2 times are given for its 1 fields"),
    ],
)
def test_other_files_are_refused(tmp_path, change, options, message):
    path = cut_out(tmp_path / "c.h5", [1], ORIGIN, (5, 5, 5), BOX / CELLS)
    with h5py.File(path, "a") as file:
        change(file)
    with pytest.raises(ValueError, match=message) as error:
        jhtdb_flow(path, **options)
    assert str(path) in str(error.value)


def test_unknown_data_sets_are_refused(tmp_path):
    with pytest.raises(ValueError, match="known are isotropic1024coarse"):
        jhtdb_flow(tmp_path / "d.h5", "channel")


@pytest.mark.parametrize(
    ("values", "options", "message"),
    [
        (np.zeros((4, 4, 4)), {}, r"shape \(4, 4, 4\); \(3, nx, ny, nz\)"),
        (np.zeros((3, 3, 4, 4)), {"periodic": False}, "4 or more in each direction"),
        (np.full((3, 4, 4, 4), np.nan), {}, "not finite: component 0"),
        (np.zeros((3, 4, 4, 4)), {"location": "faces"}, "allowed are nodes, centres"),
        (np.zeros((3, 4, 4, 4)), {"interpolation": "spline"}, "allowed are trilinear, cubic"),
    ],
)
def test_bad_arrays_are_refused(values, options, message):
    with pytest.raises((ValueError, FloatingPointError), match=message):
        from_array(values, 1.0, **options)


def test_shear_in_a_bounded_array_is_exact():
    """Linear fields are interpolated exactly, to the ends."""
    flow = LinearFlow([[0, 1, 0], [0, 0, 2], [0.5, 0, 0]], (0.1, 0.2, 0.3))
    x = np.moveaxis(np.indices((5, 6, 7)), 0, -1) * 0.5
    made = from_array(np.moveaxis(flow.sample(x, 0)[0], -1, 0), (2.0, 2.5, 3.0), periodic=False)
    at = np.random.default_rng(1).random((30, 3)) * [2.0, 2.5, 3.0]
    for ours, theirs in zip(made.sample(at, 0), flow.sample(at, 0), strict=True):
        np.testing.assert_allclose(ours, theirs, atol=1e-12)
