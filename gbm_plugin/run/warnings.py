"""What daemons warn of while a run goes on: the lines that they add to postProcessing/fibers/<start>/warnings.txt."""

from __future__ import annotations

from pathlib import Path

from ..case.layout import results


class Warnings:
    """Those of a run: what was there before it is none of its."""

    def __init__(self, case: Path):
        self._folder = results(case)
        self._read: dict[int, int] = {f.stat().st_ino: f.stat().st_size for f in self._files()}

    def _files(self) -> list[Path]:
        return [f for f in sorted(self._folder.glob("*/warnings*.txt")) if f.is_file()]

    def news(self) -> list[str]:
        """Whole lines that came since the last call."""
        lines: list[str] = []
        for path in self._files():
            number = path.stat().st_ino
            with path.open("rb") as file:
                file.seek(self._read.get(number, 0))
                whole, newline, _ = file.read().rpartition(b"\n")
            self._read[number] = self._read.get(number, 0) + len(whole) + len(newline)
            lines += whole.decode(errors="replace").splitlines()
        return lines
