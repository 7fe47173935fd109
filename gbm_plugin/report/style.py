"""One look for all figures: a colour-blind-safe palette (Okabe & Ito 2008), and saving as PNG and PDF."""

from __future__ import annotations

from pathlib import Path

import matplotlib
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from ..files import replaced

COLOURS = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#56B4E9", "#E69F00", "#000000")
LINES = ("-", "--", "-.", ":")
MARKERS = "osD^vP*X"

_STYLE = {
    "font.size": 11,
    "axes.labelsize": 12,
    "axes.titlesize": 11,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.grid": True,
    "grid.color": "0.9",
    "grid.linewidth": 0.6,
    "axes.axisbelow": True,
    "lines.linewidth": 1.8,
    "legend.frameon": False,
    "legend.fontsize": 10,
    "mathtext.fontset": "dejavusans",
    "pdf.fonttype": 42,  # text stays text
    "savefig.dpi": 200,
}


def styled():
    """Context in which figures are made."""
    return matplotlib.rc_context(_STYLE)


def new_figure(width: float = 6.4, height: float = 4.0) -> Figure:
    """An empty figure (inches) that needs no display and no global state."""
    figure = Figure(figsize=(width, height), layout="constrained")
    FigureCanvasAgg(figure)
    return figure


def save(figure: Figure, folder: Path, name: str) -> list[Path]:
    """Write <folder>/<name>.png and .pdf."""
    paths = [folder / f"{name}.{suffix}" for suffix in ("png", "pdf")]
    for path in paths:
        metadata = {"CreationDate": None} if path.suffix == ".pdf" else None
        with replaced(path, "wb") as file:
            figure.savefig(file, format=path.suffix[1:], metadata=metadata, facecolor="white")
        figure.set_layout_engine("none")  # what lies where has been found; it is a third of the work
    return paths
