"""Table 1 beside runs: means of a run's table, and of its fields by the solver that made them."""

from __future__ import annotations

import numpy as np
import pytest

from gbm_plugin.output.tables import read_forcing
from gbm_plugin.spectral import EswaranPope, SpectralSolver
from gbm_plugin.studies.paper import flows

from conftest import make_case, run_case

NU = 0.01  # of make_case
FORCE = {"variance": 5e-3, "cutoff": 2.8284, "seed": 4}
STIRRED = "stirring { type eswaranPope; variance 5e-3; timeScale 0.5; cutoff 2.8284; seed 4; }"


@pytest.fixture(scope="module")
def case(tmp_path_factory):
    path = make_case(
        tmp_path_factory.mktemp("flow") / "case", cells=16, steps=40, prepared=False, fv_options=STIRRED
    )
    run_case(path, "--flow", "spectral")
    return path / "spectral"


def test_means_are_those_of_the_run(case):
    (found,) = flows.run([case], settle=(0.2,))["runs"]
    table = read_forcing(case)
    late = table["Time"] > 0.199
    means = {q: m["mean"] for q, m in found["means"].items()}
    assert means["ε"] == pytest.approx(table["epsilonBudget"][late].mean())
    assert means["u'"] == pytest.approx(table["uPrime"][late].mean())
    reynolds = np.sqrt(15 / (NU * table["epsilonBudget"][late])) * table["uPrime"][late] ** 2
    assert means["Re_λ"] == pytest.approx(reynolds.mean())
    assert found["cells"] == 16 and found["fields"] == 4 and found["name"] == "case/spectral"
    assert found["duration"] == pytest.approx(0.62)
    assert found["turnovers"] < 3 and all(m["standard_error"] is None for m in found["means"].values())

    solver = SpectralSolver(16, NU, forcing=EswaranPope(time_scale=0.5, **FORCE), time_step=0.02)
    own = []
    for time in ("0.2", "0.4", "0.6", "0.8"):
        with np.load(case / time / "uniform/flow.npz") as state:
            solver._u[:] = state["coefficients"]
        own.append((solver.statistics(), solver.spectrum()[1]))
    assert means["skewness of ∂u/∂x"] == pytest.approx(
        np.mean([s["velocity_skewness"] for s, _ in own]), rel=1e-9
    )
    assert means["L = (π/2u'²)∫E/k dk"] == pytest.approx(
        np.mean([s["integral_length"] for s, _ in own]), rel=1e-9
    )
    spectrum = np.mean([e for _, e in own], axis=0)[1:6]
    np.testing.assert_allclose(np.array(found["spectrum"])[:5, 1], spectrum, rtol=1e-9)


def test_a_run_stands_beside_its_flow(case):
    """The kept runs of Flow I beside I; one driven a hundred times as hard beside II."""
    result = flows.run([*flows.KEPT, case], settle=(150.0, 20.0, 0.2))
    assert [r["beside"] for r in result["runs"]] == ["I", "I", "II"]
    lines = flows.table(result).splitlines()
    assert lines[0] == "|  | paper, flow I | 64³ | 128³ | paper, flow II | 16³ |"
    assert all(line.count("|") == 7 for line in lines)
    assert flows.draw(result) and len(flows.rows(result)) == 30


def test_what_is_no_run_is_named(tmp_path):
    with pytest.raises(FileNotFoundError, match="nowhere"):
        flows.run([tmp_path / "nowhere"], settle=(1.0,))
    with pytest.raises(ValueError, match="2 numbers for 1 runs"):
        flows.run([tmp_path], settle=(1.0, 2.0))
