"""Several daemons share the fibers: the same fibers, whatever their number and that of the ranks."""

from __future__ import annotations

import os
import re
import shutil
import signal
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from gbm_plugin.case.foamfile import read_list
from gbm_plugin.case.scene import Family, Model, read_scene
from gbm_plugin.case.share import Share, all_shares, shared_files
from gbm_plugin.fleet.cloud import complete_clouds
from gbm_plugin.fleet.fleet import Fleet
from gbm_plugin.flow import TaylorGreen
from gbm_plugin.output.recording import open_recording
from gbm_plugin.report.paraview import polylines

from conftest import divide, gbm, make_case, run_case, set_entry, start_solver
from fakes import children, kill_all_of, last_step, start_gbm, until

pytestmark = pytest.mark.openfoam

STEPS, TIME_STEP = 20, 0.02
FAMILIES = """
    soft { count 7; beads 6; length 1.2; bendingStiffness 1e-5; seed 3; }
    stiff { count 3; beads 4; radius 0.1; bendingStiffness 1e-3; seed 4; integrator implicit; }
"""


def make(path: Path, daemons: int, ranks: int = 1, **options) -> Path:
    make_case(path, steps=STEPS, families=FAMILIES, **{"write_every": 10, **options})
    use_daemons(path, daemons)
    if ranks > 1:
        divide(path, ranks, (1, 1, ranks))
    return path


def use_daemons(case: Path, count: int) -> None:
    properties = case / "constant/fiberProperties"
    text = re.sub(r" daemons \d+;", "", properties.read_text())
    properties.write_text(text.replace("coupling {", f"coupling {{ daemons {count};"))


def recorded(case: Path) -> np.ndarray:
    """Positions (S, B, 3) of all beads at every step."""
    with open_recording(case / "postProcessing/fibers") as recording:
        assert list(recording.steps) == list(range(STEPS + 1))
        families = [f.positions[:].reshape(STEPS + 1, -1, 3) for f in recording.families.values()]
    return np.concatenate(families, axis=1)


@pytest.fixture(scope="module")
def one(tmp_path_factory):
    """The case with one daemon on one rank, done."""
    case = make(tmp_path_factory.mktemp("one") / "case", 1)
    run_case(case)
    return case


@pytest.fixture(scope="module")
def expected(one):
    return recorded(one)


@pytest.mark.parametrize(
    "transport, daemons", [("socket", 3), ("file", 2), pytest.param("tcp", 2, marks=pytest.mark.exhaustive)]
)
def test_on_one_rank_they_move_the_same_fibers(tmp_path, expected, transport, daemons):
    case = make(tmp_path / "case", daemons, transport=transport)
    run_case(case)
    assert len(list(case.glob("postProcessing/fibers/0/fibers.*of*.h5"))) == daemons
    np.testing.assert_array_equal(recorded(case), expected)


@pytest.mark.parametrize("daemons, ranks", [(3, 2), pytest.param(2, 4, marks=pytest.mark.exhaustive)])
def test_on_several_ranks(tmp_path, expected, daemons, ranks):
    case = make(tmp_path / "case", daemons, ranks)
    run_case(case, "--parallel")
    assert np.abs(recorded(case) - expected).max() < 1e-8
    cloud = case / "0.4/lagrangian/fibers"  # reconstructed from the ranks
    labels = {name: _labels(cloud / name) for name in ("family", "fiber", "bead")}
    beads = [(0, f, b) for f in range(7) for b in range(6)] + [
        (1, 7 + f, b) for f in range(3) for b in range(4)
    ]
    assert sorted(zip(*labels.values(), strict=True)) == beads
    # what the report adds finds its beads, whatever order they have
    assert complete_clouds(read_scene(case)) == ["0.2", "0.4"]
    with open_recording(case / "postProcessing/fibers") as recording:
        lines = polylines(recording, -1, wrapped=False).point_data
    order = np.lexsort([labels["bead"], labels["fiber"]])
    for field in ("curvature", "stiffness"):
        np.testing.assert_allclose(read_list(cloud / field)[order], lines[field], rtol=1e-6, atol=1e-9)


def _labels(path: Path) -> list[int]:
    data = path.read_bytes()
    start = re.search(rb"\n(\d+)\n\(", data[data.index(b"// *") :])
    begin = data.index(b"// *") + start.end()
    return np.frombuffer(data, "<i4", int(start[1]), begin).tolist()


def test_their_number_may_change_at_every_restart(tmp_path, one):
    """Bit for bit: each daemon finds the state of its fibers in the files of however many there were."""
    case = make(tmp_path / "case", 1, write_every=5)
    control = case / "system/controlDict"
    for end, daemons in (("0.1", 1), ("0.2", 3), ("0.3", 2), ("0.4", 1)):
        set_entry(control, "endTime", end)
        use_daemons(case, daemons)
        run_case(case)
    np.testing.assert_array_equal(recorded(case), recorded(one))
    with np.load(case / "0.4/uniform/fibers.npz") as a, np.load(one / "0.4/uniform/fibers.npz") as b:
        for name in b.files:
            np.testing.assert_array_equal(a[name], b[name], err_msg=name)


def test_shares_that_took_different_sub_steps_restart_to_the_last_bit(tmp_path):
    """Bent discrete rods ask for shorter sub-steps, those of one share for other ones than those of the other."""
    model = Model(curvature_law="discreteRod")
    family = Family("rods", 20, 8, 1.0, 1e-3, 1, "straight", model)

    def fleets():
        for share in all_shares(2):
            own = family.part(share)
            coupling = SimpleNamespace(feedback=False)
            scene = SimpleNamespace(families=(own,), dynamic_viscosity=1e-2, coupling=coupling)
            yield Fleet.seeded(scene, np.zeros(3), np.ones(3), 0.0, share)

    def step(fleet):
        flow = TaylorGreen(0.3, 4.0 if fleet.share.number == 1 else 0.1)
        fleet.advance(0.02)
        while True:
            provisional = fleet.provisional
            fleet.observe(fleet.time, *flow.sample(fleet.positions, fleet.time, "rotation"))
            if not provisional:
                return
            fleet.correct()

    going, restarted = list(fleets()), list(fleets())
    for fleet in going:
        fleet.observe(0.0, *TaylorGreen(0.3, 1.0).sample(fleet.positions, 0.0, "rotation"))
        for _ in range(8):
            step(fleet)
        fleet.save(tmp_path, 8, fleet.time)
    assert len({fleet.steppers[0].report()["substeps"] for fleet in going}) == 2
    for fleet, again in zip(going, restarted, strict=True):
        again.restore(tmp_path)
        step(fleet)
        step(again)
        np.testing.assert_array_equal(again.positions, fleet.positions)


def test_recordings_of_all_daemons_are_one(one, tmp_path):
    case = make(tmp_path / "case", 2)
    run_case(case)
    whole = recorded(one)
    files = sorted(case.glob("postProcessing/fibers/0/fibers.*of2.h5"))
    for given in (files, files[::-1], files[1:]):
        with open_recording(given) as recording:
            families = [f.positions[:].reshape(STEPS + 1, -1, 3) for f in recording.families.values()]
            np.testing.assert_array_equal(np.concatenate(families, axis=1), whole)
    files[0].unlink()
    with pytest.raises(ValueError, match=r"fibers\.1of2\.h5 beside it is missing"):
        open_recording(files[1])


def test_a_time_without_one_of_the_states_is_not_complete(tmp_path, one):
    case = make(tmp_path / "case", 2, write_every=5)
    set_entry(case / "system/controlDict", "endTime", "0.3")
    run_case(case)
    (case / "0.3/uniform/fibers.2of2.npz").unlink()
    set_entry(case / "system/controlDict", "endTime", "0.4")
    assert "falling back to time 0.2" in run_case(case).stdout
    np.testing.assert_array_equal(recorded(case), recorded(one))


@pytest.mark.parametrize("ranks", [1, 2])
def test_one_of_two_is_killed(tmp_path, ranks):
    case = make(tmp_path / "case", 2, ranks)
    set_entry(case / "system/controlDict", "endTime", "1000")
    run = start_gbm("run", case, *(["--parallel"] if ranks > 1 else []))
    try:
        until(lambda: last_step(case) >= 8, "step 8")
        victim = next(pid for pid in _daemons(run.pid) if _words(pid)[-1] == "2")
        others = [pid for pid in (*_daemons(run.pid), children(run.pid)["solver"]) if pid != victim]
        os.kill(victim, signal.SIGKILL)
        output, _ = run.communicate()
        assert run.returncode == 1
        errors = [line for line in output.splitlines() if line.startswith("gbm run: ")]
        assert len(errors) == 1 and "daemon 2 of 2 was ended by SIGKILL" in errors[0], output
        assert "log.gbmDaemon.2of2" in errors[0]
        assert not any(os.path.exists(f"/proc/{pid}") for pid in others)
        with open_recording(case / "postProcessing/fibers") as recording:
            assert len(recording.times) >= 8
    finally:
        kill_all_of(case)
        run.kill()
        run.wait()


def _words(pid: int) -> list[str]:
    return Path(f"/proc/{pid}/cmdline").read_text().strip("\0").split("\0")


def _daemons(pid: int) -> list[int]:
    found = map(int, Path(f"/proc/{pid}/task/{pid}/children").read_text().split())
    return [child for child in found if "daemon" in _words(child)]


@pytest.mark.parametrize(
    "daemons, options, expected",
    [
        (2, (), "2 daemons share the fibers of"),
        (2, ("--share", "3"), "--share 3: "),
        (1, ("--share", "2"), "allowed: 1 ... 1"),
        (0, (), "'daemons' is 0"),
        (4, ("--share", "1"), "4 daemons cannot share the 3 fibers of family stiff"),
    ],
)
def test_wrong_numbers(tmp_path, daemons, options, expected):
    case = make(tmp_path / "case", daemons)
    done = gbm("daemon", case, *options)
    assert done.returncode == 1 and expected in done.stderr and len(done.stderr.splitlines()) == 1


def test_a_solver_that_counts_other_daemons(tmp_path, one):
    """The dictionary was edited between the start of the daemon and that of the solver."""
    case = tmp_path / "case"
    shutil.copytree(one, case, ignore=shutil.ignore_patterns("0.[0-9]*", "postProcessing", "log.*"))
    set_entry(case / "constant/fiberProperties", "recordInterval", "1")
    use_daemons(case, 2)
    daemon = start_gbm("daemon", case, "--share", "1")
    try:
        until(lambda: (case / "gbm.1of2.sock").exists(), "the daemon's socket")
        use_daemons(case, 1)
        (case / "gbm.sock").symlink_to("gbm.1of2.sock")
        assert start_solver(case).wait() == 1
        output, _ = daemon.communicate()
        assert "OpenFOAM takes this for the daemon, and it is daemon 1 of 2" in output
    finally:
        daemon.kill()
        daemon.wait()


def test_shares_divide_every_family():
    for of in (1, 2, 3, 7):
        for count in (7, 8, 100):
            parts = [share.part(count) for share in all_shares(of)]
            assert [i for part in parts for i in range(count)[part]] == list(range(count))
            assert np.ptp([part.stop - part.start for part in parts]) <= 1


def test_the_newest_whole_set_of_files_counts(tmp_path):
    for time, share in enumerate([Share(), Share(1, 2), Share(2, 2), Share(1, 3), Share(3, 3)]):
        path = tmp_path / share.name("fibers", ".h5")
        path.touch()
        os.utime(path, (time, time))
    names = [path.name for path in shared_files(tmp_path, "fibers", ".h5")]
    assert names == ["fibers.1of2.h5", "fibers.2of2.h5"]
    assert shared_files(tmp_path, "fibers", ".npz") == []
