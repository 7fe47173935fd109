"""A hard case: what is asked, what must come of it, and what came."""

from __future__ import annotations

import re
import time
import warnings
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from ...errors import GbmError, one_line

HANDLED = "handled"
LENGTH = 1e-12  # relative error of bead spacings, times the beads of a fiber, that rounding explains
GROWTH = 1e-9  # relative growth of a bending energy without flow that rounding explains

Found = dict[str, Any]


@dataclass(frozen=True)
class Case:
    """kind, asked: in words. act: does it, and returns what it found. refused: the message with which it must be
    refused, as a regular expression; None for a case that must be handled. note: where the model ends, and why. slow:
    left out of --quick. openfoam: runs OpenFOAM's programs."""

    kind: str
    asked: str
    act: Callable[[], Found]
    refused: str | None = None
    note: str = ""
    slow: bool = False
    openfoam: bool = False

    @property
    def name(self) -> str:
        return f"{self.kind}: {self.asked}"

    def measure(self) -> Found:
        """The row of the table; outcome is "handled" or "refused" where that is right, else what is wrong."""
        row: Found = {"kind": self.kind, "asked": self.asked}
        start = time.process_time(), time.perf_counter()
        with warnings.catch_warnings(record=True) as heard:
            warnings.simplefilter("always")
            try:
                found, message = self.act(), ""
            except (GbmError, ValueError, FloatingPointError, OSError) as error:
                found, message = {}, one_line(error)
        clock = 1 if self.openfoam else 0
        row["seconds"] = (time.process_time(), time.perf_counter())[clock] - start[clock]
        noise = [str(w.message) for w in heard if issubclass(w.category, RuntimeWarning)]
        row["outcome"] = self._judge(found, message) if not noise else f"WRONG: it warns of {noise[0]}"
        row["said"] = message or next((str(w.message) for w in heard), "")
        return row | found | {"note": self.note}

    def _judge(self, found: Found, message: str) -> str:
        if self.refused is not None:
            if not message:
                return "WRONG: not refused"
            return "refused" if re.search(self.refused, message) else "WRONG: refused with another message"
        if message:
            return "WRONG: refused"
        limits = {"length_error": LENGTH * found.get("beads", 1), "growth": GROWTH, "off": 1.0}
        broken = [name for name, limit in limits.items() if name in found and not found[name] <= limit]
        if not found.get("finite", True):
            return "WRONG: not finite"
        return f"WRONG: {', '.join(broken)}" if broken else HANDLED
