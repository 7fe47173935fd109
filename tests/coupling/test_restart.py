"""A run that was killed, stopped, divided differently or extended equals the one that was not.

boxFoam where a finished run is the beginning, as it is quick; pimpleFoam where a run is to be caught in the middle, and
for its schemes.
"""

from __future__ import annotations

import re
import shutil
import signal

import numpy as np
import pytest

from gbm_plugin.output.recording import open_recording
from gbm_plugin.output.tables import read_dat

from conftest import gbm, make_case, run_case, set_entry
from fakes import Run, kill_all_of

pytestmark = pytest.mark.openfoam

STEPS, TIME_STEP = 20, 0.02
BACKWARD = "backward"
SCHEMES = ("Euler", BACKWARD, "CrankNicolson 0.9")


def field(file) -> np.ndarray:
    """The numbers of a binary OpenFOAM field, internal ones only."""
    data = file.read_bytes()
    start = re.search(rb"internalField\s+nonuniform List<(\w+)>\s*\n(\d+)\n\(", data)
    width = {b"vector": 3, b"scalar": 1}[start.group(1)]
    return np.frombuffer(data, "<f8", int(start.group(2)) * width, start.end())


def final(case, time: float = STEPS * TIME_STEP) -> dict[str, np.ndarray]:
    """Flow and fibers of a serial case at a time."""
    folder = case / f"{time:.8g}"
    values = {name: field(folder / name) for name in ("U", "p", "phi")}
    with np.load(folder / "uniform/fibers.npz") as state:
        values |= {name: state[name] for name in state.files if state[name].dtype.kind == "f"}
    return values


def distance(a: dict, b: dict) -> float:
    """Largest difference of anything at all."""
    assert a.keys() == b.keys()
    finite = [np.isfinite(a[name]) for name in a]
    return max(float(np.abs(a[n][f] - b[n][f]).max(initial=0)) for n, f in zip(a, finite, strict=True))


def check_series(case, steps: int = STEPS) -> None:
    """Every table and the recording hold each step once, over all restarts."""
    with open_recording(case / "postProcessing/fibers") as recording:
        assert list(recording.steps) == list(range(steps + 1))
        np.testing.assert_allclose(recording.times, TIME_STEP * np.arange(steps + 1), atol=1e-12)
        x = recording.families["test"].positions[:]
        assert x.shape[0] == steps + 1
        assert np.abs(np.diff(x, axis=0)).max() < 5 * TIME_STEP  # no jump: |u| < 5
    for folder, name in (
        ("linearForcing", "linearForcing.dat"),
        ("fibers", "daemon.dat"),
        ("fibers", "coupling.dat"),
    ):
        table = read_dat(case / "postProcessing" / folder, name)
        np.testing.assert_allclose(table["Time"], TIME_STEP * np.arange(steps + 1), atol=1e-9, err_msg=name)


def use_scheme(case, scheme: str) -> None:
    schemes = case / "system/fvSchemes"
    text = schemes.read_text()
    assert "default         backward;" in text
    schemes.write_text(text.replace("default         backward;", f"default         {scheme};"))


@pytest.fixture
def make(tmp_path):
    """make_case, and nothing left at work in it."""
    made = []

    def make(name: str = "case", **options):
        options = {"write_every": 5, "application": "pimpleFoam"} | options
        made.append(make_case(tmp_path / name, **options))
        return made[-1]

    yield make
    for case in made:
        kill_all_of(case)


@pytest.fixture(scope="module")
def whole(tmp_path_factory):
    """The uninterrupted run, by the time scheme of pimpleFoam, or of boxFoam."""
    done = {}

    def get(scheme: str = "boxFoam"):
        if scheme not in done:
            solver = "pimpleFoam" if scheme in SCHEMES else scheme
            case = make_case(tmp_path_factory.mktemp("whole") / "case", write_every=5, application=solver)
            if scheme in SCHEMES:
                use_scheme(case, scheme)
            run_case(case)
            done[scheme] = case
        return done[scheme]

    return get


# backward, of two old values, is also killed twice below
EVERY_SCHEME = [pytest.param(s, marks=pytest.mark.exhaustive) for s in SCHEMES[:2]] + [SCHEMES[2]]


@pytest.mark.parametrize("scheme", EVERY_SCHEME)
def test_killed_and_continued_is_the_uninterrupted_run(scheme, make, whole):
    """Bitwise, with every scheme: the old values that a scheme needs are written beside the new ones."""
    case = make()
    use_scheme(case, scheme)
    Run(case).killed_at(12)
    done = run_case(case)
    assert "0.2" in done.stdout and ("continuing from" in done.stdout or "falling back to" in done.stdout)
    print(scheme, distance(final(case), final(whole(scheme))))
    assert distance(final(case), final(whole(scheme))) == 0
    check_series(case)
    table, expected = (
        read_dat(c / "postProcessing/linearForcing", "linearForcing.dat") for c in (case, whole(scheme))
    )
    for column in table:
        scale = np.abs(expected[column]).max()
        np.testing.assert_allclose(
            table[column], expected[column], rtol=0, atol=1e-9 * scale + 1e-15, err_msg=column
        )


@pytest.mark.parametrize("kills", [(3,), (7, 17)], ids=["before the first write", "twice"])
def test_killed_at_any_step(kills, make, whole):
    case = make()
    for step in kills:
        Run(case).killed_at(step)
    run_case(case)
    assert distance(final(case), final(whole(BACKWARD))) == 0
    check_series(case)


def test_stopped_on_request_and_continued(make, whole):
    """Ctrl-C writes at a time of its own; the run goes on from there."""
    case = make(write_every=1000)
    run = Run(case)
    run.at_step(6)
    run.process.send_signal(signal.SIGINT)
    assert "stopped on request; everything is written" in run.line(code=3)
    stopped = [p for p in case.glob("0.[0-9]*") if p.is_dir()]
    assert len(stopped) == 1 and 0.12 <= float(stopped[0].name) < 0.4
    set_entry(case / "system/controlDict", "writeInterval", "20")
    done = run_case(case)
    assert f"continuing from time {stopped[0].name}" in done.stdout
    assert distance(final(case), final(whole(BACKWARD))) == 0
    check_series(case)


@pytest.mark.parametrize(
    "broken",
    [
        "uniform/fibers.npz",
        "half of p",
        *(pytest.param(name, marks=pytest.mark.exhaustive) for name in ("U", "half of U")),
    ],
    ids=lambda name: name.replace("/", " "),
)
def test_incomplete_time_folder(broken, tmp_path, whole):
    """Killed between OpenFOAM's write and the fibers', or within OpenFOAM's: the complete time before counts."""
    case = tmp_path / "case"
    shutil.copytree(whole(), case, symlinks=True)
    for folder in ("0.4", "previous"):
        shutil.rmtree(case / folder, ignore_errors=True)
    file = case / "0.3" / broken.removeprefix("half of ")
    if broken.startswith("half"):
        file.write_bytes(file.read_bytes()[: file.stat().st_size // 2])
    else:
        file.unlink()
    done = run_case(case)
    line = [text for text in done.stdout.splitlines() if "falling back" in text]
    assert len(line) == 1 and "time 0.3 is not complete" in line[0] and "falling back to time 0.2" in line[0]
    assert (case / "previous/1/0.3/phi").is_file()
    assert f"earlier results are in {case}/previous/1" in done.stdout
    assert distance(final(case), final(whole())) == 0
    check_series(case)


def test_no_time_folder_is_complete(tmp_path, whole):
    case = tmp_path / "case"
    shutil.copytree(whole(), case)
    for state in case.glob("0.[0-9]*/uniform/fibers.npz"):
        state.unlink()
    done = run_case(case)
    assert "no time folder is complete" in done.stdout and "starting again from time 0" in done.stdout
    assert {p.name for p in (case / "previous/1").glob("0.[0-9]*")} == {"0.1", "0.2", "0.3", "0.4"}
    assert distance(final(case), final(whole())) == 0
    check_series(case)


def test_finished_run_stays_is_repeated_and_is_extended(tmp_path, whole):
    case = tmp_path / "case"
    shutil.copytree(whole(), case)
    first = final(case)
    assert "the run to time 0.4 is complete; --fresh repeats it" in run_case(case).stdout
    assert not (case / "previous").exists()
    run_case(case, "--fresh")
    kept = case / "previous/1"
    assert distance(first, final(kept)) == 0 and distance(first, final(case)) == 0
    with open_recording(kept / "postProcessing/fibers") as recording:
        assert len(recording.times) == STEPS + 1
    check_series(case)

    set_entry(case / "system/controlDict", "endTime", "0.5")
    done = run_case(case)
    assert "continuing from time 0.4" in done.stdout
    assert (case / "0.4/U").is_file() and not (case / "previous/2").exists()
    check_series(case, steps=25)


def test_time_step_changed_at_a_restart(tmp_path, whole):
    """Halved after 0.2: nearer to a run with the half step throughout than the whole step is."""
    case = tmp_path / "case"
    shutil.copytree(whole(), case)
    for time in ("0.3", "0.4"):
        shutil.rmtree(case / time)
    control = case / "system/controlDict"
    set_entry(control, "deltaT", "0.01")
    set_entry(control, "writeInterval", "10")
    done = run_case(case)
    assert "continuing from time 0.2" in done.stdout
    with open_recording(case / "postProcessing/fibers") as recording:
        np.testing.assert_allclose(np.diff(recording.times), [0.02] * 10 + [0.01] * 20, atol=1e-12)
        mixed = recording.families["test"].positions[-1]
    fine = make_case(tmp_path / "fine", steps=40, time_step=0.01, write_every=40, application="boxFoam")
    run_case(fine)
    with open_recording(fine / "postProcessing/fibers") as recording:
        reference = recording.families["test"].positions[-1]
    with open_recording(whole() / "postProcessing/fibers") as recording:
        coarse = recording.families["test"].positions[-1]
    assert 0 < np.abs(mixed - reference).max() < np.abs(coarse - reference).max()


def test_other_families_are_refused(tmp_path, whole):
    case = tmp_path / "case"
    shutil.copytree(whole(), case)
    shutil.rmtree(case / "0.4")
    properties = case / "constant/fiberProperties"
    text = properties.read_text()
    properties.write_text(text.replace("count 12", "count 13"))
    done = gbm("run", case)
    assert done.returncode == 1 and "Traceback" not in done.stderr
    line = done.stderr.splitlines()[-1]
    assert "0.3/uniform/fibers.npz holds the families" in line and "constant/fiberProperties says" in line
    assert '"test", 12' in line and '"test", 13' in line and "log.gbmDaemon" in line
    properties.write_text(text)  # nothing is lost
    run_case(case)
    assert distance(final(case), final(whole())) == 0
    check_series(case)


def test_state_that_cannot_be_read(tmp_path, whole):
    case = tmp_path / "case"
    shutil.copytree(whole(), case)
    shutil.rmtree(case / "0.4")
    state = case / "0.3/uniform/fibers.npz"
    data = state.read_bytes()
    for damaged in (b"", data[: len(data) // 2], b"not at all" * 100):
        state.write_bytes(damaged)
        done = gbm("run", case)
        assert done.returncode == 1 and "Traceback" not in done.stderr
        assert f"the fiber state {state} cannot be read" in done.stderr.splitlines()[-1]


def test_other_number_of_ranks_at_each_restart(make):
    """Serial, two ranks, serial: as the serial run to what the solver tolerances of 1e-12 leave."""
    case = make(cells=12, steps=8, write_every=2)
    whole = shutil.copytree(case, case.with_name("serial"))
    run_case(whole)
    control = case / "system/controlDict"
    for end, options in (("0.04", ()), ("0.12", ("--parallel",)), ("0.16", ())):
        set_entry(control, "endTime", end)
        done = run_case(case, *options)
        assert end == "0.04" or "continuing from time" in done.stdout
    assert not list(case.glob("processor*"))
    assert distance(final(case, 0.16), final(whole, 0.16)) < 1e-8
    check_series(case, 8)


def test_parallel_run_killed_and_continued(make):
    steps = 120  # as many as surely leave the time to kill it
    case = make(application="boxFoam", cells=12, steps=steps, write_every=30)
    shutil.copytree(case, case.with_name("serial"))
    run_case(case.with_name("serial"))
    Run(case, "--parallel").killed_at(40)
    done = run_case(case, "--parallel")
    assert "continuing from" in done.stdout or "falling back to" in done.stdout
    time = steps * TIME_STEP
    assert distance(final(case, time), final(case.with_name("serial"), time)) < 1e-8
    check_series(case, steps)
