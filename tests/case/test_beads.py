"""`beads auto;`: as many as the rule asks for, and a refusal where it does not hold."""

from __future__ import annotations

import shutil

import pytest

from gbm_plugin.case.beads import bead_error, enough_beads
from gbm_plugin.case.scene import read_scene
from gbm_plugin.errors import CaseError

from conftest import DEFAULT_CASE, HEADER

LENGTH = "length 2; bendingStiffness 1e-5;"


@pytest.fixture
def family(tmp_path):
    path = tmp_path / "case"
    for folder in ("0.orig", "constant", "system"):
        shutil.copytree(DEFAULT_CASE / folder, path / folder, ignore=shutil.ignore_patterns("polyMesh"))

    def read(entries: str, common: str = "", forcing: str | None = None):
        text = f"{common} families {{ a {{ count 1; {entries} }} }}"
        (path / "constant/fiberProperties").write_text(HEADER + text)
        if forcing is not None:
            (path / "constant/fvOptions").write_text(HEADER + forcing)
        return read_scene(path).families[0]

    return read


def test_the_least_number_within_the_error():
    for error, ratio in ((1e-2, 14.0), (1e-3, 0.3), (3e-4, 5.0)):
        beads = enough_beads(error, ratio)
        assert bead_error(beads, ratio) <= error < bead_error(beads - 1, ratio)
    assert enough_beads(1.0, 1.0) == 6


def test_as_many_as_the_scene_needs(family):
    # l_p = K^(1/4)/(μρε)^(1/8) with μ = 0.01, ρ = 1, ε = 0.05
    persistence = 1e-5**0.25 / (0.01 * 0.05) ** 0.125
    chosen = family(f"beads auto; {LENGTH}")
    assert bead_error(chosen.beads, 2 / persistence) <= 1e-2 < bead_error(chosen.beads - 1, 2 / persistence)
    assert chosen.length == 2
    assert family(f"beads auto; beadError 1e-4; {LENGTH}").beads == pytest.approx(10 * chosen.beads, rel=0.05)


@pytest.mark.parametrize(
    "entries, common, forcing, said",
    [
        (f"beads auto; {LENGTH}", "mobility rpy;", None, "aspect ratio"),
        ("beads auto; radius 0.1; bendingStiffness 1e-5;", "", None, "'length' is missing"),
        ("beads auto; length 2; youngModulus 1;", "", None, "'bendingStiffness' is missing"),
        (f"beads auto; {LENGTH}", "", "", "dissipation rate"),
        ("beads auto; length 2; bendingStiffness 0;", "", None, "greater than 0"),
        (f"beads auto; beadError 1e-9; {LENGTH}", "", None, "at most 500"),
        (f"beads many; {LENGTH}", "", None, "a number is needed"),
        (f"beads 20; beadError 1e-2; {LENGTH}", "", None, "unknown entry 'beadError'"),
    ],
)
def test_refused(family, entries, common, forcing, said):
    with pytest.raises(CaseError, match=said):
        family(entries, common, forcing)
