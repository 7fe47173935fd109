"""Distances and collapse of curvatures that were drawn from known distributions."""

import numpy as np
import pytest

from gbm_plugin.output.recording import FamilyRecord
from gbm_plugin.studies.paper import curvature

from known_runs import chains, record_run
from known_runs import persistence as l_p

TIMES = np.arange(60) * 0.5


def family(random, name, stiffness, length, beads, factor=1.0, **model):
    """Each fiber bent evenly, κ̄ l_p log-normal times a factor."""
    radius = length / (2 * beads)
    record = FamilyRecord(name, 60, beads, radius, stiffness, 1, {"integrator": "auto"} | model)

    def positions(time):
        kappa = factor * 0.3 * np.exp(0.4 * random.normal(size=(60, 1))) / l_p(stiffness)
        return chains(random, 60, beads, radius, np.sqrt(1 - np.minimum(2 * radius * kappa, 0.99) ** 2))

    return record, positions


@pytest.fixture(scope="module")
def case(tmp_path_factory):
    random = np.random.default_rng(5)
    families = [family(random, f"K{k:g}_L{n:g}", k, n, 20) for k in (1e-6, 1e-5, 1e-4) for n in (3.0, 5.0)]
    families += [family(random, f"N{n}", 1e-5, 2.0, n, f) for n, f in ((10, 1.2), (20, 1.0), (40, 1.0))]
    families += [family(random, "N40_ab3", 1e-5, 2.0, 40, 1.1, integrator="ab3")]
    return record_run(tmp_path_factory.mktemp("known") / "bent", families, TIMES)


def test_collapse(case):
    found = curvature.run([case], since=0.0, families=["K*"])["collapse"]
    logs = [k**0.25 for k in (1e-6, 1e-5, 1e-4) for _ in range(2)]
    apart = [abs(np.log(a / b)) for i, a in enumerate(logs) for b in logs[:i]]
    assert found["families"] == 5  # one has l_p < 2a
    assert found["width"] == pytest.approx(0.4, rel=0.03)
    assert found["after"] < 2 * found["by_chance"] < 0.05
    whole = curvature.run([case], since=0.0, families=["K1e-05*", "K0.0001*"])["collapse"]
    pairs = [apart[i] for i in (5, 8, 9, 12, 13, 14)]
    assert whole["before"] == pytest.approx(np.mean(pairs), rel=0.05)
    assert whole["exponent_of_l_p"] == pytest.approx(-1, abs=0.03)
    assert whole["exponent_of_L"] == pytest.approx(0, abs=0.03)


def test_beads_and_method(case):
    """Densities whose means differ by a fifth and a tenth are so far apart, and equal ones as far as chance makes."""
    result = curvature.run([case], since=0.0, families=["N*"])
    beads = {r["family"]: r for r in result["beads"]}
    assert beads["N10"]["distance"] == pytest.approx(0.2, rel=0.1)
    # of 3600 log-normal values: 0.0125 is the mean by chance, 0.027 the largest of 200 pairs
    assert beads["N20"]["distance"] < 0.04
    assert beads["N20"]["by_chance"] == pytest.approx(0.0125, rel=0.5)
    assert beads["N40"]["distance"] == 0
    method = {r["family"]: r["distance"] for r in result["method"]}
    assert set(method) == {"N40", "N40_ab3"}
    assert max(method.values()) == pytest.approx(0.1, rel=0.15)
