"""Cases that a stranger packed: links where a run writes, and folders that others can change."""

from __future__ import annotations

import logging
import os
import shutil

import h5py
import numpy as np
import pytest

from gbm_plugin.case.scene import Coupling, read_scene
from gbm_plugin.case.trust import check_case
from gbm_plugin.coupling.daemon import serve
from gbm_plugin.coupling.listen import listen
from gbm_plugin.errors import CaseError, CouplingError, LockedError
from gbm_plugin.output.recording import open_recording
from gbm_plugin.report.report import report
from gbm_plugin.run.driver import results_folder
from gbm_plugin.run.openfoam import run

from conftest import make_case, run_case


@pytest.fixture
def home(tmp_path):
    """A folder of the user's, outside of the case, which must stay as it is."""
    folder = tmp_path / "home"
    folder.mkdir()
    for name in ("thesis.tex", "U", "points", "report.json", "session", "fibers_0.vtu"):
        (folder / name).write_text(f"the user's {name}")
    before = {p.name: (p.read_text(), p.stat().st_mtime_ns) for p in folder.iterdir()}
    yield folder
    assert {p.name: (p.read_text(), p.stat().st_mtime_ns) for p in folder.iterdir()} == before


@pytest.mark.openfoam
def test_links_in_the_place_of_files(home, tmp_path):
    """A whole run, and its report, with every file that they write a link to one of the user's."""
    case = make_case(tmp_path / "case", steps=2, write_every=2, transport="tcp", prepared=False, tight=False)
    names = ["log.boxFoam", "log.gbmDaemon", "log.blockMesh", "case.foam", "gbm.part", "gbm.tcp"]
    for name in names:
        (case / name).symlink_to(home / "thesis.tex")
    (case / "log.gbmDaemon.1").symlink_to(home / "made")  # dangling: nothing may be made there
    run_case(case)
    assert "End" in (case / "log.boxFoam").read_text() and not (case / "log.boxFoam").is_symlink()
    report(case)


FOLDERS = ("exchange", "postProcessing", "report", "0", "0.04", "processor0", "previous", "spectral")


@pytest.mark.parametrize("name", FOLDERS)
def test_links_in_the_place_of_folders(name, home, tmp_path):
    case = make_case(tmp_path / "case", transport="file", prepared=False)
    (case / name).symlink_to(home)
    for command in (run, serve, report):
        with pytest.raises(CaseError, match=f"{name} is a link to {home}, out of the case"):
            command(case)


def test_exchange_is_a_folder_of_ones_own(home, tmp_path):
    """Also where a link was put there after the case was looked at; and other files in it stay."""
    (tmp_path / "case").mkdir()
    log, exchange = tmp_path / "log", tmp_path / "case/exchange"
    exchange.symlink_to(home)
    with pytest.raises(CouplingError, match="it is a link"):
        listen(tmp_path / "case", Coupling("file"), log)
    exchange.unlink()
    exchange.mkdir(mode=0o777)
    for name in ("notes.txt", f"{'a' * 16}.flow.3", f"{'a' * 16}.flow.4.part", "thesis.flow.3"):
        (exchange / name).write_text("stale")
    with listen(tmp_path / "case", Coupling("file"), log):
        assert sorted(p.name for p in exchange.iterdir()) == ["notes.txt", "session", "thesis.flow.3"]
        assert exchange.stat().st_mode & 0o777 == 0o700


def test_links_within_folders(home, tmp_path):
    case = make_case(tmp_path / "case", prepared=False)
    (case / "postProcessing/fibers").mkdir(parents=True)
    (case / "postProcessing/fibers/0").symlink_to(home)
    with pytest.raises(CaseError, match="fibers/0 is a link"):
        check_case(case)


def test_a_mesh_that_is_a_link_is_not_made(home, tmp_path):
    case = make_case(tmp_path / "case", prepared=False)
    (case / "constant/polyMesh").symlink_to(home / "mesh")  # dangling: one that is there is used as it is
    with pytest.raises(CaseError, match="polyMesh is a link"):
        run(case)


def test_a_lock_that_is_a_link(home, tmp_path):
    case = make_case(tmp_path / "case", prepared=False)
    (case / ".gbm.run.lock").symlink_to(home / "thesis.tex")
    with pytest.raises((CaseError, LockedError), match=r"\.gbm\.run\.lock"):
        run(case)


def test_links_within_the_case_and_of_what_is_read(tmp_path):
    """As users make them: dictionaries and a mesh that cases share, the results folders of gbm."""
    base = make_case(tmp_path / "base", prepared=False)
    case = tmp_path / "case"
    case.mkdir()
    for name in ("constant", "system", "0.orig"):
        (case / name).symlink_to(base / name)
    (case / "spectral").mkdir()
    (case / "spectral/constant").symlink_to("../constant")
    (case / "Allrun").symlink_to(base / "Allrun")
    check_case(case)
    results_folder(case, "stored")  # with a mesh of its own beside links to what is only read
    assert (case / "stored/constant/polyMesh/points").is_file()
    assert (case / "stored/constant/fiberProperties").is_symlink()
    check_case(case)


@pytest.mark.parametrize(
    "place", ["spectral/constant/polyMesh", "postProcessing/constant/0", "0.1/constant/x"]
)
def test_links_out_that_only_look_like_those(place, home, tmp_path):
    case = make_case(tmp_path / "case", prepared=False)
    (case / place).parent.mkdir(parents=True)
    (case / place).symlink_to(home)
    with pytest.raises(CaseError, match=f"{place} is a link to {home}, out of the case"):
        check_case(case)


def test_secrets_are_not_copied_into_the_recording(tmp_path):
    case = make_case(tmp_path / "case", prepared=False)
    (tmp_path / "key").write_text("PRIVATE KEY")
    (case / "system/fvSchemes").unlink()
    (case / "system/fvSchemes").symlink_to(tmp_path / "key")
    texts = read_scene(case).texts
    assert (
        texts["system/fvSchemes"] == "(a link out of the case)"
        and "families" in texts["constant/fiberProperties"]
    )


def test_recordings_that_read_elsewhere(write, tmp_path):
    """HDF5 has links to other files, raw data in other files, and datasets put together from them."""
    path = write(range(3))
    with h5py.File(tmp_path / "secret.h5", "w") as file:
        file["time"] = np.arange(3.0)
    np.arange(3.0).tofile(tmp_path / "secret.raw")
    layout = h5py.VirtualLayout((3,), float)
    layout[:] = h5py.VirtualSource(tmp_path / "secret.h5", "time", (3,))
    for kind in ("link", "soft", "raw", "virtual"):
        copy = shutil.copy(path, tmp_path / f"{kind}.h5")
        with h5py.File(copy, "r+") as file:
            del file["time"]
            if kind == "link":
                file["time"] = h5py.ExternalLink(tmp_path / "secret.h5", "time")
            elif kind == "soft":
                file["time"] = h5py.SoftLink("/step")
            elif kind == "raw":
                file.create_dataset("time", (3,), float, external=[(str(tmp_path / "secret.raw"), 0, 24)])
            else:
                file.create_virtual_dataset("time", layout)
        with pytest.raises(ValueError, match=r"'time' (is not in it|holds no numbers of its own)"):
            open_recording(copy)


def test_others_who_can_write(tmp_path, caplog):
    case = make_case(tmp_path / "case", prepared=False)
    with caplog.at_level(logging.WARNING):
        check_case(case)
        assert not caplog.records
        (case / "system").chmod(0o777)
        check_case(case)
    assert f"{case}/system can be changed by every user" in caplog.text


@pytest.mark.skipif(os.geteuid() != 0, reason="only root gives files away")
def test_files_of_others(tmp_path, caplog):
    case = make_case(tmp_path / "case", prepared=False)
    os.chown(case / "constant/fvOptions", 12345, -1)
    with caplog.at_level(logging.WARNING):
        check_case(case)
    assert f"{case}/constant/fvOptions (user 12345)" in caplog.text
