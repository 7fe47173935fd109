"""Every way to begin: startFrom x serial or parallel x own or generated 0 x what an earlier call left.

Each does what the README says or is refused in one line; OpenFOAM's utilities are real, no solver runs.
"""

from __future__ import annotations

import itertools
import re
import shutil
from pathlib import Path

import numpy as np
import pytest

from gbm_plugin.case.initial import END
from gbm_plugin.case.layout import numbered, processors
from gbm_plugin.case.openfoam import utility
from gbm_plugin.case.prepare import prepare, ranks_of
from gbm_plugin.case.scene import read_scene
from gbm_plugin.case.times import Start, choose_start
from gbm_plugin.errors import CaseError, GbmError

from conftest import make_case, set_entry

pytestmark = pytest.mark.openfoam

WORDS = ("latestTime", "startTime", "firstTime")
RANKS = {"serial": 1, "parallel": 2}
ZEROS = ("generated", "own")
OWN = "uniform (1 0 0)"


@pytest.fixture(scope="module")
def template(tmp_path_factory) -> Path:
    """A case of 8^3 cells in which nothing was done yet."""
    path = make_case(tmp_path_factory.mktemp("template") / "case", cells=8, steps=20, prepared=False)
    set_entry(path / "system/initialFieldDict", "maxWavenumber", "3")
    return path


@pytest.fixture
def make(template, tmp_path):
    def make(word: str, zero: str) -> Path:
        case = tmp_path / "case"
        shutil.copytree(template, case)
        set_entry(case / "system/controlDict", "startFrom", word)
        if zero == "own":
            shutil.copytree(case / "0.orig", case / "0")
            u = case / "0/U"
            u.write_text(u.read_text().replace("uniform (0 0 0)", OWN))
            (case / "system/initialFieldDict").unlink()
        return case

    return make


def begin(case: Path, ranks: int, fresh: bool = False) -> Start:
    """What `gbm run` does before it starts processes."""
    scene = read_scene(case)
    start = choose_start(case, scene.start_time, scene.end_time, scene.time_step, fresh, scene.start_from)
    if not start.complete:
        prepare(scene, start, ranks_of(case, ranks > 1))
    return start


def add_run(case: Path, ranks: int, *times: str, state: bool = True) -> None:
    """What a run of so many ranks leaves at these times."""
    for name in times:
        for folder in processors(case) if ranks > 1 else [case]:
            shutil.copytree(folder / "0", folder / name)
            for field in (folder / name).iterdir():
                field.write_bytes(field.read_bytes() + f"\n{END}\n".encode())
        first = processors(case)[0] if ranks > 1 else case
        if state:
            (first / name / "uniform").mkdir()
            (first / name / "uniform/fibers.npz").write_text("x")
    (case / "postProcessing/fibers/0").mkdir(parents=True, exist_ok=True)
    (case / "postProcessing/fibers/0/fibers.h5").write_text("x")


def tree(folder: Path, *without: str) -> dict[str, bytes]:
    files = (p for p in folder.rglob("*") if p.is_file() and not p.name.startswith((".gbm", "log.")))
    found = {str(p.relative_to(folder)): p.read_bytes() for p in files}
    return {name: data for name, data in found.items() if not name.startswith(without or "\0")}


def check_beginning(case: Path, ranks: int, zero: str) -> None:
    """Mesh, a 0 with the velocity that it must have, divided as the ranks need it."""
    assert (case / "constant/polyMesh/points").is_file()
    u = (case / "0/U").read_bytes()
    assert (OWN.encode() in u) if zero == "own" else (b"nonuniform" in u and len(u) > 24 * 8**3)
    assert len(processors(case)) == (ranks if ranks > 1 else 0)
    for folder in processors(case):
        assert (folder / "0/U").is_file() and (folder / "constant/polyMesh/points").is_file()
    assert not list(case.glob(".0.*"))


PAIRS = list(itertools.product(WORDS, RANKS, ZEROS))
every_way = pytest.mark.parametrize("word, how, zero", PAIRS, ids=["-".join(pair) for pair in PAIRS])


@every_way
def test_first_call(word, how, zero, make):
    case = make(word, zero)
    assert begin(case, RANKS[how]) == Start(0.0, False)
    check_beginning(case, RANKS[how], zero)
    assert not (case / "previous").exists()


@every_way
def test_unfinished_run(word, how, zero, make):
    case, ranks = make(word, zero), RANKS[how]
    begin(case, ranks)
    add_run(case, ranks, "0.1", "0.2")
    before = tree(case)
    if word == "latestTime":
        assert begin(case, ranks) == Start(0.2, True)
    else:
        with pytest.raises(
            CaseError, match=f"startFrom {word} OpenFOAM would begin again.*up to 0.2.*--fresh"
        ):
            begin(case, ranks)
    assert tree(case) == before


@every_way
def test_fresh_on_request(word, how, zero, make):
    case, ranks = make(word, zero), RANKS[how]
    begin(case, ranks)
    add_run(case, ranks, "0.1", "0.2")
    before = tree(case, "processor")
    assert begin(case, ranks, fresh=True) == Start(0.0, False)
    check_beginning(case, ranks, zero)
    previous = case / "previous/1"
    times = processors(previous)[0] if ranks > 1 else previous
    assert {0.1, 0.2} <= set(numbered(times))
    assert (previous / "postProcessing/fibers/0/fibers.h5").is_file()
    assert (previous / "0").is_dir() == (zero == "generated")  # nothing could replace the user's own
    now = tree(case, "processor", "previous")
    assert {name: data for name, data in before.items() if not re.match(r"0\.[12]|post", name)} == now


@every_way
def test_finished_run(word, how, zero, make):
    case, ranks = make(word, zero), RANKS[how]
    begin(case, ranks)
    add_run(case, ranks, "0.4")
    before = tree(case)
    assert begin(case, ranks) == Start(0.4, True, complete=True)
    assert tree(case) == before


@every_way
def test_after_a_kill_before_the_first_complete_write(word, how, zero, make):
    case, ranks = make(word, zero), RANKS[how]
    begin(case, ranks)
    add_run(case, ranks, "0.1", state=False)
    if word == "latestTime":
        assert begin(case, ranks) == Start(0.0, False)
        check_beginning(case, ranks, zero)
        times = processors(case / "previous/1")[0] if ranks > 1 else case / "previous/1"
        assert 0.1 in numbered(times)
    else:
        with pytest.raises(CaseError, match="--fresh"):
            begin(case, ranks)


def _no_block(case):
    set_entry(case / "system/blockMeshDict", "n", "-1")
    return lambda: set_entry(case / "system/blockMeshDict", "n", "8")


def _modes_that_do_not_fit(case):
    if not (case / "system/initialFieldDict").is_file():
        return _no_block(case)
    set_entry(case / "system/initialFieldDict", "maxWavenumber", "9")
    return lambda: set_entry(case / "system/initialFieldDict", "maxWavenumber", "3")


def _half_a_decomposition(case):
    set_entry(case / "system/decomposeParDict", "method", "nothing")
    return lambda: set_entry(case / "system/decomposeParDict", "method", "simple")


@pytest.mark.parametrize("fault", [_no_block, _modes_that_do_not_fit, _half_a_decomposition])
@every_way
def test_after_a_preparation_that_failed(word, how, zero, fault, make):
    """The second call fails as the first did; once the mistake is mended the case begins as if there had been none."""
    case, ranks = make(word, zero), RANKS[how]
    mend = fault(case)
    if fault is not _half_a_decomposition or ranks > 1:
        for _ in range(2):
            with pytest.raises(GbmError):
                begin(case, ranks)
    mend()
    assert begin(case, ranks) == Start(0.0, False)
    check_beginning(case, ranks, zero)


@pytest.mark.parametrize("how", RANKS)
def test_killed_in_the_middle_of_preparation(how, make):
    """A mesh cut off, initial fields and a decomposition half-way."""
    case, ranks = make("latestTime", "generated"), RANKS[how]
    begin(case, ranks)
    whole = tree(case, "processor", "previous")
    made = case / ".gbm.made"
    made.write_text(
        re.sub(r'"mesh": \{.*?\n \}', '"mesh": {"files": null}', made.read_text(), flags=re.DOTALL)
    )
    assert '"mesh": {"files": null}' in made.read_text()
    (case / "constant/polyMesh/points").write_bytes(b"FoamFile")
    shutil.rmtree(case / "0")
    (case / ".0.part").mkdir()
    for folder in processors(case)[1:]:
        shutil.rmtree(folder / "0")
    assert begin(case, ranks) == Start(0.0, False)
    check_beginning(case, ranks, "generated")
    assert tree(case, "processor", "previous") == whole


def test_other_number_of_ranks_continues(make):
    """Serial, then parallel, then serial: nothing is lost on the way."""
    case = make("latestTime", "generated")
    begin(case, 1)
    add_run(case, 1, "0.2")
    assert begin(case, 2) == Start(0.2, True)
    assert len(processors(case)) == 2
    assert (case / "processor0/0.2/uniform/fibers.npz").is_file()  # -copyUniform
    for folder in processors(case):
        shutil.rmtree(folder / "0.2")  # killed while decomposing
    assert begin(case, 2) == Start(0.2, True)
    assert all((folder / "0.2/U").is_file() for folder in processors(case))
    assert begin(case, 1) == Start(0.2, True)
    assert not processors(case) and (case / "0.2/uniform/fibers.npz").is_file()


# --- whose 0, whose mesh, whose folder ----------------------------------------------------------------------


def test_generated_0_follows_its_dictionaries(make):
    case = make("latestTime", "generated")
    begin(case, 1)
    first = (case / "0/U").read_bytes()
    set_entry(case / "system/initialFieldDict", "seed", "2")
    begin(case, 1)
    assert (case / "0/U").read_bytes() != first
    assert not (case / "previous").exists()


def test_0_that_was_edited_is_the_users(make):
    case = make("latestTime", "generated")
    begin(case, 1)
    u = case / "0/U"
    u.write_text(re.sub(r"internalField[^;]*;", f"internalField {OWN};", (case / "0.orig/U").read_text()))
    add_run(case, 1, "0.2")
    begin(case, 1, fresh=True)
    assert OWN in u.read_text()


def test_0_stays_where_nothing_can_replace_it(make):
    """Row 19: the template lost its U after the first run."""
    case = make("latestTime", "generated")
    begin(case, 1)
    (case / "0.orig/U").unlink()
    (case / "system/initialFieldDict").unlink()
    add_run(case, 1, "0.2")
    begin(case, 1, fresh=True)
    assert (case / "0/U").is_file() and (case / "previous/1/0.2").is_dir()


def test_mesh_of_gbm_follows_blockmeshdict(make):
    case = make("latestTime", "generated")
    begin(case, 1)
    set_entry(case / "system/blockMeshDict", "n", "10")
    begin(case, 1)
    assert read_scene(case).cells == (10, 10, 10)


OTHERS = {
    "by blockMesh": lambda case: utility(case, "blockMesh"),
    "moved": lambda case: (begin(case, 1), utility(case, "transformPoints", "-scale", "(0.5 0.5 0.5)")),
    "a link": lambda case: (
        utility(case, "blockMesh"),
        (case / "constant/polyMesh").rename(case / "mesh"),
        (case / "constant/polyMesh").symlink_to("../mesh"),
    ),
    "a link to a mesh of gbm": lambda case: (
        begin(case, 1),
        (case / "constant/polyMesh").rename(case / "mesh"),
        (case / "constant/polyMesh").symlink_to("../mesh"),
    ),
}


@pytest.mark.parametrize("whose", OTHERS)
def test_mesh_of_others_is_never_made_again(whose, make, caplog):
    """Row 16: and where blockMeshDict describes another one, a line says so; the fields fit the mesh."""
    case = make("latestTime", "generated")
    OTHERS[whose](case)
    mesh = (case / "constant/polyMesh/points").read_bytes()
    set_entry(case / "system/blockMeshDict", "n", "10")
    shutil.rmtree(case / "0", ignore_errors=True)
    with caplog.at_level("INFO"):
        begin(case, 1)
    assert (case / "constant/polyMesh/points").read_bytes() == mesh
    assert "constant/polyMesh, which decides, has 8 x 8 x 8 cells" in caplog.text
    scene = read_scene(case)
    assert scene.cells == (8, 8, 8)
    width = np.pi if whose == "moved" else 2 * np.pi
    np.testing.assert_allclose(scene.box, width, rtol=1e-9)
    check_beginning(case, 1, "generated")


def test_comment_in_blockmeshdict_changes_nothing(make, caplog):
    case = make("latestTime", "generated")
    utility(case, "blockMesh")
    with (case / "system/blockMeshDict").open("a") as file:
        file.write("// a comment\n")
    begin(case, 1)
    assert "polyMesh" not in caplog.text


def test_blockmeshdict_that_nobody_needs(make):
    """Row 18: #calc in it, and a mesh there."""
    case = make("latestTime", "generated")
    utility(case, "blockMesh")
    set_entry(case / "system/blockMeshDict", "n", '#calc "8"')
    assert read_scene(case).cells == (8, 8, 8)
    begin(case, 1)


@pytest.mark.parametrize("name", ["1_0", "infinity", "2nd", "1e", "0x3", "٣"])
def test_folders_of_the_user_that_are_no_times(name, make):
    case = make("latestTime", "generated")
    (case / name).mkdir()
    (case / name / "notes").write_text("mine")
    assert begin(case, 1) == Start(0.0, False)
    add_run(case, 1, "0.2")
    begin(case, 1, fresh=True)
    assert (case / name / "notes").read_text() == "mine"


def test_folder_of_the_user_that_openfoam_takes_for_a_time(make):
    case = make("latestTime", "generated")
    (case / "2024").mkdir()
    (case / "2024/notes").write_text("mine")
    with pytest.raises(CaseError, match=r"2024 has the name of a time.*rename it"):
        begin(case, 1)


# --- a developed flow, and what function objects wrote ------------------------------------------------------


def developed(case: Path) -> None:
    """A flow of the user's at times 5 and 10, without fibers."""
    begin(case, 1)
    set_entry(case / "system/controlDict", "endTime", "11")
    for name in ("5", "10"):
        shutil.copytree(case / "0", case / name)


def test_fibers_in_a_developed_flow_begin_at_its_end(make):
    case = make("latestTime", "generated")
    developed(case)
    assert begin(case, 1) == Start(10.0, True)
    for fresh in (False, True):  # killed before the first write; and again on request
        (case / "postProcessing/fibers/10").mkdir(parents=True)
        (case / "postProcessing/fibers/10/fibers.h5").write_text("x")
        shutil.copytree(case / "0", case / "10.1")
        assert begin(case, 1, fresh).time == 10
        assert {0, 5, 10} <= set(numbered(case))
        assert (case / f"previous/{1 + fresh}/10.1").is_dir()


def test_what_a_function_object_wrote_before_a_restart_stays(make):
    """At the time of the restart it is not written again; what is later is, and is kept aside."""
    case = make("latestTime", "generated")
    begin(case, 1)
    add_run(case, 1, "0.2")
    add_run(case, 1, "0.3", state=False)
    for name in ("0.1", "0.2", "0.3"):
        (case / "postProcessing/cut" / name).mkdir(parents=True)
        (case / "postProcessing/cut" / name / "U.vtk").write_text("x")
    assert begin(case, 1) == Start(0.2, True)
    assert set(numbered(case / "postProcessing/cut")) == {0.1, 0.2}
    assert set(numbered(case / "previous/1/postProcessing/cut")) == {0.3}


def test_a_start_that_is_not_there(make):
    case = make("startTime", "own")
    set_entry(case / "system/controlDict", "startTime", "2")
    set_entry(case / "system/controlDict", "endTime", "3")
    with pytest.raises(CaseError, match="no time folder 2 to begin with"):
        begin(case, 1)


def test_times_before_starttime_are_where_latesttime_begins(make):
    case = make("latestTime", "own")
    (case / "0").rename(case / "1")
    set_entry(case / "system/controlDict", "startTime", "2")
    set_entry(case / "system/controlDict", "endTime", "3")
    assert begin(case, 1) == Start(1.0, False)
