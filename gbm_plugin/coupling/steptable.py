"""The daemon's row a step, beside the recording: when messages came and went, how good the prediction was."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from ..case.scene import Family


class StepTable:
    """`daemon.dat`: sentAt and arrivedAt by the clock of the day [s], the prediction gap [m/s], <R^2>/L^2."""

    def __init__(self, folder: Path, families: Sequence[Family]):
        path = folder / "daemon.dat"
        number = 1
        while path.exists():
            number += 1
            path = folder / f"daemon_{number}.dat"
        self._file = path.open("w", buffering=1)
        names = ["Time", "step", "sentAt", "arrivedAt", "gap", *(f"R2_{f.name}" for f in families)]
        self._file.write("# " + "\t".join(names) + "\n")

    def add(
        self, time: float, step: int, sent_at: float, arrived_at: float, gap: float, ratios: Sequence[float]
    ) -> None:
        row = [f"{time:.12g}", str(step), f"{sent_at:.6f}", f"{arrived_at:.6f}", f"{gap:.6g}"]
        self._file.write("\t".join(row + [f"{r:.9g}" for r in ratios]) + "\n")

    def close(self) -> None:
        self._file.close()
