"""Writing beside links that a stranger left: their targets stay as they are."""

from __future__ import annotations

import os
import stat

import pytest

from gbm_plugin.files import created, opened_lock, private_folder, replaced, write_text


@pytest.fixture
def victim(tmp_path):
    """A file of the user's, and a link to it where a program will write."""
    file = tmp_path / "thesis.tex"
    file.write_text("years of work")
    (tmp_path / "case").mkdir()
    (tmp_path / "case/out").symlink_to(file)
    yield file
    assert file.read_text() == "years of work"


def test_a_link_is_replaced(victim, tmp_path):
    out = tmp_path / "case/out"
    write_text(out, "result")
    assert out.read_text() == "result" and not out.is_symlink()


def test_a_link_is_removed_for_a_log(victim, tmp_path):
    with created(tmp_path / "case/out") as log:
        log.write("line")
    assert (tmp_path / "case/out").read_text() == "line"


def test_a_dangling_link_makes_nothing(tmp_path):
    (tmp_path / "out").symlink_to(tmp_path / "elsewhere")
    created(tmp_path / "out").close()
    assert not (tmp_path / "elsewhere").exists()


def test_a_lock_is_no_link(victim, tmp_path):
    with pytest.raises(OSError):
        opened_lock(tmp_path / "case/out")


def test_a_lock_is_nobody_elses(tmp_path):
    (tmp_path / "lock").touch(0o666)
    opened_lock(tmp_path / "lock").close()
    assert stat.S_IMODE((tmp_path / "lock").stat().st_mode) == 0o600


def test_what_fails_leaves_what_was_there(tmp_path):
    write_text(tmp_path / "table", "old")
    with pytest.raises(RuntimeError), replaced(tmp_path / "table") as file:
        file.write("half of the")
        raise RuntimeError
    assert (tmp_path / "table").read_text() == "old" and len(list(tmp_path.iterdir())) == 1


def test_an_error_names_the_file(tmp_path):
    with pytest.raises(FileNotFoundError, match=r"missing/table'"):
        write_text(tmp_path / "missing/table", "")


def test_private(tmp_path):
    old = os.umask(0)
    try:
        write_text(tmp_path / "secret", "", private=True)
        folder = private_folder(tmp_path / "folder")
    finally:
        os.umask(old)
    assert stat.S_IMODE((tmp_path / "secret").stat().st_mode) == 0o600
    assert stat.S_IMODE(folder.stat().st_mode) == 0o700


def test_a_linked_folder_is_not_ours(tmp_path):
    (tmp_path / "there").mkdir()
    (tmp_path / "exchange").symlink_to(tmp_path / "there")
    with pytest.raises(PermissionError, match="a link"):
        private_folder(tmp_path / "exchange")
