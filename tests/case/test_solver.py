"""What gbm says of the solver that a case names."""

from __future__ import annotations

import numpy as np
import pytest

from gbm_plugin.case.disk import needed
from gbm_plugin.case.scene import read_scene
from gbm_plugin.case.solver import DIFFERENCES, face_values, scheme, stable_courant
from gbm_plugin.errors import CaseError

from conftest import HEADER, make_case, set_entry


@pytest.fixture
def path(tmp_path):
    return make_case(tmp_path / "case", cells=32, time_step=0.02, prepared=False, application="boxFoam")


FIRST = {"central2": (1 / 2,), "central4": (2 / 3, -1 / 12), "central6": (3 / 4, -3 / 20, 1 / 60)}


@pytest.mark.parametrize("word, first", FIRST.items())
def test_the_limit_of_stability(path, word, first):
    """Of AB3 on the imaginary axis, 0.7236, over the largest eigenvalue of the difference."""
    theta = np.linspace(0, np.pi, 2001)
    largest = sum(2 * a * np.sin(m * theta) for m, a in enumerate(first, start=1)).max()
    assert DIFFERENCES[word][1] == pytest.approx(0.7236 / largest, abs=0.006)
    set_entry(path / "system/fvSchemes", "differences", word)
    scene = read_scene(path)
    assert scheme(scene) == f"{DIFFERENCES[word][0]} order in space, third in time"
    assert stable_courant(scene) == DIFFERENCES[word][1]


def test_a_word_that_it_does_not_have(path):
    set_entry(path / "system/fvSchemes", "differences", "central8")
    with pytest.raises(CaseError, match=r"central8.*central2 central4 central6"):
        scheme(read_scene(path))


def test_what_the_choice_means(path):
    set_entry(path / "system/controlDict", "application", "pimpleFoam")
    assert "boxFoam solves this box far faster" in scheme(read_scene(path))
    assert stable_courant(read_scene(path)) is None
    mesh = path / "system/blockMeshDict"
    mesh.write_text(mesh.read_text().replace("simpleGrading (1 1 1)", "simpleGrading (2 1 1)"))
    assert "boxFoam" not in scheme(read_scene(path))


def test_it_writes_its_modes(path):
    """Seven numbers of U, p and phi for each cell, and nine of modes in place of pimpleFoam's older fields."""
    cells = 32**3
    own = needed(read_scene(path))["time_folder"]
    set_entry(path / "system/controlDict", "application", "pimpleFoam")
    assert own - needed(read_scene(path))["time_folder"] == pytest.approx((9 - 6) * 8 * cells)


def test_face_values_are_those_that_openfoam_finds(tmp_path):
    """A name before a pattern, that before the default; of patterns the last."""
    (tmp_path / "system").mkdir()
    schemes = tmp_path / "system/fvSchemes"

    def found(gradient: str, fluxes: str) -> tuple[str, str]:
        schemes.write_text(f"gradSchemes {{ {gradient} }} interpolationSchemes {{ {fluxes} }}")
        return face_values(tmp_path)

    assert found("default Gauss linear;", "default linear;") == ("linear", "linear")
    assert found("default Gauss linear; grad(p) Gauss cubic;", "default linear;") == ("cubic", "linear")
    pattern = '"flux.*" leanCubic; default linear;'
    assert found("default Gauss cubic;", pattern) == ("cubic", "cubic")
    assert found("default Gauss linear;", f"flux(HbyA) linear; {pattern}") == ("linear", "linear")
    assert found("default Gauss linear;", f'{pattern} "flux.H.*" linear;') == ("linear", "linear")


def test_a_pattern_that_is_none_is_named(tmp_path):
    (tmp_path / "system").mkdir()
    words = 'gradSchemes { "(grad" Gauss linear; } interpolationSchemes { default linear; }'
    (tmp_path / "system/fvSchemes").write_text(HEADER + words)
    with pytest.raises(CaseError, match=r"gradSchemes.*'\(grad' is no pattern of names"):
        face_values(tmp_path)
