"""Stored fields against a field in closed form: orders in space and time, what is kept, what is refused."""

import weakref

import numpy as np
import pytest

from gbm_plugin import Fibers, simulate
from gbm_plugin.flow import StoredFlow, TaylorGreen
from gbm_plugin.flow.stored import refuse_gaps

from waves import BOX, CELLS, ORIGIN, exact, field, nodes

RNG = np.random.default_rng(4)
POINTS = ORIGIN + RNG.uniform(-1, 2, (50, 2, 3)) * BOX  # outside of the box too


def stored(times, cells=CELLS, offset=0.5, **words):
    return StoredFlow(times, lambda n: field(cells, offset, times[n]), BOX, ORIGIN, offset, **words)


def rms(error):
    return np.sqrt(np.mean(np.square(error)))


@pytest.mark.parametrize("offset", [0.0, 0.5])
@pytest.mark.parametrize(
    "word, order", [("trilinear", (2, 2, 2)), ("cubic", (4, 3, 3)), ("quintic", (6, 5, 5))]
)
def test_order_in_space(word, order, offset):
    """Velocity, rotation and gradient, at a stored time. The slope of a cubic is of third order."""
    velocity, rotation, gradient = exact(POINTS, 0.4)
    errors = []
    for factor in (3, 6):
        flow = stored([0.0, 0.4], factor * CELLS, offset, interpolation=word)
        u, spin = flow.sample(POINTS, 0.4, "rotation")
        v, slope = flow.sample(POINTS, 0.4, "gradient")
        np.testing.assert_array_equal(u, v)
        assert slope.shape == (50, 2, 3, 3)
        errors.append([rms(u - velocity), rms(spin - rotation), rms(slope - gradient)])
        assert np.array_equal(flow.sample(POINTS, 0.4, "velocity")[0], u)
        assert flow.sample(POINTS, 0.4, "velocity")[1] is None
    orders = np.log2(np.divide(*errors))
    assert orders == pytest.approx(order, abs=0.15)
    assert max(errors[1]) < 0.05


def uneven(interval):
    """Times from 0 to 1.2, their intervals within 30 % of each other."""
    t = np.arange(0, 1.2 + interval / 2, interval)
    return t + 0.03 * interval / 0.1 * np.sin(7 * t) * np.sin(np.pi * t / 1.2)


@pytest.mark.parametrize("word, order", [("linear", 2), ("cubic", 4)])
@pytest.mark.parametrize("part", [(0.3, 0.9), (0.0, 0.04), (1.16, 1.2)], ids=["inside", "first", "last"])
def test_order_in_time(word, order, part):
    """At nodes, where space has no error; near the ends the stencil is one-sided and has the same order."""
    at = nodes(CELLS, 0.5)[::5, ::5, ::5]
    errors = []
    for interval in (0.1, 0.05, 0.025):
        times = uneven(interval)
        flow = stored(times, in_time=word)
        moments = RNG.uniform(*part, 40)
        # in the middle of the intervals that these moments are in, so that meshes of time compare
        i = np.clip(np.searchsorted(times, moments), 1, len(times) - 1)
        i = {(0.0, 0.04): 0 * i + 1, (1.16, 1.2): 0 * i + len(times) - 1}.get(part, i)
        middles = np.unique(0.5 * (times[i] + times[i - 1]))
        errors.append(max(rms(flow.sample(at, t, "velocity")[0] - exact(at, t)[0]) for t in middles))
    assert np.log2(errors[1] / errors[2]) == pytest.approx(order, abs=0.3)
    assert errors[0] > errors[1] > errors[2]


def test_fewer_fields_than_a_cubic_has():
    """Three make a parabola, two a line: exact for a flow that is one."""
    u = [np.random.default_rng(n).standard_normal((3, 4, 4, 4)) for n in range(3)]
    for count in (2, 3):
        times = np.array([0.0, 0.5, 1.5])[:count]
        flow = StoredFlow(
            times, lambda n, t=times: sum(t[n] ** p * u[p] for p in range(len(t))), BOX, offset=0
        )
        found, _ = flow.sample(np.zeros(3), 0.3, "velocity")
        np.testing.assert_allclose(found, sum(0.3**p * u[p][:, 0, 0, 0] for p in range(count)), atol=1e-14)


def test_only_the_fields_around_a_time_are_in_memory():
    """Each is read once on the way, and at most four are kept."""
    times, alive, reads = np.linspace(0, 2, 21), [], []

    def read(n):
        reads.append(n)
        array = field(CELLS, 0.5, times[n])
        array = np.ascontiguousarray(array)
        alive.append(weakref.ref(array))
        return array

    flow = StoredFlow(times, read, BOX, ORIGIN)
    for t in np.linspace(0, 2, 61):
        flow.sample(POINTS, t, "rotation")
        assert sum(ref() is not None for ref in alive) <= 4
    assert sorted(reads) == list(range(21))
    reads.clear()
    flow.sample(POINTS, times[3], "velocity")  # at a stored time the field alone
    assert reads == [3]


def test_times_that_differ_by_the_digits_of_a_folders_name_are_one():
    flow = stored([0.0, 0.33333333, 0.66666667])
    same, near = flow.sample(POINTS, 0.33333333), flow.sample(POINTS, 1 / 3)
    np.testing.assert_array_equal(same[0], near[0])
    flow.sample(POINTS, 2 / 3 + 1e-9)  # not beyond the end


def test_the_rotation_is_that_of_simple_shear():
    """u_x = sin(2 pi y/b): the rotation is -u'(y)/2 about z, and the gradient has [0, 1] alone."""
    y = nodes(CELLS, 0.5)[..., 1] - ORIGIN[1]
    u = np.zeros((3, *CELLS))
    u[0] = np.sin(2 * np.pi * y / BOX[1])
    flow = StoredFlow([0, 1], lambda _: u, BOX, ORIGIN, interpolation="cubic")
    slope = 2 * np.pi / BOX[1] * np.cos(2 * np.pi * (POINTS[..., 1] - ORIGIN[1]) / BOX[1])
    _, rotation = flow.sample(POINTS, 0.5, "rotation")
    _, gradient = flow.sample(POINTS, 0.5, "gradient")
    wave = 2 * np.pi / BOX[1]
    bound = wave * (wave * BOX[1] / CELLS[1]) ** 3 / 12  # of the slope of a cubic through four points
    np.testing.assert_allclose(rotation[..., 2], -slope / 2, atol=bound / 2)
    np.testing.assert_allclose(gradient[..., 0, 1], slope, atol=bound)
    assert np.abs(rotation[..., :2]).max() < 1e-12
    assert np.abs(np.delete(gradient.reshape(-1, 9), 1, axis=1)).max() < 1e-12


def test_fibers_move_as_in_the_flow_itself():
    """Cellular flow stored on finer and finer grids: shapes converge to those in the closed form, at fourth order."""
    flow = TaylorGreen(np.pi, 1.0)
    fibers = Fibers.straight(6, 8, 1.5, 1e-3, 1.0, box=2 * np.pi, seed=2)
    steps = {"time_step": 0.05, "end_time": 2.0, "tolerance": 1e-7}
    reference = simulate(fibers, flow, **steps).positions[-1]
    errors = []
    for n in (16, 32):
        at = (np.moveaxis(np.indices((n, n, 4)), 0, -1) + 0.5) * 2 * np.pi / (n, n, 4)
        u = np.moveaxis(flow.sample(at, 0, "velocity")[0], -1, 0)
        grid = StoredFlow([0, 1, 2], lambda _, u=u: u, 3 * [2 * np.pi], interpolation="cubic")
        errors.append(rms(simulate(fibers, grid, **steps).positions[-1] - reference))
    assert np.log2(errors[0] / errors[1]) == pytest.approx(4, abs=0.5)


def nothing(_):
    raise AssertionError("read")


@pytest.mark.parametrize(
    "arguments, message",
    [
        (([0.0], nothing, BOX), "fields at 1 times are stored; at least 2"),
        (([0.0, 1.0, 1.0], nothing, BOX), "must increase, but 1 is followed by 1"),
        (([0.0, np.nan], nothing, BOX), "not all finite"),
        (([0.0, 1.0], nothing, (1, 0, 1)), "widths must be positive"),
        (([0.0, 1.0], nothing, (1, 1)), "must be \\(3,\\)"),
        (
            ([0.0, 1.0], nothing, BOX, ORIGIN, 0.5, "cellPoint"),
            "'cellPoint'; allowed are trilinear, cubic, quintic",
        ),
        (
            ([0.0, 1.0], nothing, BOX, ORIGIN, 0.5, "cubic", "spline"),
            "'spline'; allowed are linear, cubic",
        ),
    ],
)
def test_bad_input_is_refused(arguments, message):
    with pytest.raises(ValueError, match=message):
        StoredFlow(*arguments)


def test_bad_samples_are_refused():
    fields = [np.zeros((3, 4, 4, 4)), np.zeros((3, 4, 4, 5)), np.zeros((3, 4, 4, 4)), np.zeros((4, 4, 4))]
    fields[2][1, 0, 3, 2] = np.nan
    flow = StoredFlow([0, 1, 2, 3], lambda n: fields[n], BOX)
    at = np.zeros((2, 3))
    for time in (-0.1, 3.1, np.nan):
        with pytest.raises(ValueError, match="not within the stored fields, from 0 to 3"):
            flow.sample(at, time)
    with pytest.raises(ValueError, match="allowed are velocity, rotation, gradient"):
        flow.sample(at, 0, "strain")
    with pytest.raises(ValueError, match=r"shape \(2, 2\)"):
        flow.sample(at[:, :2], 0)
    with pytest.raises(FloatingPointError, match="a position at time 0"):
        flow.sample(at * np.nan, 0)
    flow.sample(at, 0)
    with pytest.raises(ValueError, match=r"time 1 has shape \(3, 4, 4, 5\); \(3, 4, 4, 4\)"):
        flow.sample(at, 1)
    with pytest.raises(FloatingPointError, match=r"time 2 is not finite: component 1 in cell \(0, 3, 2\)"):
        flow.sample(at, 2)
    with pytest.raises(ValueError, match=r"time 3 has shape \(4, 4, 4\)"):
        flow.sample(at, 3)


def test_gaps_in_time():
    """A missing field is a gap; another interval from some time on, or a run that was stopped, is none."""
    for times in ([0, 1, 2, 4, 5], [0, 2, 3, 4], [0, 1, 2, 4], [0, 1, 2, 3, 5, 6, 7.5]):
        with pytest.raises(ValueError, match="fields are missing"):
            refuse_gaps(np.array(times), times[0], times[-1])
    for times in (
        [0, 1],
        [0, 1, 2, 3],
        [0, 1, 2, 2.3, 3, 4],
        [0, 1, 2, 4, 6, 8],
        [0, 2, 4, 5, 6],
        [0, 5, 5.1, 10],
    ):
        refuse_gaps(np.array(times), times[0], times[-1])
    times = np.array([0, 1, 3, 4, 5, 6])
    refuse_gaps(times, 3, 6)
    refuse_gaps(times, 0, 1)
    with pytest.raises(ValueError, match="between the times 1 and 3"):
        refuse_gaps(times, 2.9, 6)


def test_a_run_that_was_stopped_has_no_gaps():
    """Written every 3, and where it was stopped: 1.08, 2 and 2.5 after; no field is missing."""
    times = np.array([0, 2, 3, 3.08, 5.5, 6, 7.08, 9])
    refuse_gaps(times, 0, 9, written_every=3)
    with pytest.raises(ValueError, match="no field is stored"):
        refuse_gaps(np.array([0, 2, 3, 3.08, 9, 12]), 0, 12, written_every=3)


def test_kolmogorov_time_of_an_abc_flow():
    """omega = u: <|omega|^2> = A^2 + B^2 + C^2 = 50, but for central differences, sin(kh)/kh."""
    n = 32
    x, y, z = np.meshgrid(*[(np.arange(n) + 0.5) * 2 * np.pi / n] * 3, indexing="ij")
    u = np.stack(
        [5 * np.sin(z) + 3 * np.cos(y), 4 * np.sin(x) + 5 * np.cos(z), 3 * np.sin(y) + 4 * np.cos(x)]
    )
    flow = StoredFlow([0.0, 1.0], lambda number: u, (2 * np.pi,) * 3)
    h = 2 * np.pi / n
    assert flow.kolmogorov_time(0.2) == pytest.approx(50**-0.5 / (np.sin(h) / h), rel=1e-9)
