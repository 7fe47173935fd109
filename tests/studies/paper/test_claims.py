"""The claims of section 4 judged on fibers that are worm-like chains of γ = 3, as the paper says, and on others."""

import json

import numpy as np
import pytest

from gbm_plugin.cli import main
from gbm_plugin.output.recording import FamilyRecord
from gbm_plugin.studies.paper import curvature, dynamics, end_to_end, persistence, shapes

from known_runs import chains, record_run
from known_runs import persistence as l_p

STUDIES = {"persistence": persistence, "curvature": curvature, "end-to-end": end_to_end, "shapes": shapes}
STUDIES["dynamics"] = dynamics


def written(tmp_path, gamma):
    random = np.random.default_rng(8)
    families = []
    for stiffness, length in ((1e-3, 1.0), (1e-4, 1.0), (1e-5, 1.0), (1e-6, 1.0), (1e-6, 2.0), (1e-7, 2.0)):
        record = FamilyRecord(f"K{stiffness:g}_L{length:g}", 50, 40, length / 80, stiffness)
        cosine = np.exp(-length / 40 / (gamma(length / l_p(stiffness)) * l_p(stiffness)))
        families.append((record, lambda t, r=record, c=cosine: chains(random, 50, 40, r.radius, c)))
    case = record_run(tmp_path / "run", families, np.arange(20) * 1.0)
    for name, study in STUDIES.items():
        (tmp_path / f"{name}.json").write_text(json.dumps(study.run([case], since=0.0)))
    assert main(["study", "claims", "--folder", str(tmp_path), "--json", str(tmp_path / "claims.json")]) == 0
    found = json.loads((tmp_path / "claims.json").read_text())["rows"]
    return {r["claim"]: r["agrees"] for r in found}


@pytest.mark.parametrize(
    ("gamma", "three", "described"),
    [(lambda x: 3.0, "yes", "yes"), (lambda x: 20.0 if x < 5 else 4.5, "no", "no")],
)
def test_verdicts_follow_the_numbers(tmp_path, gamma, three, described):
    verdicts = written(tmp_path, gamma)
    assert verdicts["γ = 3 in the simulations (figure 10)"] == three
    assert verdicts["the data are well described by the model of eq. (19)"] == described
    assert verdicts["Table 1, Flow I: ε = 0.0015, η = 0.0286, Re_λ = 51"] == "yes"
    assert not any("Flow II: ε" in claim for claim in verdicts)
    assert verdicts["Table 2: E = 21 MPa and 2a = 900 μm make K^b = 6.75e-7 N m²"] == "yes"
    assert verdicts["superposed fibers form a sphere: end-to-end vectors are isotropic (figure 6)"] == "yes"
    assert verdicts["γ = 2 in the experiment"] == "cannot be judged"


def test_missing_results(tmp_path, capsys):
    assert main(["study", "claims", "--folder", str(tmp_path)]) == 1
    assert "persistence.json" in capsys.readouterr().err
