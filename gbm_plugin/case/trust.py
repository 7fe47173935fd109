"""What a case holds that its user may not want: links that lead out of it, and others who can write in it.

A case comes by mail, or lies on a disk of many users. Files that gbm writes replace what has their name (files.py);
here are the folders, in which OpenFOAM writes too, and follows every link.
"""

from __future__ import annotations

import contextlib
import grp
import logging
import os
import pwd
import stat
from collections.abc import Iterator
from fnmatch import fnmatch
from pathlib import Path

from ..errors import CaseError
from .layout import PREVIOUS, RESULTS, as_time

log = logging.getLogger(__name__)

WRITTEN = (RESULTS, PREVIOUS, "report", "spectral", "stored", "exchange*", "processor[0-9]*")  # and times
READ = ("constant", "system", "0.orig")  # may be links: to a mesh or dictionaries that cases share
RESULTS_FOLDERS = ("spectral", "stored")
NAMED = 3  # so many of the files of other owners are named


def check_case(case: Path) -> None:
    """CaseError where a folder that a run writes leads out of the case, or a file in it does; a word in the log where
    others can change what the case says."""
    if not case.is_dir():
        return
    for entry in os.scandir(case):
        if as_time(entry.name) is not None or any(fnmatch(entry.name, name) for name in WRITTEN):
            refuse_links_out(case, Path(entry.path))
    _warn_of_others(case)


def refuse_links_out(case: Path, part: Path) -> None:
    """CaseError where a file or folder of the case, or one in it, is a link to a place that is not in the case."""
    for link in _links(part):
        if not _of_results(case, link) and not is_inside(case, link):
            raise CaseError(
                f"{link} is a link to {os.path.realpath(link)}, out of the case, and a run would write there: remove it"
            )


def _of_results(case: Path, link: Path) -> bool:
    """Of results in a folder of the case what is only read: spectral/constant, or beside its own mesh what is in it."""
    inner = link.parent.name == "constant" and link.parent.parent.name in RESULTS_FOLDERS
    if inner and link.parent.parent.parent == case:
        return link.name != "polyMesh"
    return link.name in READ and link.parent.parent == case


def is_inside(case: Path, path: Path) -> bool:
    """Whether a path ends in the case, wherever its links lead."""
    return Path(os.path.realpath(path)).is_relative_to(os.path.realpath(case))


def _links(part: Path) -> Iterator[Path]:
    if part.is_symlink():
        yield part
    elif part.is_dir() and part.name != PREVIOUS:  # in which nothing is written over
        with os.scandir(part) as entries:
            for entry in entries:
                if entry.is_symlink():
                    yield Path(entry.path)
                elif entry.is_dir(follow_symlinks=False):
                    yield from _links(Path(entry.path))


def _warn_of_others(case: Path) -> None:
    parts = [case, *(case / name for name in READ)]
    for folder in parts:
        if folder.is_dir() and (who := _who_else_writes(folder.stat())):
            log.warning("%s can be changed by %s, and so can what a run of it does", folder, who)
    files = [path for folder in parts if folder.is_dir() for path in (folder, *folder.iterdir())]
    owners = {path: path.lstat().st_uid for path in files}
    foreign = [path for path, owner in owners.items() if owner not in (os.geteuid(), 0)]
    if foreign:
        more = f" and {len(foreign) - NAMED} more" if len(foreign) > NAMED else ""
        named = ", ".join(f"{path} (user {owners[path]})" for path in foreign[:NAMED])
        log.warning("of other users, who can change them and so what a run does: %s%s", named, more)


def _who_else_writes(found: os.stat_result) -> str:
    if found.st_mode & stat.S_IWOTH:
        return "every user of this machine"
    if found.st_mode & stat.S_IWGRP:
        with contextlib.suppress(KeyError):  # a group of the user alone, as most distributions make it
            own = pwd.getpwuid(os.geteuid())
            group = grp.getgrgid(found.st_gid)
            if group.gr_name == own.pw_name and set(group.gr_mem) <= {own.pw_name}:
                return ""
        return f"the group {found.st_gid}"
    return ""
