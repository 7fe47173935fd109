"""Where a run continues, and what is set aside for it."""

from __future__ import annotations

import logging

import pytest

from gbm_plugin.case.times import Start, choose_start, is_complete, set_aside, time_folders

END, STEP = 1.0, 0.1
WHOLE = "FoamFile { class volVectorField; }\ninternalField uniform (0 0 0);\n// ************* //\n"


@pytest.fixture
def case(tmp_path):
    write(tmp_path, "system/controlDict", "FoamFile { class dictionary; }\nstartFrom latestTime;\n")
    for folder in ("0.orig", "0"):
        write(tmp_path, f"{folder}/U", WHOLE)
    return tmp_path


def write(case, name: str, text: str = "x") -> None:
    (case / name).parent.mkdir(parents=True, exist_ok=True)
    (case / name).write_text(text)


def add_time(case, name: str, *, state: bool = True, field: str | None = WHOLE, processors: int = 0) -> None:
    folders = [f"processor{i}/{name}" for i in range(processors)] or [name]
    for folder in folders:
        if field is not None:
            write(case, f"{folder}/U", field)
    if state:
        write(case, f"{folders[0]}/uniform/fibers.npz")


def add_output(case, start: str) -> None:
    write(case, f"postProcessing/fibers/{start}/fibers.h5")
    write(case, f"postProcessing/linearForcing/{start}/linearForcing.dat")


def start(case, fresh: bool = False, end: float = END) -> Start:
    return choose_start(case, 0.0, end, STEP, fresh)


def names(folder) -> set[str]:
    return (
        {str(p.relative_to(folder)) for p in folder.rglob("*") if p.is_file()} if folder.is_dir() else set()
    )


def test_first_run(case):
    assert start(case) == Start(0.0, False)
    assert not (case / "previous").exists() and (case / "0/U").is_file()


def test_unfinished_run_continues_from_its_latest_time(case):
    add_output(case, "0")
    for name in ("0.2", "0.4", "1e-05"):
        add_time(case, name)
    assert start(case) == Start(0.4, True)
    assert not (case / "previous").exists()


@pytest.mark.parametrize(
    "defect",
    [{"state": False}, {"field": None}, {"field": WHOLE[:-20]}, {"field": "FoamFile"}],
    ids=["no fibers", "no velocity", "cut off", "nearly empty"],
)
@pytest.mark.parametrize("processors", [0, 2])
def test_falls_back_to_the_latest_complete_time(case, defect, processors, caplog):
    add_output(case, "0")
    add_time(case, "0.2", processors=processors)
    add_time(case, "0.4", processors=processors, **defect)
    add_output(case, "0.2")  # of the attempt that wrote 0.4
    before = names(case)
    with caplog.at_level(logging.INFO):
        assert start(case) == Start(0.2, True)
    assert "time 0.4 is not complete" in caplog.text and "falling back to time 0.2" in caplog.text
    prefix = "processor0/" if processors else ""
    assert not (case / f"{prefix}0.4").exists() and (case / f"{prefix}0.2/U").exists()
    assert (case / "previous/1/postProcessing/fibers/0.2/fibers.h5").is_file()
    assert (case / "postProcessing/fibers/0/fibers.h5").is_file()
    moved = names(case / "previous/1")
    assert (
        moved and before == {n for n in names(case) if not n.startswith("previous")} | moved
    )  # nothing is lost


def test_one_truncated_rank_makes_a_time_incomplete(case):
    add_time(case, "0.2", processors=2)
    assert is_complete(case, "0.2")
    write(case, "processor1/0.2/p", WHOLE[:-20])
    assert not is_complete(case, "0.2")


def test_files_that_are_not_openfoams_may_end_as_they_like(case):
    add_time(case, "0.2")
    write(case, "0.2/notes.txt", "a remark")
    write(case, "0.2/empty", "")
    assert is_complete(case, "0.2")


def test_killed_before_the_first_write(case):
    add_output(case, "0")
    write(case, "log.pimpleFoam")
    assert start(case) == Start(0.0, False)
    moved = names(case / "previous/1")
    assert {"postProcessing/fibers/0/fibers.h5", "log.pimpleFoam", "0/U"} <= moved


def test_nothing_complete_begins_again_and_keeps_everything(case, caplog):
    add_output(case, "0")
    add_time(case, "0.2", state=False)
    with caplog.at_level(logging.INFO):
        assert start(case) == Start(0.0, False)
    assert "no time folder is complete" in caplog.text
    assert "0.2/U" in names(case / "previous/1")


def test_flow_without_fibers_gets_some(case):
    """A developed flow of somebody's own: nothing of it is moved."""
    add_time(case, "0.2", state=False)
    add_time(case, "0.4", state=False)
    assert start(case) == Start(0.4, True)
    assert not (case / "previous").exists()


def test_finished_run_stays_and_fresh_repeats_it(case):
    add_output(case, "0")
    add_time(case, "1")
    before = names(case)
    assert start(case) == Start(1.0, True, complete=True) and names(case) == before
    for number in (1, 2):
        add_output(case, "0")
        add_time(case, "1")
        write(case, "report/report.json")
        assert start(case, fresh=True) == Start(0.0, False)
        assert {"1/U", "report/report.json", "postProcessing/fibers/0/fibers.h5"} <= names(
            case / f"previous/{number}"
        )
    assert (case / "0.orig/U").is_file()


def test_raised_end_continues(case):
    add_time(case, "1")
    assert start(case, end=2.0) == Start(1.0, True)


def test_fresh_on_request(case):
    add_output(case, "0")
    add_time(case, "0.4")
    assert start(case, fresh=True) == Start(0.0, False)
    assert "0.4/U" in names(case / "previous/1")


def test_case_without_original_fields_keeps_its_0(case):
    (case / "0.orig/U").unlink()
    (case / "0.orig").rmdir()
    add_output(case, "0")
    set_aside(case, 0.0, everything=True)
    assert (case / "0/U").is_file()


def test_time_folders_of_ranks_count(case):
    add_time(case, "0.2")
    add_time(case, "0.40", processors=2)
    write(case, "processor0/constant/polyMesh/points")
    assert time_folders(case) == {0.0: "0", 0.2: "0.2", 0.4: "0.40"}
