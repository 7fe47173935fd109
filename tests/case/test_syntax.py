"""OpenFOAM's dictionary language: what it means is what OpenFOAM makes of it, and nothing in it is run."""

from __future__ import annotations

import pytest

from gbm_plugin.case.dictionary import Dictionary
from gbm_plugin.case.scene import read_scene
from gbm_plugin.case.syntax import Dimensions, SyntaxFault, parse, tokens
from gbm_plugin.errors import CaseError

from conftest import HEADER, make_case

pytestmark = pytest.mark.openfoam


@pytest.fixture
def case(tmp_path):
    return make_case(tmp_path / "case", prepared=False)


def read(text: str) -> dict:
    return parse(tokens(text))


def test_words_lists_dimensions_and_dictionaries():
    assert read('a 1; b (1 2 (3 4)); nu nu [m^2/s] .01; c { d yes; } // x;\n/* e 1; */ f "x;y";') == {
        "a": "1",
        "b": ["1", "2", ["3", "4"]],
        "nu": ("nu", Dimensions(["m^2/s"]), ".01"),
        "c": {"d": "yes"},
        "f": "x;y",
    }
    assert read("div((nuEff*dev2(T(grad(U))))) Gauss linear;") == {
        "div((nuEff*dev2(T(grad(U)))))": ("Gauss", "linear")
    }
    assert read("blocks ( hex (0 1) (4 4) simple{ a 1; } );")["blocks"][-1] == {"a": "1"}


def test_later_entries_override_and_dictionaries_are_merged():
    assert read("a 1; a 2; d { x 1; e { y 1; } } d { z 2; e { y 3; } }") == {
        "a": "2",
        "d": {"x": "1", "z": "2", "e": {"y": "3"}},
    }


@pytest.mark.parametrize(
    "text, expected",
    [
        ("a 1;\nb {\n  c 2;\n", "line 2: the '{' that is opened here is never closed"),
        ("a 1;\n}\nb 2;", "line 2: unexpected '}'"),
        ("a (1 2;\nb 3;", "line 1: the '('"),
        ("a { b (1 2; }", "line 1: unexpected '}': the '(', opened in line 1, is not closed before it"),
        ("a {\n b 2\n}", "line 2: a ';' is missing at its end, behind the entry 'b'"),
        ("a 1\nb { c 1; }", "line 1: a ';' is missing at its end, behind the entry 'a'"),
        (
            "a 1;\nhost 127.0.0.1;",
            "line 2: OpenFOAM does not read '127.0.0.1', which begins like a number: put it in quotes",
        ),
        ("a 12abc;", "does not read '12abc'"),
        ("a 'b';", "line 1"),
    ],
)
def test_faults_are_named_with_their_line(text, expected):
    with pytest.raises(SyntaxFault) as fault:
        read(text)
    assert expected in str(fault.value)


@pytest.mark.parametrize("entry, line", [("nu 1e-2", 3), ("nu [0 2 -1 0 0 0 0] 1", 3)])
def test_a_semicolon_left_out_before_another_entry(case, entry, line):
    """OpenFOAM takes both for one entry, without a word."""
    text = f"{HEADER}\n{entry}\nrest 3;\n"
    (case / "constant/transportProperties").write_text(text)
    with pytest.raises(
        CaseError, match=f"'nu' is .*a number is needed .is a ';' missing at the end of line {line}"
    ):
        read_scene(case)


# rows 4, 5 and 20 of what people report: each of these is 0.01
VISCOSITIES = {
    "include": '#include "nu.inc"',
    "sinclude": '#sinclude "nu.inc"\n#sinclude "not.there"',
    "includeIfPresent": '#includeIfPresent "nu.inc"\n#includeIfPresent "not.there"',
    "path with FOAM_CASE": '#include "$FOAM_CASE/constant/nu.inc"',
    "path with a tag": '#include "<constant>/nu.inc"',
    "environment": "nu $NU;",
    "eval": "nu #eval{ 1e-2 };",
    "eval of entries": 'half 0.005; nu #eval "2*$half";',
    "default": "#default nu 0.01;",
    "if": "#if true\nnu 0.01;\n#else\nnu 2;\n#endif",
    "ifeq": "#ifeq a b\nnu 2;\n#else\nnu 0.01;\n#endif",
    "slash": "visc { air 0.01; } nu $visc/air;",
    "dots and colon": "visc { air 0.01; } nu $:visc.air;",
    "up": "a 0.01; d { e $^a; } nu $d.e;",
    "merged dictionary": "d { nu 0.01; } $d;",
    "point first": "nu .01;",
    "units": "nu [m^2/s] 0.01;",
    "name and units": "nu nu [m^2/s] 0.01;",
}


@pytest.mark.parametrize("way", VISCOSITIES)
def test_ways_to_say_it(way, case, monkeypatch):
    monkeypatch.setenv("NU", "0.01")
    (case / "constant/nu.inc").write_text("nu 0.01;\n")
    (case / "constant/transportProperties").write_text(HEADER + VISCOSITIES[way] + "\n")
    assert read_scene(case).kinematic_viscosity == 0.01


def test_include_from_the_etc_folder(case):
    """#includeEtc: a file that every OpenFOAM brings along."""
    path = case / "constant/extra"
    path.write_text(HEADER + '#includeEtc "caseDicts/postProcessing/probes/probes.cfg"\n')
    assert Dictionary.read(case, "constant/extra").word("type") == "probes"


def test_macros_keep_every_digit(case):
    (case / "constant/extra").write_text(HEADER + "a 6.283185307179586; l ($a 1 $a); b $a;")
    d = Dictionary.read(case, "constant/extra")
    assert d.numbers("l") == [6.283185307179586, 1, 6.283185307179586] and d.number("b") == 6.283185307179586


@pytest.mark.parametrize("code", ['nu #calc "1e-2";', "nu #codeStream { code #{ os << 1; #}; };"])
@pytest.mark.parametrize("place", ["itself", "included"])
def test_code_is_refused_by_name_and_not_run(code, place, case):
    target = case / ("constant/transportProperties" if place == "itself" else "constant/nu.inc")
    (case / "constant/transportProperties").write_text(f'{HEADER}#include "nu.inc"\n')
    target.write_text(f"{HEADER if place == 'itself' else ''}{code}\n")
    with pytest.raises(CaseError, match=r"#calc|#codeStream") as refused:
        read_scene(case)
    assert "transportProperties" in str(refused.value)
    assert not (case / "dynamicCode").exists()


def test_libraries_that_a_case_names_are_not_loaded(case):
    """Reading a controlDict with macros loads nothing: a library of this name would stop OpenFOAM."""
    control = case / "system/controlDict"
    control.write_text(
        control.read_text().replace(
            'libs            ("libgbmPlugin.so");', 'libs ("/tmp/not.so"); x 1; y $x;'
        )
    )
    assert Dictionary.read(case, "system/controlDict").word("y") == "1"


@pytest.mark.parametrize("text", ["nu $nothing;", '#include "not.there"', "nu ${a;", "nu +0.01;"])
def test_what_openfoam_does_not_read_is_refused(text, case):
    (case / "constant/transportProperties").write_text(HEADER + text)
    with pytest.raises(CaseError, match="transportProperties"):
        read_scene(case)


def test_a_misspelt_entry_names_the_nearest(case):
    path = case / "constant/fiberProperties"
    path.write_text(path.read_text().replace("bendingStiffness", "bendingStifness"))
    with pytest.raises(CaseError, match=r"unknown entry 'bendingStifness'.*did you mean bendingStiffness"):
        read_scene(case)
