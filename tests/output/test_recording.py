import errno
import multiprocessing
import os
import random
import resource
import signal
import subprocess
import time

import h5py
import numpy as np
import pytest

from gbm_plugin.output import transaction
from gbm_plugin.output.recording import FamilyRecord, Recorder, open_recording
from gbm_plugin.output.transaction import FileFullError

from sample_records import BOX, FAMILIES, SCENE, records


def check_records(recording, steps):
    steps = list(steps)
    assert recording.steps.tolist() == steps
    np.testing.assert_allclose(recording.times, 0.1 * np.array(steps), rtol=0, atol=1e-12)
    for number, family in enumerate(recording.families.values()):
        assert family.positions.shape == (len(steps), family.count, family.beads, 3)
        for row, step in enumerate(steps):
            np.testing.assert_array_equal(family.positions[row], records(step)[number])


def test_everything_written_is_read_back(write):
    with open_recording(write(range(7))) as recording:
        check_records(recording, range(7))
        assert list(recording.families) == ["stiff", "soft"]
        for family, written in zip(recording.families.values(), FAMILIES, strict=True):
            for name in ("name", "count", "beads", "radius", "seed", "model"):
                assert getattr(family, name) == getattr(written, name)
            np.testing.assert_array_equal(family.bending_stiffness, written.bending_stiffness)
        np.testing.assert_array_equal(recording.box_size, [BOX] * 3)
        assert recording.metadata["dictionaries"] == SCENE["dictionaries"]
        assert recording.metadata["dynamic_viscosity"] == 1e-3
        assert recording.metadata["schema_version"] == 1


def test_file_describes_itself(write):
    with h5py.File(write(range(2))) as file:  # plain h5py, no help from this package
        assert file.attrs["schema_version"] == 1 and file.attrs["program_version"] == "0.1.0"
        units = {}
        file.visititems(lambda name, node: units.update({name: node.attrs.get("units")}))
        quantities = {name: unit for name, unit in units.items() if isinstance(file[name], h5py.Dataset)}
        assert all(unit for name, unit in quantities.items() if not name.startswith("dictionaries/"))
        assert quantities["families/soft/positions"] == "m" and quantities["viscosity"] == "Pa s"
        assert file["families/stiff/positions"].dtype == np.float64
        assert file["families/stiff"].attrs["seed"] == 7
        assert file["dictionaries/system/controlDict"].asstr()[()] == "deltaT 0.01;\n"


@pytest.mark.parametrize(
    "key",
    [3, -1, slice(None), slice(1, 9, 3), slice(None, None, -1), [5, 0, 6], slice(5, 5), (slice(2, 8), 1),
     (..., 0), (4, 2, 5), (slice(None), slice(0, 2), 3, 1)],
)  # fmt: skip
def test_positions_index_like_an_array(write, key):
    paths = [write(range(4)), write(range(4, 10), "0.4")]
    with open_recording(paths) as recording:
        positions = recording.families["stiff"].positions
        whole = np.stack([records(step)[0] for step in range(10)])
        np.testing.assert_array_equal(positions[key], whole[key])
        with pytest.raises(IndexError):
            positions[10]


def test_restart_overrides_what_it_repeats(write):
    write(range(0, 11))
    write(range(6, 15), "0.6")
    write(range(12, 16), "1.2")
    folder = write(range(15, 17), "1.5").parent.parent
    with open_recording(folder) as recording:
        check_records(recording, range(17))
        positions = recording.families["soft"].positions
        assert [int(start) for start in positions._starts] == [0, 6, 12, 15, 17]


def test_parts_of_different_runs_are_refused(tmp_path, write):
    other = tmp_path / "other.h5"
    Recorder(other, FAMILIES[:1], **SCENE)
    with pytest.raises(ValueError, match="not one run"):
        open_recording([write([0]), other])


def test_empty_recording_opens(tmp_path):
    Recorder(tmp_path / "fibers.h5", FAMILIES, **SCENE)
    with open_recording(tmp_path / "fibers.h5") as recording:
        assert recording.times.shape == (0,)
        assert recording.families["soft"].positions[:].shape == (0, 3, 10, 3)


def test_existing_recording_is_not_overwritten(write):
    path = write(range(3))
    with pytest.raises(FileExistsError, match="not overwritten"):
        Recorder(path, FAMILIES, **SCENE)
    with open_recording(path) as recording:
        check_records(recording, range(3))


@pytest.mark.parametrize(
    ("step", "change", "error", "message"),
    [
        (5, lambda a: a[:1], ValueError, "1 arrays of positions for 2 families"),
        (5, lambda a: [a[1], a[0]], ValueError, "family 'stiff': shape"),
        (4, lambda a: a, ValueError, "does not come after step 4"),
        (5, lambda a: [a[0], np.where(np.arange(3)[:, None, None] == 2, np.nan, a[1])], FloatingPointError,
         r"step 5, time 0.5 s: positions of fiber 2 of family 'soft'"),
    ],
)  # fmt: skip
def test_bad_record_is_refused_and_changes_nothing(tmp_path, step, change, error, message):
    path = tmp_path / "fibers.h5"
    recorder = Recorder(path, FAMILIES, **SCENE)
    recorder.append(4, 0.4, records(4))
    before = path.read_bytes()
    with pytest.raises(error, match=message):
        recorder.append(step, 0.1 * step, change(records(5)))
    assert path.read_bytes() == before


@pytest.mark.parametrize(
    "change",
    [
        dict(box_size=(1, 1)),
        dict(box_size=(1, 1, 0)),
        dict(dynamic_viscosity=0),
        dict(density=np.nan),
        dict(families=[]),
    ],
)
def test_bad_scene_is_refused_and_leaves_no_file(tmp_path, change):
    arguments = {"families": FAMILIES, **SCENE, **change}
    with pytest.raises(ValueError, match="allowed"):
        Recorder(tmp_path / "fibers.h5", **arguments)
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize(
    "change", [dict(beads=1), dict(count=0), dict(radius=-1), dict(bending_stiffness=[1.0, 2.0])]
)
def test_bad_family_is_refused(change):
    with pytest.raises(ValueError, match="family 'a'"):
        FamilyRecord(**{**dict(name="a", count=3, beads=4, radius=1.0, bending_stiffness=1.0), **change})


def test_file_that_is_no_recording_is_refused(tmp_path):
    (tmp_path / "fibers.h5").write_text("no HDF5")
    with pytest.raises(ValueError, match="not a fiber recording"):
        open_recording(tmp_path / "fibers.h5")
    with pytest.raises(FileNotFoundError):
        open_recording([])


# --- the death of the process -------------------------------------------------------------------------------


class Killed(BaseException):
    pass


def test_readable_after_every_interrupted_write(tmp_path, monkeypatch):
    """Every write to the file is interrupted once, with nothing and with half of it done."""
    path = tmp_path / "fibers.h5"
    recorder = Recorder(path, FAMILIES, **SCENE)
    for step in range(40):  # two chunks of the small records are full: all kinds of metadata change
        recorder.append(step, 0.1 * step, records(step))
    before = path.read_bytes()
    pwrite = os.pwrite
    calls, outcomes = 0, []

    def write(fd, data, offset):
        nonlocal calls
        calls += 1
        if calls == last:
            pwrite(fd, data[: int(len(data) * part)], offset)
            raise Killed
        return pwrite(fd, data, offset)

    monkeypatch.setattr(transaction.os, "pwrite", write)
    part = last = 0
    for fraction in (0, 0.5, 1):
        for count in range(1, 1000):
            part, last, calls = fraction, count, 0
            path.write_bytes(before)
            try:
                recorder.append(40, 4.0, records(40))
            except Killed:
                with open_recording(path) as recording:
                    outcomes.append(len(recording.steps))
                    check_records(recording, range(outcomes[-1]))
            else:
                break
            finally:
                recorder._last = 39, 3.9
    assert last > 4  # data, journal and several pages were interrupted
    assert set(outcomes) == {40, 41}


def append_for_ever(path, done):
    recorder = Recorder(path, FAMILIES, **SCENE)
    for step in range(10**9):
        recorder.append(step, 0.1 * step, records(step))
        done.value = step + 1


def test_readable_after_sigkill(tmp_path):
    """Within an append or between two: a moment after the child has come to some number of them."""
    random.seed(1)
    fork = multiprocessing.get_context("fork")
    counts = []
    for kill in range(0, 40, 3):
        path, done = tmp_path / str(kill) / "fibers.h5", fork.Value("q", 0)
        child = fork.Process(target=append_for_ever, args=(path, done))
        child.start()
        while not (path.exists() and path.stat().st_size) or done.value < kill:
            assert child.is_alive()
            time.sleep(1e-4)
        time.sleep(random.uniform(0, 0.005))
        os.kill(child.pid, signal.SIGKILL)
        child.join()
        assert child.exitcode == -signal.SIGKILL
        with open_recording(path) as recording:
            counts.append(len(recording.steps))
            check_records(recording, range(counts[-1]))
        assert counts[-1] >= kill


def test_read_while_it_is_written(tmp_path):
    path = tmp_path / "fibers.h5"
    with Recorder(path, FAMILIES, **SCENE) as recorder:
        for step in range(5):
            recorder.append(step, 0.1 * step, records(step))
            with open_recording(path) as recording:
                check_records(recording, range(step + 1))


# --- a full disk --------------------------------------------------------------------------------------------


def fill(path):
    """Append until there is no room; the number of records written and the error."""
    recorder = Recorder(path, FAMILIES, **SCENE)
    for step in range(10**4):
        try:
            recorder.append(step, 0.1 * step, records(step))
        except OSError as error:
            return step, error
    raise AssertionError("never full")


def check_full(path, count, error):
    assert isinstance(error, FileFullError)
    for part in (str(path), "more bytes", f"all records up to step {count - 1} kept"):
        assert part in str(error)
    with open_recording(path) as recording:
        check_records(recording, range(count))
    with h5py.File(path) as file:  # undamaged for everybody else, too
        assert file["families/soft/positions"].shape[0] == count


def test_limited_file_size(tmp_path):
    path = tmp_path / "fibers.h5"
    before = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (300_000, before[1]))
    try:
        count, error = fill(path)
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, before)
    assert error.errno == errno.EFBIG and count > 50
    check_full(path, count, error)


def test_full_disk(tmp_path):
    disk = tmp_path / "disk"
    disk.mkdir()
    mount = ["mount", "-t", "tmpfs", "-o", "size=512k", "tmpfs", disk]
    mounted = subprocess.run(mount, capture_output=True, text=True)
    if mounted.returncode:
        pytest.skip(f"a small filesystem cannot be mounted: {mounted.stderr.strip()}")
    try:
        path = disk / "fibers.h5"
        ballast = disk / "ballast"
        ballast.write_bytes(bytes(200_000))
        count, error = fill(path)
        assert error.errno == errno.ENOSPC and count > 50
        check_full(path, count, error)
        with pytest.raises(OSError, match="No space"), ballast.open("ab", buffering=0) as file:
            while True:
                file.write(bytes(4096))
        with pytest.raises(FileFullError, match=r"new\.h5 not created: no room"):
            Recorder(disk / "new.h5", FAMILIES, **SCENE)
        assert sorted(file.name for file in disk.iterdir()) == ["ballast", "fibers.h5"]
    finally:
        subprocess.run(["umount", "-l", disk], check=True)


def test_recording_goes_on_when_there_is_room_again(tmp_path):
    path = tmp_path / "fibers.h5"
    recorder = Recorder(path, FAMILIES, **SCENE)
    recorder.append(0, 0.0, records(0))
    before = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (path.stat().st_size, before[1]))
    try:
        with pytest.raises(FileFullError):
            recorder.append(1, 0.1, records(1))
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, before)
    recorder.append(1, 0.1, records(1))
    with open_recording(path) as recording:
        check_records(recording, range(2))


def test_memory_does_not_grow(tmp_path):
    """Resident memory after 300 appends is that after 50, within less than the data written between them."""
    family = FamilyRecord("one", 200, 20, 0.01, 1e-6)
    positions = np.zeros((200, 20, 3))

    def resident():
        with open("/proc/self/statm") as file:
            return int(file.read().split()[1]) * resource.getpagesize()

    with Recorder(tmp_path / "fibers.h5", [family], **SCENE) as recorder:
        for step in range(300):
            recorder.append(step, 0.1 * step, [positions])
            if step == 50:
                start = resident()
        assert resident() - start < 0.1 * 250 * positions.nbytes


def tensions(step):
    return [np.random.default_rng(step).standard_normal((f.count, f.beads - 1)) for f in FAMILIES]


def test_tension_is_kept_where_it_is_asked_for(tmp_path):
    path = tmp_path / "postProcessing/fibers/0/fibers.h5"
    with Recorder(path, FAMILIES, **SCENE, tension=True) as recorder:
        for step in range(4):
            recorder.append(step, 0.1 * step, records(step), tensions(step))
        with pytest.raises(ValueError, match="tension goes with every record"):
            recorder.append(4, 0.4, records(4))
        with pytest.raises(ValueError, match=r"tension of family 'stiff': shape \(3, 9\), not \(4, 5\)"):
            recorder.append(4, 0.4, records(4), tensions(4)[::-1])
    with h5py.File(path) as file:
        assert file["families/soft/tension"].attrs["units"] == "N"
    with open_recording(path.parent.parent) as recording:
        check_records(recording, range(4))
        for number, family in enumerate(recording.families.values()):
            assert family.tension.shape == (4, family.count, family.beads - 1)
            np.testing.assert_array_equal(family.tension[:], [tensions(step)[number] for step in range(4)])
            np.testing.assert_array_equal(family.tension[-1, 1], tensions(3)[number][1])


def test_a_run_has_tension_where_all_its_parts_do(tmp_path, write):
    path = write(range(3))
    with open_recording(path) as recording:
        assert recording.families["stiff"].tension is None
    second = tmp_path / "postProcessing/fibers/0.3/fibers.h5"
    with Recorder(second, FAMILIES, **SCENE, tension=True) as recorder:
        recorder.append(3, 0.3, records(3), tensions(3))
        with pytest.raises(ValueError, match="tension"):
            Recorder(tmp_path / "none.h5", FAMILIES, **SCENE).append(0, 0.0, records(0), tensions(0))
    with open_recording([path, second]) as recording:
        check_records(recording, range(4))
        assert recording.families["stiff"].tension is None
