"""Dynamics and shapes of fibers whose motion is known; alignments with a known gradient."""

import numpy as np
import pytest

from gbm_plugin.output.recording import FamilyRecord
from gbm_plugin.statistics.orientation import alignments, anisotropy, rod_tumbling
from gbm_plugin.studies.paper import dynamics, shapes

from known_runs import DISSIPATION, VISCOSITY, record_run, rods, unit

RATE, PERIOD = 0.8, 5.0
TIMES = np.arange(201) * 0.1
TAU = np.sqrt(VISCOSITY / DISSIPATION)
COUNT = 20


def arc(angle):
    """(N, 3) a chain of 12 beads, 0.1 apart, that turns by `angle` in all."""
    heading = angle * np.arange(11) / 10
    links = 0.1 * np.stack([np.cos(heading), np.sin(heading), np.zeros(11)], axis=-1)
    return np.concatenate([np.zeros((1, 3)), np.cumsum(links, axis=0)])


def breathing(time):
    """Bent beyond R/L = 0.8 and straight again in each period; starts straight."""
    return np.broadcast_to(arc(3.0 * np.sin(np.pi * time / PERIOD) ** 2), (COUNT, 12, 3)) + 1.0


def ring(time):
    """Closed, so that its ends overlap, in every second half of the period."""
    return np.broadcast_to(arc(6.0 if time % PERIOD >= PERIOD / 2 else 1.0), (COUNT, 12, 3)) + 1.0


def turning(time):
    """About z, all in one plane."""
    phase = RATE * time + np.arange(COUNT)
    return rods(np.stack([np.cos(phase), np.sin(phase), 0 * phase], axis=-1), 12, 0.05)


def scattered(time):
    """Other directions at each time."""
    return rods(unit(np.random.default_rng(round(time * 10)).normal(size=(COUNT, 3))), 12, 0.05)


@pytest.fixture(scope="module")
def case(tmp_path_factory):
    motions = (breathing, ring, turning, scattered)
    families = [(FamilyRecord(m.__name__, COUNT, 12, 0.05, 1e-4), m) for m in motions]
    return record_run(tmp_path_factory.mktemp("known") / "moving", families, TIMES)


@pytest.fixture(scope="module")
def found(case):
    result = dynamics.run([case], since=0.0)
    curves = {c["family"]: c for c in result["curves"]}
    return {r["family"]: r for r in result["rows"]}, curves


def test_buckling(found):
    row = found[0]["breathing"]
    assert row["buckling_events"] == 4 * COUNT
    angle = np.pi * TIMES[:-1] / PERIOD
    turn = 3.0 * np.sin(angle) ** 2  # chord over arc of 11 equal links that turn by turn/10 each
    ratio = np.sin(11 * turn / 20) / np.where(turn > 0, 11 * np.sin(turn / 20), 1)
    straight = np.count_nonzero((turn == 0) | (ratio >= 0.8)) * 0.1 / TAU
    assert row["buckling_rate_times_tau"] == pytest.approx(4 / straight, rel=1e-9)
    assert found[0]["turning"]["buckling_events"] == 0


def test_contact(found):
    row = found[0]["ring"]
    assert row["self_contact"] == pytest.approx((TIMES % PERIOD >= PERIOD / 2).mean())
    assert row["contact_events"] == 4 * COUNT and row["folded"] == 0
    assert found[0]["breathing"]["self_contact"] == 0


def test_memory_and_tumbling(found):
    rows, curves = found
    curve = curves["turning"]
    np.testing.assert_allclose(
        curve["R"], np.cos(RATE * TAU * np.array(curve["lag_over_tau"])), atol=4e-4
    )  # five digits of lags
    assert rows["turning"]["time_of_R_over_tau"] == pytest.approx(1 / RATE / TAU, rel=0.01)
    assert rows["turning"]["tumbling"] == pytest.approx((RATE * TAU) ** 2, rel=1e-9)
    assert np.abs(curves["scattered"]["R"][1:]).max() < 5 / np.sqrt(COUNT * 100)


def test_isotropy(case):
    rows = {r["family"]: r for r in shapes.run([case], since=0.0, records=1000)["rows"]}
    assert rows["turning"]["anisotropy"] == pytest.approx(0.5, abs=1e-2)  # all directions of a plane
    assert rows["scattered"]["anisotropy"] < 3 / np.sqrt(COUNT * len(TIMES))
    assert anisotropy(np.array([[0, 0, 2.0], [0, 0, -1.0]])) == pytest.approx(1)


def test_alignments_and_jeffery():
    """A vortex along z in a strain that stretches along z and compresses along x; a rod in shear."""
    gradient = np.array([[-3.0, -1, 0], [1, 1, 0], [0, 0, 2]])
    along = alignments(np.eye(3), np.broadcast_to(gradient, (3, 3, 3)))
    np.testing.assert_allclose(along["vorticity"], [0, 0, 1], atol=1e-14)
    np.testing.assert_allclose(along["stretching"], [0, 0, 1], atol=1e-14)
    np.testing.assert_allclose(along["middle"], [0, 1, 0], atol=1e-14)
    np.testing.assert_allclose(along["compression"], [1, 0, 0], atol=1e-14)
    shear = np.zeros((3, 3))
    shear[0, 1] = 2.0
    np.testing.assert_allclose(rod_tumbling(shear, np.array([0, 1.0, 0])), [2, 0, 0])  # thin, across: γ̇
    np.testing.assert_allclose(rod_tumbling(shear, np.array([0, 1.0, 0]), 0.0), [1, 0, 0])  # a sphere: γ̇/2
