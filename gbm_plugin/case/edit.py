"""Entries of a dictionary replaced in its text, so that comments and order stay."""

from __future__ import annotations

import re
from collections.abc import Mapping
from pathlib import Path

from ..errors import CaseError


def set_entries(path: Path, entries: Mapping[str, object]) -> None:
    """Give entries that stand at the start of a line another value. CaseError where one is not there."""
    text = path.read_text()
    for name, value in entries.items():
        text, found = re.subn(
            rf"^({re.escape(name)}\s+)[^;]*;",
            lambda m, v=value: f"{m[1]}{v};",
            text,
            count=1,
            flags=re.MULTILINE,
        )
        if not found:
            raise CaseError(f"{path}: there is no entry '{name}' at the start of a line")
    path.write_text(text)
