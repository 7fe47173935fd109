"""A run that was killed, stopped, divided differently or extended equals the one that was not."""

from __future__ import annotations

import re
import shutil

import numpy as np
import pytest
from fakes import Run, kill_all_of

from conftest import gbm, make_case, run_case, set_entry
from gbm_plugin.output.dat import read_dat
from gbm_plugin.output.recording import open_recording

STEPS, TIME_STEP = 20, 0.02
SCHEMES = ("Euler", "backward", "CrankNicolson 0.9")


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
    for folder, name in (("linearForcing", "linearForcing.dat"), ("fibers", "daemon.dat"), ("fibers", "coupling.dat")):
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
        made.append(make_case(tmp_path / name, **{"write_every": 5, **options}))
        return made[-1]

    yield make
    for case in made:
        kill_all_of(case)


@pytest.fixture(scope="module")
def whole(tmp_path_factory):
    """The uninterrupted run, and what is in it at the end, by the time scheme."""
    done = {}

    def get(scheme: str = "backward"):
        if scheme not in done:
            case = make_case(tmp_path_factory.mktemp("whole") / "case", write_every=5)
            use_scheme(case, scheme)
            run_case(case)
            done[scheme] = case
        return done[scheme]

    return get


@pytest.mark.parametrize("scheme", SCHEMES)
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
    table, expected = (read_dat(c / "postProcessing/linearForcing", "linearForcing.dat") for c in (case, whole(scheme)))
    for column in table:
        scale = np.abs(expected[column]).max()
        np.testing.assert_allclose(table[column], expected[column], rtol=0, atol=1e-9 * scale + 1e-15, err_msg=column)


@pytest.mark.parametrize("kills", [(3,), (7, 17)], ids=["before the first write", "twice"])
def test_killed_at_any_step(kills, make, whole):
    case = make()
    for step in kills:
        Run(case).killed_at(step)
    run_case(case)
    assert distance(final(case), final(whole())) == 0
    check_series(case)
