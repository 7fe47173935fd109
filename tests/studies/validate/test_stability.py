"""The hard cases that are quick: each handled, or refused with its own line. And that a fault is seen as one."""

from __future__ import annotations

import warnings

import numpy as np
import pytest

from gbm_plugin.studies.hard.case import Case
from gbm_plugin.studies.hard.fibers import judged, many_sub_steps, relaxed, whirled
from gbm_plugin.studies.validate.stability import cases, rows, table

QUICK = cases(("fibers", "flows"), quick=True)


@pytest.mark.parametrize("case", QUICK, ids=lambda case: case.name)
def test_hard(case):
    row = case.measure()
    assert row["outcome"] == ("refused" if case.refused else "handled"), row


def test_sub_steps_by_the_hundred_thousand_do_not_drift():
    found = many_sub_steps(1)
    assert found["finite"] and found["length_error"] < 1e-14


def test_no_energy_from_nowhere():
    """At rest the energy of crooked fibers falls in every step, however long."""
    assert max(relaxed("sine", "implicit", times)["growth"] for times in (1, 1e3, 1e5)) < 0


def test_the_drift_of_a_captured_fiber_is_of_third_order():
    """Halved steps: an eighth of the rate, so the same constant."""
    coarse, fine = whirled("ab3", 0.2)["drift"], whirled("ab3", 0.1)["drift"]
    assert abs(fine - 3 / 8) < 0.6 * abs(coarse - 3 / 8)


def _noisy():
    warnings.warn("divide by zero", RuntimeWarning, stacklevel=1)
    return {"finite": True}


def _refusing():
    raise ValueError("no")


@pytest.mark.parametrize(
    ("act", "refused", "outcome"),
    [
        (lambda: {"finite": False}, None, "WRONG: not finite"),
        (lambda: {"length_error": 1e-9}, None, "WRONG: length_error"),
        (lambda: {"growth": float("nan")}, None, "WRONG: growth"),
        (lambda: {"off": 2.0}, None, "WRONG: off"),
        (lambda: {"finite": True}, "no", "WRONG: not refused"),
        (_refusing, None, "WRONG: refused"),
        (_refusing, "yes", "WRONG: refused with another message"),
        (_noisy, None, "WRONG: it warns of divide by zero"),
        (_refusing, "no", "refused"),
        (lambda: {"off": 0.5}, None, "handled"),
    ],
)
def test_faults_are_seen(act, refused, outcome):
    assert Case("kind", "asked", act, refused).measure()["outcome"] == outcome


def test_a_broken_fiber_is_seen():
    from gbm_plugin import Fibers

    fibers = Fibers.straight(1, 5, 1.0, 1.0, 1.0)
    last = fibers.positions.copy()
    assert judged(fibers, last)["length_error"] < 1e-14
    last[0, -1] *= 1.01
    assert judged(fibers, last)["length_error"] > 1e-3
    last[0, 0] = np.nan
    assert not judged(fibers, last)["finite"]


def test_table():
    result = {"rows": [case.measure() for case in QUICK[:3]]}
    assert "3 cases: 3 handled, 0 refused, 0 wrong" in table(result)
    assert len(rows(result)) == 3
