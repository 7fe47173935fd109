"""The report's curves. Each function returns a figure; style.save writes it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from matplotlib.figure import Figure
from numpy.typing import NDArray

from .style import COLOURS, LINES, new_figure

_DISSIPATION = {
    "epsilonBudget": "energy budget",
    "epsilonGradient": "velocity gradients",
    "epsilonLaplacian": "ν⟨u·∇²u⟩ of the solver",
}
_KOLMOGOROV = 1.6  # constant of E = C ε^(2/3) k^(-5/3), Sreenivasan 1995


def energy_figure(table: Mapping[str, NDArray], changed: Sequence[float] = ()) -> Figure:
    """Kinetic energy and dissipation against time from the columns of the forcing's table that are there; changed:
    times at which the case was."""
    figure = new_figure(6.4, 5.2)
    upper, lower = figure.subplots(2, 1, sharex=True)
    if "k" in table:
        upper.plot(table["Time"], table["k"], color=COLOURS[0])
    upper.set(ylabel="k [m²/s²]", ylim=(0, None))
    drawn = [name for name in _DISSIPATION if name in table]
    for number, name in enumerate(drawn):
        style = dict(color=COLOURS[number], linestyle=LINES[number], label=_DISSIPATION[name])
        lower.plot(table["Time"], table[name], **style)
    if drawn:
        lower.legend(ncols=len(drawn), loc="lower center", bbox_to_anchor=(0.5, 1.0))
    lower.margins(x=0.01)
    _mark(changed, upper, lower)
    lower.set(xlabel="t [s]", ylabel="ε [m²/s³]", ylim=(0, None))
    figure.align_ylabels()
    return figure


def _mark(times: Sequence[float], *axes) -> None:
    """Where the case was changed between two parts of the run."""
    for time in times:
        for panel in axes:
            panel.axvline(time, color="0.45", linewidth=1, linestyle=":", zorder=0)


def spectrum_figure(
    k: NDArray, spectrum: NDArray, time: float, dissipation: float | None, length: float | None
) -> Figure:
    """E(k) [m³/s²] at one time; with dissipation ε and Kolmogorov length η, also compensated against kη."""
    inside = (k > 0) & (spectrum > 0)
    k, spectrum = k[inside], spectrum[inside]
    known = dissipation is not None and length is not None
    figure = new_figure(8.8 if known else 5.2, 3.9)
    panels = np.atleast_1d(figure.subplots(1, 2 if known else 1))
    panels[0].loglog(k, spectrum, "o-", markersize=3.5, color=COLOURS[0])
    panels[0].set(xlabel="k [rad/m]", ylabel="E(k) [m³/s²]")
    if known:
        compensated = spectrum * k ** (5 / 3) * dissipation ** (-2 / 3)
        panels[1].loglog(k * length, compensated, "o-", markersize=3.5, color=COLOURS[0])
        label = f"E = {_KOLMOGOROV} ε$^{{2/3}}$ k$^{{-5/3}}$"
        panels[1].axhline(_KOLMOGOROV, color="0.45", linewidth=1, linestyle="--", label=label)
        panels[1].legend(loc="lower left")
        panels[1].set(xlabel="k η", ylabel="E(k) k$^{5/3}$ ε$^{-2/3}$")
    figure.suptitle(f"t = {time:g} s", fontsize=11)
    return figure


def end_to_end_figure(
    times: NDArray, families: Mapping[str, tuple[NDArray, NDArray, int]], changed: Sequence[float] = ()
) -> Figure:
    """Mean squared end-to-end distance against time, R normalised by the contour length 2a(N−1).

    families: by name, the mean over fibers (S,), its standard error (S,), and the number of beads.
    changed: times at which the case was.
    """
    figure = new_figure(6.4, 4.2)
    axes = figure.subplots()
    for number, (name, (mean, error, beads)) in enumerate(families.items()):
        colour = COLOURS[number % len(COLOURS)]
        label = f"{name} (N = {beads}; × {((beads - 1) / beads) ** 2:.3f} for L = 2aN)"
        marker = "." if len(times) < 60 else ""
        line = LINES[number // len(COLOURS) % len(LINES)]
        axes.plot(times, mean, color=colour, linestyle=line, marker=marker, label=label)
        axes.fill_between(times, mean - error, mean + error, color=colour, alpha=0.2, linewidth=0)
    axes.axhline(1, color="0.45", linewidth=1, linestyle="--")
    _mark(changed, axes)
    axes.set(xlabel="t [s]", ylabel="⟨R²⟩ / L²,  L = 2a(N−1)", ylim=(0, 1.05))
    axes.legend(loc="lower left")
    return figure
