"""Fibers that act on the flow, in one process: what is conserved, what balances, and how well."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from gbm_plugin.case.scene import read_scene
from gbm_plugin.output.tables import read_dat

from conftest import gbm, make_case, run_case, set_entry

FAMILIES = """
    stiff { count 40; beads 10; length 1.5; bendingStiffness 1; seed 2; integrator implicit; }
    soft { count 60; beads 8; length 1.2; bendingStiffness 1e-3; seed 3; }
"""


def feedback(path, word="yes"):
    properties = path / "constant/fiberProperties"
    properties.write_text(properties.read_text().replace("coupling {", f"coupling {{ feedback {word};"))


def coupled(path, **options):
    """A case with enough of fibers to change the flow by a tenth."""
    make_case(path, prepared=False, families=FAMILIES, **({"steps": 20, "write_every": 10} | options))
    feedback(path)
    return path


def tables(path):
    flow = read_dat(path / "spectral/postProcessing/linearForcing", "linearForcing.dat")
    return flow, read_dat(path / "spectral/postProcessing/fibers", "daemon.dat")


@pytest.fixture(scope="module")
def whole(tmp_path_factory):
    path = coupled(tmp_path_factory.mktemp("whole") / "case")
    run_case(path, "--flow", "spectral")
    return path


def test_the_energy_that_leaves_the_fluid_is_what_fibers_get(whole):
    """∫ f·u = −Φ − dE_b/dt in every step, and the flow's own column is the same."""
    flow, fibers = tables(whole)
    assert np.all(fibers["friction"] > 0)
    size = fibers["friction"]
    assert (
        np.abs((fibers["exchange"] - fibers["own"] + fibers["friction"] + fibers["bending"]) / size).max()
        < 1e-12
    )
    volume = (2 * np.pi) ** 3
    np.testing.assert_allclose(flow["exchange"] * volume, fibers["exchange"], atol=1e-11 * size.max())


def test_the_budget_of_the_flow_closes_with_the_exchange(whole):
    flow, _ = tables(whole)
    middle = 0.5 * (flow["epsilonLaplacian"][1:] + flow["epsilonLaplacian"][:-1])
    np.testing.assert_allclose(flow["epsilonBudget"][1:], middle, rtol=2e-3)
    assert np.abs(flow["exchange"]).min() > 0.02 * middle.max()  # without it, it would not


def test_momentum_stays_where_it_is(whole):
    flow, _ = tables(whole)
    for c in "xyz":
        assert np.abs(flow[f"meanU{c}"]).max() < 1e-14


def test_a_stopped_run_continues_to_the_same_bits(whole, tmp_path):
    path = coupled(tmp_path / "case")
    set_entry(path / "system/controlDict", "endTime", "0.2")
    run_case(path, "--flow", "spectral")
    set_entry(path / "system/controlDict", "endTime", "0.4")
    run_case(path, "--flow", "spectral")
    for a, b in zip(tables(path), tables(whole), strict=True):
        for column in set(a) - {"sentAt", "arrivedAt"}:
            np.testing.assert_array_equal(a[column], b[column], err_msg=column)


def test_without_the_word_nothing_is_added(tmp_path):
    """`no` is what a case has that does not mention it, and adds no column."""
    path = make_case(tmp_path / "case", prepared=False, families=FAMILIES, steps=3)
    silent = read_scene(path)
    feedback(path, "no")
    assert replace(read_scene(path), texts={}) == replace(silent, texts={})
    run_case(path, "--flow", "spectral")
    flow, fibers = tables(path)
    assert "exchange" not in flow and "friction" not in fibers


def test_it_may_be_switched_on_at_a_restart(tmp_path):
    """Beads have no disturbance of their own in a flow that they have not acted on."""
    path = make_case(tmp_path / "case", prepared=False, families=FAMILIES, steps=3, write_every=3)
    run_case(path, "--flow", "spectral")
    feedback(path)
    set_entry(path / "system/controlDict", "endTime", "0.12")
    done = run_case(path, "--flow", "spectral")
    assert "family stiff: its own disturbance begins here" in done.stdout + done.stderr
    flow, fibers = tables(path)
    assert np.isnan(fibers["own"][:3]).all() and fibers["own"][3] == 0 and (fibers["own"][4:] != 0).all()
    assert np.isnan(flow["exchange"][:3]).all() and (flow["exchange"][3:] != 0).all()


def test_stored_fields_cannot_be_changed(tmp_path):
    path = coupled(tmp_path / "case")
    done = gbm("run", path, "--flow", "stored")
    assert done.returncode == 1
    assert "feedback is yes, and stored fields cannot be changed" in done.stderr
