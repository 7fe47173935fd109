"""The mobilities by their words, and the scratch that each needs."""

from . import free_drain, implicit_drain, rpy
from .blocks import rows_of

_LAYOUTS = {
    "freeDrain": (free_drain.layout, implicit_drain.layout),
    "rpy": (rpy.layout, rpy.stage_layout),
}


def work_rows(mobility: str, beads: int, implicit: bool) -> int:
    """Rows of scratch that link_rates or stage needs for fibers of so many beads."""
    return rows_of(_LAYOUTS[mobility][implicit], beads)
