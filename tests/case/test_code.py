"""What of a case runs code: OpenFOAM's solver, and nothing that only reads."""

from __future__ import annotations

import subprocess

import pytest

from gbm_plugin.case.openfoam import environment
from gbm_plugin.case.scene import read_scene
from gbm_plugin.errors import CaseError

from conftest import gbm, make_case, set_entry

CONSTRUCTOR = """#include <stdio.h>
__attribute__((constructor)) static void run(void) {{ FILE* f = fopen("{}", "w"); if (f) fclose(f); }}
"""
FUNCTIONS = """
libs ("{library}");
functions
{{
    evil {{ type systemCall; libs ("{library}"); executeCalls ("touch {mark}"); writeCalls ("touch {mark}"); }}
}}
"""


@pytest.fixture
def evil(tmp_path):
    """A case whose libraries and function objects leave a mark, and the mark."""
    mark, library = tmp_path / "mark", tmp_path / "libevil.so"
    (tmp_path / "evil.c").write_text(CONSTRUCTOR.format(mark))
    subprocess.run(["cc", "-shared", "-fPIC", "-o", library, tmp_path / "evil.c"], check=True)
    case = make_case(tmp_path / "case", cells=10, steps=1, prepared=False)
    control = case / "system/controlDict"
    control.write_text(control.read_text() + FUNCTIONS.format(library=library, mark=mark))
    return case, mark


@pytest.mark.openfoam
def test_info_and_report_run_nothing(evil):
    """Macros are expanded by a program of OpenFOAM, which loads no library of the case."""
    case, mark = evil
    fibers = case / "constant/fiberProperties"
    fibers.write_text(fibers.read_text().replace("count 12", "count $number") + "families { number 12; }\n")
    assert "$number" in fibers.read_text()
    (case / "postProcessing/linearForcing/0").mkdir(parents=True)
    (case / "postProcessing/linearForcing/0/linearForcing.dat").write_text("# Time k\n0 1\n1 1\n")
    for command in ("info", "report"):
        gbm(command, case)
        assert not mark.exists()
    subprocess.run(["blockMesh", "-case", case], capture_output=True, env=environment())
    assert mark.exists(), "the attack is one: programs of OpenFOAM that make a Time load what the case says"


CODE = {
    "calc": 'number #calc "system(\\"touch {mark}\\")";',
    "codeStream": 'number #codeStream {{ code #{{ system("touch {mark}"); os << 12; #}}; }};',
    "included": '#include "code"',
    "includeFunc": "#includeFunc code",
}


@pytest.mark.parametrize("how", CODE)
def test_code_in_dictionaries_is_refused(how, tmp_path):
    mark = tmp_path / "mark"
    case = make_case(tmp_path / "case", prepared=False)
    fibers = case / "constant/fiberProperties"
    (case / "constant/code").write_text(CODE["codeStream"].format(mark=mark))
    fibers.write_text(fibers.read_text().replace("families", CODE[how].format(mark=mark) + "\nfamilies", 1))
    with pytest.raises(CaseError):
        read_scene(case)
    assert not mark.exists()


@pytest.mark.parametrize("name", ["./evil", "/bin/sh", "../evil", "-help", "a;b", '"rm -rf"', "solver.sh"])
def test_application_is_a_word(name, tmp_path):
    case = make_case(tmp_path / "case", prepared=False)
    set_entry(case / "system/controlDict", "application", f'"{name}"'.replace('""', '"'))
    with pytest.raises(CaseError, match=r"'application'.*on the PATH"):
        read_scene(case)
