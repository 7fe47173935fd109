"""γ found again from worm-like chains that were made with it."""

import csv
import json

import numpy as np
import pytest

from gbm_plugin.cli import main
from gbm_plugin.output.recording import FamilyRecord
from gbm_plugin.studies.paper import persistence

from known_runs import chains, record_run
from known_runs import persistence as l_p

GAMMA = 2.5
TIMES = np.arange(40) * 0.5


def family(random, name, stiffness, length, beads, gamma=GAMMA, **model):
    record = FamilyRecord(name, 100, beads, length / (2 * beads), stiffness, 1, model)
    cosine = np.exp(-length / beads / (gamma * l_p(stiffness)))
    return record, lambda time: chains(random, 100, beads, record.radius, cosine)


@pytest.fixture(scope="module")
def case(tmp_path_factory):
    random = np.random.default_rng(3)
    # lengths of 0.6 to 27 l_p; the last has beads wider than l_p, and chains of another γ
    words = [(1e-3, 0.6), (1e-3, 2.0), (1e-4, 2.0), (1e-5, 2.0), (1e-6, 2.0), (1e-6, 4.5)]
    families = [family(random, f"K{k:g}_L{length:g}", k, length, 40) for k, length in words]
    families += [family(random, "coil", 1e-16, 2.0, 40, gamma=20.0)]
    return record_run(tmp_path_factory.mktemp("known") / "wlc", families, TIMES)


def variant(result, name):
    return next(line for line in result["fits"] if line["variant"] == name)


def test_gamma_is_found_again(case):
    result = persistence.run([case], since=0.0)
    whole = variant(result, "all")
    assert whole["points"] == 5  # the shortest is a rod
    assert abs(whole["gamma"] - GAMMA) < 3 * whole["error"] < 0.15
    assert variant(result, "L/l_p from 5 on")["gamma"] == pytest.approx(GAMMA, rel=0.02)
    assert variant(result, "with l_p < 2a")["gamma"] != pytest.approx(GAMMA, rel=0.02)
    # ε from gradients is a tenth lower, l_p ∝ ε^(-1/8), γ ∝ 1/l_p
    assert variant(result, "ε from gradients")["gamma"] == pytest.approx(
        whole["gamma"] * 0.9**0.125, rel=1e-3
    )
    assert variant(result, "eq. (19) as printed, γ in front")["scatter"] > 10 * whole["scatter"]
    assert result["trend"] is None  # too few are bent
    for row in result["rows"][:-1]:
        assert abs(row["gamma"] - GAMMA) < 4 * row["gamma_error"] + 0.01 * GAMMA


def test_ratio_of_each_family(case):
    """Exact for the chains that were made: Σ c^|i−j|/M² over M links."""
    for row in persistence.run([case], since=0.0)["rows"][:-1]:
        links = row["beads"] - 1
        c = np.exp(-row["length_2aN"] / row["beads"] / (GAMMA * row["l_p"]))
        apart = np.abs(np.subtract.outer(np.arange(links), np.arange(links)))
        assert abs(row["R2_over_contour2"] - (c**apart).mean()) < 4 * row["standard_error"] + 1e-12


def test_printed_torque_is_twice_as_stiff(tmp_path):
    random = np.random.default_rng(4)
    words = {"bendingTorque": "asPrinted"}
    record, positions = family(random, "printed", 5e-6, 3.0, 40, gamma=GAMMA * 2**0.25, **words)
    case = record_run(tmp_path / "run", [(record, positions)], TIMES)
    assert persistence.run([case])["rows"][0]["gamma"] == pytest.approx(GAMMA, rel=0.05)


def test_several_runs_from_the_command_line(case, tmp_path, monkeypatch, capsys):
    """A figure, a CSV and a JSON file of one name; runs of one label are told apart."""
    monkeypatch.chdir(tmp_path)
    argv = [
        "study",
        "persistence",
        str(case),
        str(case),
        "--from",
        "5",
        "--from",
        "0",
        "--families",
        "K1e-0[56]*",
    ]
    assert main([*argv, "--save", "found"]) == 0
    assert (tmp_path / "found.png").read_bytes().startswith(b"\x89PNG")
    result = json.loads((tmp_path / "found.json").read_text(), parse_constant=pytest.fail)
    assert (
        len(result["twice"]) == 3 and abs(result["twice"][0]["errors"]) < 1
    )  # the same records, but for the first
    assert [r["from"] for r in result["runs"]] == [5, 0]
    assert {r["run"] for r in result["rows"]} == {"wlc", "wlc (2)"} and len(result["rows"]) == 6
    with (tmp_path / "found.csv").open() as file:
        lines = list(csv.DictReader(file))
    assert float(lines[0]["R2_over_contour2"]) == result["rows"][0]["R2_over_contour2"]
    assert "run wlc (2)" in capsys.readouterr().out


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["--from", "100"], "fewer than two records from t = 100 on"),
        (["--families", "none*"], "no family is named none*"),
        (["--from", "1", "--from", "2"], "--from is given 2 times for 1 runs"),
        (["nowhere"], "there is no folder nowhere"),
        (["."], "no fiber recording"),
    ],
)
def test_bad_input(case, tmp_path, monkeypatch, capsys, words, said):
    monkeypatch.chdir(tmp_path)
    argv = words if not words[0].startswith("--") else [str(case), *words]
    assert main(["study", "persistence", *argv]) == 1
    assert said in capsys.readouterr().err
