"""The list of studies, all of them on one run, and the page of a run."""

import re

import numpy as np
import pytest

from gbm_plugin.cli import main
from gbm_plugin.output.recording import FamilyRecord
from gbm_plugin.studies.paper.turbulence import NAMES

from known_runs import record_run, rods, unit


def test_list(capsys):
    assert main(["study", "turbulence"]) == 0
    said = capsys.readouterr().out
    assert all(f"    {name} " in said for name in NAMES)


def test_page_of_a_run(tmp_path, capsys):
    """Bent fibers only: rods are not made, and it says so; the page holds every picture of the rest."""

    def bent(time):
        p = unit(np.random.default_rng(round(100 * time)).normal(size=(8, 3)))
        x = rods(p, 6, 0.1)
        x[:, 3:] = x[:, 2::-1] + 0.05
        return x

    case = record_run(tmp_path / "bent", [(FamilyRecord("bent", 8, 6, 0.1, 1e-5), bent)], 0.1 * np.arange(12))
    assert main(["report", str(case)]) == 0
    folder = case / "report"
    page = (folder / "index.html").read_text()
    made = [name for name in NAMES if (folder / f"{name}.png").is_file()]
    assert made == [name for name in NAMES if name not in ("rods", "gathered")]
    assert (
        len(re.findall(r'src="data:image/png;base64,', page)) == len(made) + 3
    )  # fibers, energy, end_to_end
    assert "rods: no family is straight" in page and 'src="http' not in page
    assert "index.html" in capsys.readouterr().out


ODD = {
    "two beads, straight to rounding": (4, 2, 1e-5),
    "one fiber without stiffness": (1, 6, 0.0),
    "one fiber, nearly rigid": (1, 6, 1e9),
}


@pytest.mark.filterwarnings("error")
@pytest.mark.parametrize("odd", ODD)
def test_an_odd_run_is_measured_or_refused_in_one_line(odd, tmp_path, capsys):
    count, beads, stiffness = ODD[odd]

    def moving(time):
        p = unit(np.random.default_rng(round(100 * time)).normal(size=(count, 3)))
        return rods(p, beads, 0.1)

    record = FamilyRecord("odd", count, beads, 0.1, stiffness)
    case = record_run(tmp_path / "odd", [(record, moving)], 0.1 * np.arange(12))
    for name in NAMES:
        done = main(["study", name, str(case)])
        said = capsys.readouterr()
        assert (done == 0) == (not said.err), name
        assert "nan" not in said.out and len(said.err.splitlines()) <= 1, name
        assert done == 0 or re.search(
            "more than two beads|no statistics.h5|no family is straight", said.err
        ), name
