"""What gbm itself made in a case, by digest: only that is made again, or moved away for a new start."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Iterable
from pathlib import Path

from ..files import write_text

RECORD = ".gbm.made"


def note_begin(case: Path, thing: str) -> None:
    """`thing` is being made: until it is finished, what is there of it is a half."""
    _note(case, thing, {"files": None})


def note_made(case: Path, thing: str, files: Iterable[Path], source: str = "") -> None:
    """`thing` is made: these files, after a source of this text."""
    _note(case, thing, {"files": _digests(case, files), "source": _digest(source.encode())})


def is_half_made(case: Path, thing: str) -> bool:
    entry = _record(case).get(thing)
    return entry is not None and entry["files"] is None


def is_recorded(case: Path, thing: str) -> bool:
    return thing in _record(case)


def is_own(case: Path, thing: str) -> bool:
    """Whether `thing` is there as gbm made it: each file of it, none a link, to the bit."""
    entry = _record(case).get(thing)
    if not entry or not entry["files"]:
        return False
    files = [case / name for name in entry["files"]]
    folders = {parent for file in files for parent in file.parents if case in parent.parents}
    if any(path.is_symlink() for path in (*files, *folders)) or not all(file.is_file() for file in files):
        return False
    return _digests(case, files) == entry["files"]


def is_made_from(case: Path, thing: str, source: str) -> bool:
    """Whether `thing` was made after a source of this text."""
    return _record(case).get(thing, {}).get("source") == _digest(source.encode())


def _record(case: Path) -> dict:
    try:
        record = json.loads((case / RECORD).read_text())
    except (OSError, ValueError):
        return {}
    return record if isinstance(record, dict) else {}


def _note(case: Path, thing: str, entry: dict) -> None:
    write_text(case / RECORD, json.dumps(_record(case) | {thing: entry}, indent=1) + "\n")


def _digests(case: Path, files: Iterable[Path]) -> dict[str, str]:
    return {str(file.relative_to(case)): _file_digest(file) for file in sorted(files)}


def _file_digest(path: Path) -> str:
    with path.open("rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()


def _digest(data: bytes) -> str:
    return hashlib.sha256(data).hexdigest()
