"""The daemon's row a step, beside the recording: when messages came and went, how good the prediction was."""

from __future__ import annotations

import contextlib
from collections.abc import Sequence
from pathlib import Path

from ..case.scene import Family
from ..case.share import WHOLE, Share
from ..output.restarts import keep_earlier


class StepTable:
    """`daemon.dat`: sentAt and arrivedAt by the clock of the day [s], the prediction gap [m/s], <R^2>/L^2."""

    def __init__(self, folder: Path, families: Sequence[Family], share: Share = WHOLE):
        self._path = keep_earlier(folder / share.name("daemon", ".dat"))
        self._file = self._path.open("w", buffering=1)
        names = ["Time", "step", "sentAt", "arrivedAt", "gap", *(f"R2_{f.name}" for f in families)]
        self._file.write("# " + "\t".join(names) + "\n")

    def add(
        self, time: float, step: int, sent_at: float, arrived_at: float, gap: float, ratios: Sequence[float]
    ) -> None:
        row = [f"{time:.12g}", str(step), f"{sent_at:.6f}", f"{arrived_at:.6f}", f"{gap:.6g}"]
        try:
            self._file.write("\t".join(row + [f"{r:.9g}" for r in ratios]) + "\n")
        except OSError as error:
            raise OSError(error.errno, error.strerror, str(self._path)) from None

    def close(self) -> None:
        with contextlib.suppress(OSError):  # a full disk was named when a row did not fit
            self._file.close()
