"""What a run takes on the disk: estimated before, looked after while it goes on, and logs that end somewhere."""

from __future__ import annotations

import subprocess
import sys
import tempfile
from collections import namedtuple
from pathlib import Path

import pytest

from gbm_plugin.case import disk
from gbm_plugin.case.disk import Room, needed, readable
from gbm_plugin.case.info import describe, figures
from gbm_plugin.case.log import GAP, shorten, summary
from gbm_plugin.case.scene import read_scene
from gbm_plugin.files import created

from conftest import make_case, run_case, set_entry

Usage = namedtuple("Usage", "total used free")
STEP = "Time = {0}\ntime step continuity errors : sum local = 1e-9, global = 2e-19, cumulative = 0\n"
STEP += "ExecutionTime = {0} s  ClockTime = {0} s\n\n"


def size(*folders):
    return sum(p.stat().st_size for folder in folders for p in folder.rglob("*") if p.is_file())


@pytest.mark.openfoam
def test_the_estimate_is_what_a_run_writes(tmp_path):
    """Within a fifth, of fields and of the whole, where fields and beads are more than headers."""
    family = "test { count 500; beads 10; length 1.2; bendingStiffness 1e-4; seed 3; }"
    case = make_case(tmp_path / "case", cells=20, steps=8, write_every=4, families=family, tight=False)
    about = needed(read_scene(case))
    run_case(case)
    folders = [case / "0.08", case / "0.16"]
    assert about["time_folders"] == pytest.approx(size(*folders), rel=0.2)
    assert about["recording"] == pytest.approx(size(case / "postProcessing/fibers"), rel=0.2)


def test_formats_and_what_is_purged(tmp_path):
    case = make_case(tmp_path / "case", cells=20, steps=1000, write_every=10, prepared=False)
    whole = needed(read_scene(case))
    assert whole["time_folders"] == pytest.approx(100 * whole["time_folder"], rel=1e-3)
    set_entry(case / "system/controlDict", "purgeWrite", "2")
    assert needed(read_scene(case))["time_folders"] == pytest.approx(2 * whole["time_folder"], rel=1e-3)
    set_entry(case / "system/controlDict", "writeFormat", "ascii")
    assert needed(read_scene(case))["time_folder"] > 1.5 * whole["time_folder"]
    late = needed(read_scene(case), start=read_scene(case).end_time)
    assert late["total"] == 0


def test_a_word_before_the_disk_is_full(tmp_path, monkeypatch, caplog):
    scene = read_scene(make_case(tmp_path / "case", cells=20, steps=1000, write_every=10, prepared=False))
    need, room = needed(scene), Room(scene)
    free = {"now": 10 * need["total"]}
    monkeypatch.setattr(disk.shutil, "disk_usage", lambda _: Usage(0, 0, free["now"]))
    said = []
    for now in (10 * need["total"], 0.5 * need["total"], 0.4 * need["total"], need["time_folder"], 0):
        free["now"] = now
        room.look(0.0)
        said.append(len(caplog.records))
    assert said == [0, 1, 1, 2, 2]
    assert f"{readable(0.5 * need['total'])} left" in caplog.records[0].getMessage()
    assert "not the room" in " ".join(describe(figures(scene)).split())


@pytest.fixture(params=["disk", "memory"])
def log_folder(request, tmp_path):
    """A folder of a file system that cuts a range out of a file (ext4, XFS) and of one that cannot (tmpfs)."""
    if request.param == "disk":
        yield tmp_path
    else:
        with tempfile.TemporaryDirectory(dir="/dev/shm") as folder:
            yield Path(folder)


def cuts_at_once(folder) -> bool:
    (folder / "probe").write_bytes(bytes(3 * 4096))
    command = ["fallocate", "--collapse-range", "--offset", "4096", "--length", "4096", folder / "probe"]
    return subprocess.run(command, capture_output=True).returncode == 0


def test_a_log_that_another_process_writes_is_shortened(log_folder):
    """Beginning, end and every line that comes later are kept; a second cut tells of the first."""
    log = log_folder / "log.pimpleFoam"
    pause = 0 if cuts_at_once(log_folder) else 1e-3  # where lines come without a pause, one may be lost
    write = (
        "import time\nfor n in range(30000):\n"
        f"    print(f'line {{n:06d}}', flush=n % 100 == 99)\n    n % 100 == 99 and time.sleep({pause})\n"
    )
    with created(log, "a") as output:
        child = subprocess.Popen([sys.executable, "-c", write], stdout=output)
    cuts = 0
    while child.poll() is None:
        if log.stat().st_size > 60_000:
            shorten(log, 60_000, 2000, 20_000)
            cuts += 1
    lines = [line for line in log.read_text().splitlines() if line.strip()]
    assert cuts > 1 and log.stat().st_size < 200_000
    assert lines[:3] == ["line 000000", "line 000001", "line 000002"] and lines[-1] == "line 029999"
    (gap,) = (n for n, line in enumerate(lines) if GAP in line)
    head, tail = ([int(line.split()[1]) for line in part] for part in (lines[:gap], lines[gap + 1 :]))
    assert len(tail) > 1000 and tail == sorted(tail)
    if not pause:
        assert tail == list(range(tail[0], 30_000))
        missing = 12 * (tail[0] - head[-1] - 1)  # bytes, but for a line at each cut
        assert abs(missing - int(lines[gap].split()[1])) <= 12 * cuts


def test_warnings_in_the_middle_of_a_log_are_kept(tmp_path):
    log = tmp_path / "log"
    warning = "--> FOAM Warning : \n    From function f()\n    in file f.C at line {}\n    it is {}\n\n"
    lines = [f"line {n:05d}\n" for n in range(10_000)]
    for n in range(2000, 4000):
        lines[n] += warning.format(7, "odd")
    lines[5000] += warning.format(9, "even odder")
    log.write_text("".join(lines))
    for _ in range(2):
        shorten(log, 20_000, 2000, 5000)
    text = log.read_text()
    assert len(text) < 20_000 and text.endswith("line 09999\n")
    assert text.count("it is odd") == 1 and text.count("it is even odder") == 1


def test_the_summary_says_what_it_saw(tmp_path):
    log = tmp_path / "log"
    log.write_text("".join(STEP.format(n) for n in range(1, 2001)))
    assert summary(log).startswith("2000 steps")
    shorten(log, 20_000, 2000, 5000)
    assert summary(log).startswith("the last ")
