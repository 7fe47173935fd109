"""The parts of the study of accuracy, small: what theory says of each must be seen in its rows."""

from contextlib import nullcontext

import numpy as np
import pytest

from gbm_plugin.case.beads import bead_error
from gbm_plugin.scales import coupling_error, coupling_step
from gbm_plugin.studies.accuracy import front, integrators, peers, sampling


def test_front():
    rows = [
        {"seconds": 1.0, "error": 1e-2},
        {"seconds": 2.0, "error": 1e-3},
        {"seconds": 2.1, "error": 1e-2},
        {"seconds": 2.1, "error": 9e-4},
    ]
    front.mark_front(rows)
    assert [row["on_front"] for row in rows] == [True, True, False, True]


def test_the_default_over_the_front():
    """Beside what has its error, whatever a worse one takes; in rows alike alone."""
    same = {"flow": "f", "regime": "r", "mobility": "m", "step": 0.1}
    own = same | {"default": True, "seconds": 3.0, "error": 1e-3}
    rows = [
        own,
        same | {"default": False, "seconds": 2.0, "error": 1.1e-3},
        same | {"default": False, "seconds": 1.0, "error": 2e-3},
        own | {"regime": "other"},
    ]
    ratios = integrators.over_the_front(rows)
    assert ratios == {("f", "r", "m", 0.1): 1.5, ("f", "other", "m", 0.1): 1.0}


def test_ab3_and_extrapolation_are_of_third_order(monkeypatch):
    monkeypatch.setattr(integrators, "REGIMES", {"flexible": (0.3, 5, 8)})
    monkeypatch.setattr(integrators, "TOLERANCES", (1e-3,))
    rows = integrators._regime(integrators.cellular(), "freeDrain", "flexible", (0.1, 0.05), 1.0, 1e8)
    errors = [row["error"] for row in rows if row["integrator"] == "ab3"]
    assert errors[0] / errors[1] == pytest.approx(2**3, rel=0.25)
    assert all(row["microseconds"] > 0 for row in rows)


def test_interpolation_against_the_fourier_sum():
    """`exact` is the sum of the modes to rounding, and every further node pays."""
    modes = sampling.random_modes(sampling.spectrum(), seed=1)
    fibers = sampling.Carrier("frozen", None, 2.0, 0.01, 0.45, 1.0).fibers(0.4, 4, 8)
    truth = sampling.exact(modes, fibers.positions.reshape(-1, 3))
    rows = sampling._spectral(modes, fibers, 40, truth)
    errors = {row["word"]: row["velocity_error"] for row in rows}
    assert errors["exact"] < 1e-12
    assert errors["trilinear"] > 3 * errors["cubic"] > 6 * errors["quintic"]
    assert [row["rotation_error"] < 1e-12 for row in rows] == [False, False, False, True]


def test_rule_of_beads_and_of_the_step():
    """What the page says of them: 1 % after two τ, 1e-3 a Kolmogorov time."""
    assert bead_error(20, 1 / 0.15) == pytest.approx(7.5e-3)
    assert coupling_step(1e-3, 1.0) == pytest.approx(0.2714, abs=1e-4)
    assert coupling_error(coupling_step(1e-4, 2.0), 2.0) == pytest.approx(1e-4)


def test_peers_left_out_where_they_cannot_be_installed(monkeypatch):
    """Ours remain: both meet the target with the same beads, and auto is the measure of the times."""
    monkeypatch.setattr(peers.programs, "environment", lambda: nullcontext(None))
    monkeypatch.setattr(peers, "COUNT", 2)
    monkeypatch.setattr(peers, "BEADS", {1e-2: (4, 16)})
    rows = peers.measure(quick=True)
    assert [row["program"] for row in rows] == ["gbm, auto", "AB3, eq. (10)", "AB3, own limit"]
    assert all(row["beads"] == 16 and row["error"] < 1e-2 for row in rows)
    assert rows[0]["over_ours"] == 1
    assert "could not be installed" in peers.lines(rows)[-1]


def test_chains_of_lammps():
    """A data file names every bead, bond and angle of two chains once."""
    lines = peers.programs._chains(np.arange(24.0).reshape(2, 4, 3)).splitlines()
    assert lines[2:5] == ["8 atoms", "6 bonds", "4 angles"]
    bonds = lines[lines.index("Bonds") + 2 :][:6]
    assert [line.split()[2:] for line in bonds[2:4]] == [["3", "4"], ["5", "6"]]
    assert lines[-1].split() == ["4", "1", "6", "7", "8"]
