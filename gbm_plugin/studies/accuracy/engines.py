"""Flow engines: the velocity's error against time, as `gbm study speed` measures it"""

from __future__ import annotations

from ..bench import speed


def measure(quick: bool) -> list[dict]:
    """The rows of `speed`, of few meshes; when quick without pimpleFoam and turbulence."""
    if quick:
        return speed.run((32,), 48, ("smooth",), ("boxFoam", "boxFoam, order 2", "spectral"))["rows"]
    return speed.run((32, 48), 64)["rows"]


def lines(rows: list[dict]) -> list[str]:
    """The table of `speed`."""
    return speed.table({"rows": rows}).splitlines()
