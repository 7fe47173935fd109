"""Which part of the fibers one of several daemons moves, and the names of the files that are its own."""

from __future__ import annotations

import re
from dataclasses import dataclass
from pathlib import Path


@dataclass(frozen=True)
class Share:
    """Daemon `number` (1 ... of) of those that share the fibers of a case."""

    number: int = 1
    of: int = 1

    def name(self, stem: str, suffix: str = "") -> str:
        """A file's name with the share in it, as gbm.1of2.sock; without one where a single daemon has all."""
        return f"{stem}{suffix}" if self.of == 1 else f"{stem}.{self.number}of{self.of}{suffix}"

    def part(self, count: int) -> slice:
        """Which of `count` fibers: equally many for all shares, but for one."""
        return slice(count * (self.number - 1) // self.of, count * self.number // self.of)

    def __str__(self) -> str:
        return "the daemon" if self.of == 1 else f"daemon {self.number} of {self.of}"


WHOLE = Share()  # of a single daemon


def all_shares(count: int) -> list[Share]:
    """Those of so many daemons."""
    return [Share(number, count) for number in range(1, count + 1)]


def shared_files(folder: Path, stem: str, suffix: str) -> list[Path]:
    """The files of this name that all daemons of a run wrote into a folder, in the order of their shares.

    The newest set, where there are several; empty where there is none without a gap.
    """
    counts = {1}
    for path in folder.glob(f"{stem}.*of*{suffix}"):
        if match := re.fullmatch(rf"{re.escape(stem)}\.\d+of(\d+){re.escape(suffix)}", path.name):
            counts.add(int(match[1]))
    sets = [[folder / share.name(stem, suffix) for share in all_shares(count)] for count in counts]
    whole = [files for files in sets if all(file.is_file() for file in files)]
    return max(whole, key=lambda files: files[0].stat().st_mtime, default=[])
