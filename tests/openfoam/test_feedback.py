"""Fibers that act on OpenFOAM's flow: energy and momentum, ranks and daemons, restarts."""

from __future__ import annotations

import re

import numpy as np
import pytest

from gbm_plugin.output.field import read_velocity
from gbm_plugin.output.recording import open_recording
from gbm_plugin.output.tables import read_dat

from conftest import divide, gbm, make_case, run_case, set_entry

pytestmark = pytest.mark.openfoam

FAMILIES = """
    stiff { count 40; beads 10; length 1.5; bendingStiffness 1; seed 2; integrator implicit; }
    soft { count 60; beads 8; length 1.2; bendingStiffness 1e-3; seed 3; }
"""
VOLUME = (2 * np.pi) ** 3
SOLVERS = ("boxFoam", "pimpleFoam")
FURTHER = [("boxFoam", 2, 1), ("pimpleFoam", 2, 1), ("pimpleFoam", 2, 2)]  # with daemons and ranks


def coupled(path, application="boxFoam", *, ranks=1, daemons=1, words="", **options):
    """A case with enough of fibers to change the flow by a tenth."""
    options = {"steps": 20, "write_every": 10, "families": FAMILIES} | options
    make_case(path, application=application, **options)
    properties = path / "constant/fiberProperties"
    words = f"coupling {{ feedback yes; daemons {daemons}; {words}"
    properties.write_text(properties.read_text().replace("coupling {", words))
    set_entry(path / "system/controlDict", "writeFormat", "binary")
    if ranks > 1:
        divide(path, ranks, (1, 1, ranks))
    return path


def tables(path, engine=""):
    folder = path / engine / "postProcessing"
    fibers = [read_dat(folder / "fibers", f"daemon{share}.dat") for share in shares(folder)]
    return read_dat(folder / "linearForcing", "linearForcing.dat"), fibers


def shares(folder):
    found = sorted(p.name for p in (folder / "fibers/0").glob("daemon*.dat"))
    return [re.sub(r"daemon|\.dat", "", name) for name in found]


def positions(path):
    with open_recording(path / "postProcessing/fibers") as recording:
        return [f.positions[:] for f in recording.families.values()]


@pytest.fixture(scope="module", params=SOLVERS)
def whole(request, tmp_path_factory):
    path = coupled(tmp_path_factory.mktemp(request.param) / "case", request.param)
    run_case(path)
    return request.param, path


def test_the_energy_that_leaves_the_fluid_is_what_fibers_get(whole):
    """Σ F·u + T·Ω = −Φ − dE_b/dt in every step, and it is the exchange of the flow's own table."""
    _, path = whole
    flow, (fibers,) = tables(path)
    size = fibers["friction"]
    assert (size > 0).all()
    assert np.abs((fibers["exchange"] - fibers["own"] + size + fibers["bending"]) / size).max() < 1e-12
    np.testing.assert_allclose(flow["exchange"] * VOLUME, fibers["exchange"], atol=1e-9 * size.max())


def test_the_force_on_cells_gives_that_power(whole):
    """∫ f·U of the fields on disk is Σ F·u + T·½∇×u of the samples: spreading is the transpose of sampling. An implicit
    solver writes the force of one step before."""
    solver, path = whole
    flow, _ = tables(path)
    u, force = (read_velocity(path, "0.4", (16, 16, 16), name) for name in ("U", "fiberForce"))
    power = (u * force).sum(axis=0).mean()
    if solver == "boxFoam":
        assert power == pytest.approx(flow["exchange"][-1], rel=1e-11)
    else:
        assert power == pytest.approx(flow["exchange"][-1], rel=0.05)
    assert np.abs(force.mean(axis=(1, 2, 3))).max() < 1e-14 * np.abs(force).max()


def test_the_budget_closes_with_the_exchange(whole):
    solver, path = whole
    flow, _ = tables(path)
    middle = 0.5 * (flow["epsilonLaplacian"][1:] + flow["epsilonLaplacian"][:-1])
    # pimpleFoam's schemes dissipate beside its viscosity, more and more as small scales appear
    off = np.abs(flow["epsilonBudget"][1:] / middle - 1)[1:5]
    assert off.max() < (2e-3 if solver == "boxFoam" else 0.03)
    assert np.abs(flow["exchange"]).min() > 0.04 * middle.max()  # without it, it would not
    for c in "xyz":
        assert np.abs(flow[f"meanU{c}"]).max() < 1e-13


@pytest.mark.parametrize(
    "whole, daemons, ranks",
    [("boxFoam", 2, 2), *(pytest.param(*case, marks=pytest.mark.exhaustive) for case in FURTHER)],
    indirect=["whole"],
)
def test_on_ranks_and_daemons_it_is_the_same_run(whole, tmp_path, daemons, ranks):
    solver, path = whole
    steps = 20 if solver == "boxFoam" else 3  # tight linear solvers on ranks take their time
    other = coupled(tmp_path / "case", solver, daemons=daemons, ranks=ranks, steps=steps)
    run_case(other, *(["--parallel"] if ranks > 1 else []))
    for a, b in zip(positions(other), positions(path), strict=True):
        assert np.abs(a[steps] - b[steps]).max() < 1e-8
    flow, fibers = tables(other)
    np.testing.assert_allclose(flow["k"], tables(path)[0]["k"][: len(flow["k"])], rtol=1e-8)
    total = sum(table["exchange"] for table in fibers)
    np.testing.assert_allclose(flow["exchange"] * VOLUME, total, rtol=1e-9)


@pytest.mark.parametrize(
    "whole", ["boxFoam", pytest.param("pimpleFoam", marks=pytest.mark.exhaustive)], indirect=True
)
def test_a_stopped_run_continues_to_the_same_bits(whole, tmp_path):
    solver, path = whole
    other = coupled(tmp_path / "case", solver)
    set_entry(other / "system/controlDict", "endTime", "0.2")
    run_case(other)
    set_entry(other / "system/controlDict", "endTime", "0.4")
    run_case(other)
    for a, b in zip(positions(other), positions(path), strict=True):
        np.testing.assert_array_equal(a, b)
    np.testing.assert_array_equal(
        read_velocity(other, "0.4", (16, 16, 16)), read_velocity(path, "0.4", (16, 16, 16))
    )


FACE = """face { type surfaceFieldValue; libs (fieldFunctionObjects); fields (fiberForce); operation areaAverage;
    regionType patch; name xLow; writeFields no; log no; }
"""


def test_function_objects_find_the_force_on_faces_of_the_box(tmp_path):
    """Half of that on either side, in the mean over a face."""
    path = coupled(tmp_path / "case", steps=2, write_every=2, cells=12)
    control = path / "system/controlDict"
    control.write_text(control.read_text().replace("functions\n{", "functions\n{\n" + FACE))
    run_case(path)
    force = read_velocity(path, "0.04", (12, 12, 12), "fiberForce")
    last = next(path.glob("postProcessing/face/0/*.dat")).read_text().splitlines()[-1]
    found = [float(number) for number in re.findall(r"[-+.e\d]+", last)[1:]]
    expected = (force[:, 0] + force[:, -1]).mean(axis=(1, 2)) / 2
    assert np.abs(expected).max() > 0
    np.testing.assert_allclose(found, expected, rtol=1e-6, atol=1e-9 * np.abs(force).max())


@pytest.mark.parametrize("word", ["yes", "no"])
def test_the_force_is_no_entry_of_ones_own(word, tmp_path):
    """Whether it acts or not: constant/fiberProperties alone says so."""
    path = coupled(tmp_path / "case", steps=2, write_every=2, cells=12)
    set_entry(path / "constant/fiberProperties", "coupling { feedback", word)
    with open(path / "constant/fvOptions", "a") as options:
        options.write(f"mine {{ type fiberFeedback; active {'no' if word == 'yes' else 'yes'}; }}\n")
    done = gbm("run", path)
    assert done.returncode == 1
    assert "fvOptions has the entry mine of type fiberFeedback: take it out" in done.stderr
