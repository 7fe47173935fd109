"""Any shape, any stiffness, any batch: finite, exact in length, restartable; bad input refused."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from gbm_plugin import Fibers, simulate
from gbm_plugin.fiber import Stepper
from gbm_plugin.flow import LinearFlow
from gbm_plugin.threads import limited_to

from fiber_cases import WavyFlow, bent, crooked, positions_of, rpy_matrix, run_once_per_step

STILL = LinearFlow(np.zeros((3, 3)))


@settings(max_examples=40, deadline=None)
@given(
    beads=st.integers(2, 200),
    relative=st.floats(-3, np.log10(30)),
    bend=st.floats(0, 2),
    law=st.sampled_from(["sine", "discreteRod"]),
    seed=st.integers(0, 2**31),
)
def test_any_fiber_stays_finite_and_of_exact_length(beads, relative, bend, law, seed):
    """l_p/L from 1e-3 to 30, l_p = (K/μS)^(1/4), in a flow of rates S ~ 1."""
    length, viscosity = 1.0, 1e-3
    stiffness = viscosity * (10**relative * length) ** 4
    fibers = Fibers(bent(2, beads, length / beads, bend, seed), stiffness, viscosity, curvature_law=law)
    stepper = run_once_per_step(fibers, WavyFlow(), 0.02, 4, integrator="implicit")
    last = stepper.positions
    assert np.isfinite(last).all()
    spacing = np.linalg.norm(np.diff(last, axis=1), axis=2)
    assert np.abs(spacing / (2 * fibers.radius) - 1).max() < 1e-13 * beads


@settings(max_examples=30, deadline=None)
@given(beads=st.integers(2, 12), spread=st.floats(0.1, 3), seed=st.integers(0, 2**31))
def test_rpy_is_symmetric_positive_definite(beads, spread, seed):
    """The dense tensors that the kernels are compared with, for random and overlapping beads."""
    x = spread * np.random.default_rng(seed).standard_normal((beads, 3))
    matrix = rpy_matrix(x, 0.5, 1.0)
    assert np.abs(matrix - matrix.T).max() < 1e-14
    assert np.linalg.eigvalsh(matrix).min() > 0


def test_rpy_is_continuous_at_contact_and_free_drain_far_away():
    def pair(r):
        return rpy_matrix(np.array([[0, 0, 0], [r, 0.0, 0]]), 1.0, 1.0)

    assert np.abs(pair(2 + 1e-9) - pair(2 - 1e-9)).max() < 1e-9
    alone = np.diag(np.r_[np.full(6, 1 / (6 * np.pi)), np.full(6, 1 / (8 * np.pi))])
    for r in (1e2, 1e4):
        assert np.abs(pair(r) - alone).max() < 1 / (4 * np.pi * r) * 1.01


@pytest.mark.parametrize("integrator", ["ab3", "implicit", "auto"])
def test_restart_is_bitwise(integrator):
    fibers = Fibers(bent(11, 7, 0.1), 1e-3, 1.0)
    whole = run_once_per_step(fibers, WavyFlow(), 0.05, 9, integrator=integrator)
    half = run_once_per_step(fibers, WavyFlow(), 0.05, 5, integrator=integrator)
    again = Stepper(fibers, integrator=integrator)
    again.restore(half.state())
    for _ in range(4):
        again.advance(0.05)
        assert not again.provisional
        again.observe(again.time, *WavyFlow().sample(again.positions, again.time, again.need))
    assert again.time == whole.time
    assert (again.positions == whole.positions).all()
    assert (again.prediction_gap == whole.prediction_gap).all()


def test_auto_takes_by_implicit_steps_what_ab3_loses():
    """Rates that have overflowed: of auto an attempt, which is made again; of ab3 the end, at this step."""
    fibers = Fibers(bent(11, 7, 0.1), 1e-4, 1.0)
    with pytest.raises(FloatingPointError, match="fiber 10 has no finite solution in step 5"):
        _after_an_overflow(fibers, "ab3")
    found, expected = (_after_an_overflow(fibers, integrator) for integrator in ("auto", "implicit"))
    assert found.report()["refined_fibers"] == expected.report()["refined_fibers"] == 0
    assert (found.positions[10] == expected.positions[10]).all()
    assert np.abs(found.positions - expected.positions).max() < found.tolerance * fibers.contour_length
    found.restore(found.state())
    found.advance(0.01)  # with a history of its own, from here on
    assert found.report()["ab3_steps"] == 6
    assert np.isfinite(found.positions).all()


def _after_an_overflow(fibers: Fibers, integrator: str) -> Stepper:
    """Four steps by ab3, one with rates of the last fiber that are not finite."""
    stepper = run_once_per_step(fibers, STILL, 0.01, 4, integrator="ab3")
    again = Stepper(fibers, integrator=integrator)
    again.restore(stepper.state())
    again._rates[0][1, :, 2:] = np.inf  # and its copies, which fill the block
    again._counts["steps"], again._counts["ab3_steps"] = 4, 4
    again.advance(0.01)
    again.observe(again.time, *STILL.sample(again.positions, again.time, again.need))
    return again


@pytest.mark.parametrize("integrator", ["ab3", "implicit"])
def test_results_do_not_depend_on_the_number_of_threads(integrator):
    """Enough fibers for three shares, whatever this machine has."""
    fibers = Fibers(crooked(900, 7, 0.1), 1e-3, 1e-2)
    results = []
    for count in (1, 3):
        with limited_to(count):
            results.append(run_once_per_step(fibers, WavyFlow(), 0.01, 3, integrator=integrator).positions)
    assert (results[0] == results[1]).all()


GOOD = bent(2, 5, 0.1)


@pytest.mark.parametrize(
    ("arguments", "options", "message"),
    [
        ((GOOD[:, :1], 1.0, 1.0), {}, "at least one fiber of two beads"),
        ((GOOD * [1, 1, 2], 1.0, 1.0), {}, "must touch"),
        ((GOOD * np.nan, 1.0, 1.0), {}, "NaN"),
        ((GOOD[0], 1.0, 1.0), {}, "must be \\(fibers, beads, 3\\)"),
        ((GOOD, -1.0, 1.0), {}, "not negative"),
        ((GOOD, [1.0, 2.0, 3.0], 1.0), {}, "must be one number or \\(2,\\)"),
        ((GOOD, 1.0, 0.0), {}, "viscosity is 0.0; it must be finite and positive"),
        ((GOOD, 1.0, 1.0), {"bending_torque": "printed"}, "allowed are consistent, asPrinted"),
        ((GOOD, 1.0, 1.0), {"curvature_law": "tan"}, "allowed are sine, discreteRod"),
        ((GOOD, 1.0, 1.0), {"young_modulus": 1.0}, "exactly one of them"),
        ((GOOD, None, 1.0), {}, "exactly one of them"),
    ],
)
def test_bad_fibers_are_refused(arguments, options, message):
    with pytest.raises(ValueError, match=message):
        Fibers(*arguments, **options)


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"integrator": "rk4"}, "allowed are ab3, implicit, auto"),
        ({"mobility": "stokes"}, "allowed are freeDrain, rpy"),
        ({"strain_coupling": True}, "no effect"),
        ({"tolerance": 0.0}, "tolerance is 0.0; it must be finite and positive"),
        ({"record_every": 0}, "record_every is 0"),
        ({"repulsion": -1.0}, "not negative"),
    ],
)
def test_bad_options_are_refused(options, message):
    with pytest.raises(ValueError, match=message):
        simulate(Fibers(GOOD, 1.0, 1.0), STILL, 0.1, 1.0, **options)


def test_ab3_refuses_absurd_numbers_of_substeps():
    with pytest.raises(ValueError, match="take the implicit integrator"):
        simulate(Fibers(GOOD, 1e9, 1e-3), STILL, 0.1, 1.0, integrator="ab3")


@pytest.mark.parametrize("rate", [10.0, 100.0, 1e8])
def test_ab3_refuses_a_flow_that_it_cannot_follow(rate):
    """Turning by many radians a step, it would be stable, of exact length, and anywhere."""
    shear = LinearFlow([[0, rate, 0], [0, 0, 0], [0, 0, 0]])
    with pytest.raises(ValueError, match=r"ab3 loses fiber|changes too fast for a step of 1"):
        simulate(Fibers(bent(4, 20, 0.1), 1e-4, 1e-2), shear, 1.0, 3.0, integrator="ab3")


@pytest.mark.filterwarnings("error")
@pytest.mark.parametrize("integrator", ["ab3", "implicit", "auto"])
def test_a_folded_discrete_rod_is_refused_or_moved(integrator):
    """At a fold cos²(θ/2), by which the stable step shrinks, is 0."""
    links = np.repeat([[[1.0, 0, 0], [-1.0, 0, 0]]], 4, axis=1)
    fibers = Fibers(positions_of(links, 0.1), 1e-4, 1e-2, curvature_law="discreteRod")
    if integrator == "ab3":
        with pytest.raises(ValueError, match="take the implicit integrator"):
            simulate(fibers, STILL, 0.01, 0.02, integrator=integrator)
    else:
        path = simulate(fibers, STILL, 0.01, 0.02, integrator=integrator)
        np.testing.assert_allclose(path.positions[-1], fibers.positions, atol=1e-12)  # no binormal, no moment


def test_a_fiber_beyond_double_precision_is_named():
    """Carried off exponentially, its beads end in one place by rounding; no step is short enough then."""
    stretch = LinearFlow(np.diag([100.0, -50, -50]))
    shapes = bent(2, 5, 0.1) + np.array([[[0, 0, 0]], [[1.0, 0, 0]]])
    with pytest.raises(
        FloatingPointError, match=r"fiber 1 is more than 4.5e\+08 from the origin at time 0.1"
    ):
        simulate(Fibers(shapes, 1e-4, 1e-2), stretch, 1.0, 3.0)


def test_stiffness_without_bounds_is_refused():
    with pytest.raises(ValueError, match="cannot be computed with"):
        Fibers(GOOD, 1e300, 1.0)
    with pytest.raises(
        FloatingPointError, match=r"fiber 0 needs steps below .* too stiff for so bent a shape"
    ):
        simulate(Fibers(GOOD, 1e60, 1.0), STILL, 0.1, 1.0)


def test_errors_name_the_family():
    families = [Fibers(GOOD, 1.0, 1.0), Fibers(GOOD, 1e9, 1e-3)]
    with pytest.raises(ValueError, match=r"^family 1: ab3 would need"):
        simulate(families, STILL, 0.1, 1.0, integrator="ab3")


def test_the_loop_is_guarded():
    stepper = Stepper(Fibers(GOOD, 1.0, 1.0))
    rest = np.zeros(GOOD.shape)
    with pytest.raises(ValueError, match=r"observe\(\) comes before advance\(\)"):
        stepper.advance(0.1)
    with pytest.raises(ValueError, match="the fibers are at time 0"):
        stepper.observe(1.0, rest, rest)
    with pytest.raises(ValueError, match="sampled velocity has shape"):
        stepper.observe(0.0, rest[:1], rest)
    with pytest.raises(ValueError, match="correct\\(\\) follows advance"):
        stepper.correct()


def test_nan_is_an_error_where_it_appears():
    stepper = Stepper(Fibers(GOOD, 1.0, 1.0))
    wrong = np.zeros(GOOD.shape)
    wrong[1, 2, 0] = np.nan
    with pytest.raises(FloatingPointError, match="fiber 1"):
        stepper.observe(0.0, wrong, np.zeros(GOOD.shape))


@pytest.mark.parametrize("integrator", ["ab3", "implicit", "auto"])
def test_a_fiber_without_finite_solution_is_named(integrator):
    huge = np.zeros(GOOD.shape)
    huge[1] = 1e300 * np.arange(5)[:, None]
    stepper = Stepper(Fibers(GOOD, 1e-6, 1.0), integrator=integrator)
    stepper.observe(0.0, huge, np.zeros(GOOD.shape))
    with pytest.raises(FloatingPointError, match="fiber 1 has no finite solution in step 1"):
        stepper.advance(0.1)


def test_straight_fibers_and_what_is_read_off_them():
    fibers = Fibers.straight(7, 20, 2.0, None, 1e-3, box=(1.0, 2.0, 3.0), seed=4, young_modulus=3.0)
    assert fibers.contour_length == pytest.approx(2.0)
    np.testing.assert_allclose(np.linalg.norm(fibers.end_to_end, axis=1), 1.9)
    assert np.abs(fibers.curvature).max() < 1e-12
    np.testing.assert_allclose(fibers.gyration_radius, 0.1 * np.sqrt((20**2 - 1) / 12))
    np.testing.assert_allclose(fibers.bending_stiffness, 3.0 * np.pi * 0.1**4 / 64)
    assert (fibers.centres >= 0).all() and (fibers.centres <= [1, 2, 3]).all()
    assert (fibers.positions == Fibers.straight(7, 20, 2.0, 1.0, 1e-3, box=(1, 2, 3), seed=4).positions).all()


def test_curvature_of_a_circle():
    turn = 0.1 * np.arange(19)
    links = np.stack([np.cos(turn), np.sin(turn), 0 * turn], axis=1)[None]
    fibers = Fibers(positions_of(links, 0.1), 1.0, 1.0)
    np.testing.assert_allclose(fibers.curvature, np.sin(0.1) / 0.1)
    np.testing.assert_allclose(fibers.bending_energy, 18 * 10 * (1 - np.cos(0.1)))
