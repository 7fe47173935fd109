"""Which methods are worth their time."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

MARGIN = 0.8  # nearer than this, times and errors are alike


def on_front(row: Mapping, rows: Sequence[Mapping], cost: str = "seconds", error: str = "error") -> bool:
    """Whether no other of the rows is as fast and as accurate, and markedly better in one of both."""
    for other in rows:
        as_good = other[cost] <= row[cost] and other[error] <= row[error]
        if as_good and (other[cost] < MARGIN * row[cost] or other[error] < MARGIN * row[error]):
            return False
    return True


def draw_front(axes, rows: Sequence[Mapping], cost: str, error: str = "error") -> None:
    """A grey line through those on the front, by their cost."""
    front = sorted((row[cost], row[error]) for row in rows if row["on_front"])
    axes.plot(*zip(*front, strict=True), "--", color="0.6", linewidth=2, zorder=0)


def mark_front(rows: Sequence[dict], *same: str, cost: str = "seconds", error: str = "error") -> None:
    """Add `on_front` to each row, among those alike in the columns `same`."""
    for row in rows:
        others = [other for other in rows if all(other[name] == row[name] for name in same)]
        row["on_front"] = on_front(row, others, cost, error)
