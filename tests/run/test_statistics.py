"""Statistics that a run gathers on the fly: those of its recording, over restarts and daemons."""

from __future__ import annotations

import re

import numpy as np
import pytest

from gbm_plugin.output.recording import open_recording
from gbm_plugin.output.statistics import read_statistics
from gbm_plugin.statistics.running import Running
from gbm_plugin.studies.paper import gathered

from conftest import gbm, make_case, run_case, set_entry

ASKED = "statistics { from 0.1; interval 2; lags 4; }\n"
SPECTRAL = ("--flow", "spectral")
FIBERS = "postProcessing/fibers"
PAIR = (
    "soft { count 7; beads 6; length 1.2; bendingStiffness 1e-4; seed 3; }"
    "short { count 4; beads 2; length 0.2; bendingStiffness 0; seed 4; }"
)


def make(path, asked=ASKED, **options):
    case = make_case(path, prepared=False, families=PAIR, **options)
    properties = case / "constant/fiberProperties"
    properties.write_text(properties.read_text() + asked)
    return case


def from_recording(folder, interval=2, since=0.1):
    """Every sample that is due, of a recording of every step."""
    found = {}
    with open_recording(folder) as recording:
        due = (recording.steps % interval == 0) & (recording.times > since - 1e-6)
        for name, family in recording.families.items():
            running = Running(family.count, family.beads, family.radius, 4)
            for x in family.positions[:][due]:
                running.observe(x)
            found[name] = running
        return recording.times[due], found


def check(folder, rtol=0.0):
    times, expected = from_recording(folder)
    gathered = read_statistics(folder)
    np.testing.assert_allclose(gathered.times, times, rtol=1e-12)
    assert list(gathered.families) == list(expected)
    for name, running in expected.items():
        for key, value in running.state().items():
            found = gathered.families[name].state()[key]
            np.testing.assert_allclose(found, value, rtol=rtol, atol=rtol, err_msg=f"{name} {key}")


def test_they_are_those_of_the_recording_and_go_on(tmp_path):
    """To the bit, also from a restart on that lies between two samples."""
    case = make(tmp_path / "case", write_every=5)
    for end in ("0.06", "0.3", "0.4"):
        set_entry(case / "system/controlDict", "endTime", end)
        run_case(case, *SPECTRAL)
    assert len(read_statistics(case / "spectral" / FIBERS).times) == 8
    check(case / "spectral" / FIBERS)


@pytest.mark.openfoam
def test_with_openfoam_and_a_changing_number_of_daemons(tmp_path):
    """Counts exactly; sums over the fibers in another order, to rounding."""
    case = make(tmp_path / "case", write_every=5)
    for end, daemons in (("0.2", 2), ("0.4", 3)):
        properties = case / "constant/fiberProperties"
        text = re.sub(r" daemons \d+;", "", properties.read_text())
        properties.write_text(text.replace("coupling {", f"coupling {{ daemons {daemons};"))
        set_entry(case / "system/controlDict", "endTime", end)
        run_case(case)
    check(case / FIBERS, rtol=1e-13)


def test_nothing_is_gathered_that_is_not_asked_for(tmp_path):
    case = make(tmp_path / "case", asked="", steps=4)
    run_case(case, *SPECTRAL)
    assert not list((case / "spectral").rglob("statistics*"))
    with pytest.raises(FileNotFoundError, match="asks for it"):
        read_statistics(case / "spectral" / FIBERS)


def test_other_samples_begin_anew(tmp_path):
    """What was gathered before stays in the file of the earlier start."""
    case = make(tmp_path / "case", asked=ASKED.replace("0.1", "0"), steps=10)
    run_case(case, *SPECTRAL)
    properties = case / "constant/fiberProperties"
    properties.write_text(properties.read_text().replace("interval 2", "interval 5"))
    set_entry(case / "system/controlDict", "endTime", "0.4")
    done = run_case(case, *SPECTRAL)
    assert "begin anew" in done.stdout and "another from, interval or lags" in done.stdout
    np.testing.assert_allclose(read_statistics(case / "spectral" / FIBERS).times, [0.2, 0.3, 0.4])
    assert (case / "spectral" / FIBERS / "0/statistics.h5").is_file()


@pytest.mark.parametrize("entry", ["since 3;", "interval 0;", "lags 1.5;"])
def test_a_wrong_entry_is_named(tmp_path, entry):
    case = make(tmp_path / "case", asked=f"statistics {{ {entry} }}\n")
    done = gbm("run", case, *SPECTRAL)
    assert done.returncode == 1 and entry.split()[0] in done.stderr and len(done.stderr.splitlines()) == 1


def test_the_study_of_them_has_every_family(tmp_path):
    case = make(tmp_path / "case", steps=20)
    run_case(case, *SPECTRAL)
    result = gathered.run([case / "spectral"])
    soft, short = result["rows"]
    assert short["R2"] == pytest.approx(1) and "curvature" not in short
    assert (
        soft["R2"]
        == read_statistics(case / "spectral" / FIBERS).families["soft"].averages["R2"].estimate().value
    )
    assert soft["R2_rms"] >= 0 and soft["turning_time"] > 0
    assert len(gathered.table(result).splitlines()) == 4 and gathered.draw(result)
    with pytest.raises(FileNotFoundError, match="asks for it"):
        gathered.run([case])
