"""What was changed between two parts of a run, in the words of the dictionaries."""

from __future__ import annotations

from gbm_plugin.case.changes import changes

FLUID, FIBERS, CONTROL = "constant/transportProperties", "constant/fiberProperties", "system/controlDict"
SOFT = "rho 1; families { soft { count 3; bendingStiffness 1e-5; } }"


def test_numbers_words_and_families():
    before = {FLUID: "nu 0.01;", FIBERS: SOFT, "constant/fvOptions": "f { type linearForcing; power 0.05; }"}
    now = {
        FLUID: "// thinner\nnu   0.02;",
        FIBERS: SOFT.replace("1e-5", "1e-4").replace("rho 1;", "rho 1; integrator implicit;"),
        "constant/fvOptions": "f { type linearForcing; power 0.05; active no; }",
    }
    assert changes(before, now) == [
        "soft bendingStiffness 1e-5 → 1e-4",
        "integrator none → implicit",
        "nu 0.01 → 0.02",
        "f active none → no",
    ]


def test_a_forcing_that_came_or_went():
    text = "f { type linearForcing; power 0.05; }"
    assert changes({}, {"constant/fvOptions": text}) == ["f type none → linearForcing", "f power none → 0.05"]
    assert changes({"constant/fvOptions": text}, {}) == ["f type linearForcing → none", "f power 0.05 → none"]


def test_what_is_not_physics_is_not_named():
    before = {CONTROL: "endTime 3; deltaT 0.1; writeInterval 5;", FIBERS: f"recordInterval 5; {SOFT}"}
    now = {CONTROL: "endTime 9; deltaT 0.1; writeInterval 1;", FIBERS: f"{SOFT} coupling {{ timeout 3; }}"}
    assert changes(before, now) == []
    now[CONTROL] = "endTime 9; deltaT 0.05;"
    assert changes(before, now) == ["deltaT 0.1 → 0.05"]


def test_dictionaries_with_directives_are_compared_as_a_whole():
    before = {FLUID: "nu #eval{ 0.01 };"}
    assert changes(before, dict(before)) == []
    assert changes(before, {FLUID: "nu #eval{ 0.02 };"}) == [f"{FLUID} edited"]
