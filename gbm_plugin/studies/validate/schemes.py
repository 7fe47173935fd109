"""Which of pimpleFoam's schemes have the least error for their time.

Around the schemes and correctors of a case, one after the other is changed, and some together. Every setting is of
second order in mesh and step at best, so an error E at the cost C becomes E (C/C0)^(1/2) on the mesh that brings the
cost to C0: half as wide a cell and step costs 16 times as much and has a quarter of the error. Settings are sorted by
that. The error in time by itself is the distance from the same mesh at a step so small that it has settled.
"""

from __future__ import annotations

import argparse
import re
import tempfile
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure
from matplotlib.ticker import LogLocator, NullFormatter

from ...case.layout import log_file
from ...report.style import COLOURS, new_figure
from ..scenes import checked_cells, checked_step
from ..study import option
from . import comparison
from .comparison import END_TIME, State

SCHEMES, SOLUTION = "system/fvSchemes", "system/fvSolution"
SOLVER = {"system/controlDict": {"application": "pimpleFoam"}}  # boxFoam has no such schemes


@dataclass(frozen=True)
class Setting:
    """Dictionaries that differ from the case's. steps: of END_TIME, in units of the fewest."""

    changes: dict = field(default_factory=dict)
    interpolation: str | None = None  # of the flow at the beads; None: the case's
    steps: tuple[int, ...] = (1, 2)
    same_space: bool = True  # as the case, so that their errors in time can be told from those of the mesh


def _time(scheme: str) -> Setting:
    return Setting({SCHEMES: {"ddtSchemes": {"default": scheme}}})


def _correctors(outer: int, inner: int, predictor: str = "yes") -> dict:
    words = {"momentumPredictor": predictor, "nOuterCorrectors": outer, "nCorrectors": inner}
    return {SOLUTION: {"PIMPLE": {**words, "pRefCell": 0, "pRefValue": 0}}}


def _convection(scheme: str, pressure: str = "Gauss linear", fluxes: str = "linear") -> dict:
    viscous = "div((nuEff*dev2(T(grad(U)))))"
    return {
        SCHEMES: {
            "divSchemes": {"default": "none", "div(phi,U)": scheme, viscous: "Gauss linear"},
            "gradSchemes": {"default": "Gauss linear", "grad(p)": pressure},
            "interpolationSchemes": {"default": "linear", '"(flux|dotInterpolate)\\(.*\\)"': fluxes},
        }
    }


def _space(changes: dict, steps: tuple[int, ...] = (2,)) -> Setting:
    return Setting(changes, steps=steps, same_space=False)


def _laminar(model: str) -> dict:
    return {"constant/turbulenceProperties": f"simulationType laminar; laminar {{ laminarModel {model}; }}\n"}


_CUBIC = _convection("Gauss leanCubic")
_CUBIC_P = _convection("Gauss leanCubic", "Gauss cubic")

SETTINGS = {
    "the case": Setting(steps=(1, 2, 4)),
    "laminar Stokes": _space(_laminar("Stokes")),
    "laminar constantViscosity": _space(_laminar("constantViscosity")),
    "Euler": _time("Euler"),
    "CrankNicolson 0.9": _time("CrankNicolson 0.9"),
    "CrankNicolson 1": _time("CrankNicolson 1"),
    "1 outer, 1 corrector": Setting(_correctors(1, 1)),
    "1 outer, 3 correctors": Setting(_correctors(1, 3)),
    "2 outer, 1 corrector": Setting(_correctors(2, 1), steps=(1, 2, 4)),
    "2 outer, 2 correctors": Setting(_correctors(2, 2), steps=(1, 2, 4)),
    "3 outer, 1 corrector": Setting(_correctors(3, 1)),
    "no predictor, 2 correctors": Setting(_correctors(1, 2, "no")),
    "no predictor, 3 correctors": Setting(_correctors(1, 3, "no")),
    "linearUpwind": _space(_convection("Gauss linearUpwind grad(U)")),
    "limitedLinear": _space(_convection("Gauss limitedLinear 1")),
    "vanLeer": _space(_convection("Gauss vanLeer")),
    "cubic": _space(_convection("Gauss cubic")),
    "leanCubic": _space(_CUBIC, (1, 2)),
    "leanCubic, grad(p) cubic": _space(_CUBIC_P, (1, 2)),
    "leanCubic, grad(p) cubic, fluxes leanCubic": _space(
        _convection("Gauss leanCubic", "Gauss cubic", "leanCubic")
    ),
    "leanCubic, grad(p) cubic, 2 outer, 1 corrector": _space(_CUBIC_P | _correctors(2, 1), (1, 2)),
    "leanCubic, grad(p) cubic, fluxes leanCubic, 2 outer, 1 corrector": _space(
        _convection("Gauss leanCubic", "Gauss cubic", "leanCubic") | _correctors(2, 1), (1, 2)
    ),
    "fibers trilinear": Setting(interpolation="trilinear", steps=(2,), same_space=False),
    "fibers cubic": Setting(interpolation="cubic", steps=(2,), same_space=False),
    "fibers cell": Setting(interpolation="cell", steps=(2,), same_space=False),
    "fibers cellPoint": Setting(interpolation="cellPoint", steps=(2,), same_space=False),
    "fibers cellPointFace": Setting(interpolation="cellPointFace", steps=(2,), same_space=False),
}


def add_arguments(parser: argparse.ArgumentParser) -> None:
    option(parser, run, "case", "OpenFOAM case around whose schemes others are tried (default: this folder)")
    option(parser, run, "cells", "in each direction")
    option(parser, run, "time_step", "the longest, of the first mesh [s]")
    option(parser, run, "settings", "names of settings (default: all)", metavar="NAME")


def run(
    case: Path | str,
    cells: Sequence[int] = (32,),
    time_step: float = 0.06,
    settings: Sequence[str] = tuple(SETTINGS),
) -> dict:
    """Errors and processor time of the `settings` (names of SETTINGS) on each mesh.

    case: whose other schemes and solver settings are used. time_step: the longest, of the first of `cells` [s];
    others take it in proportion. Raises as `gbm_plugin.run.openfoam.run`.
    """
    checked_cells(cells)
    checked_step(time_step, END_TIME / 4)
    for name in settings:
        if name not in SETTINGS:
            raise ValueError(f"there is no setting '{name}'; allowed: {'; '.join(SETTINGS)}")
    rows = []
    for n in cells:
        fewest = round(END_TIME / (time_step * cells[0] / n))
        with tempfile.TemporaryDirectory(prefix="gbm-validate-") as folder:
            rows += _Mesh(Path(case), Path(folder), n, fewest).rows(settings)
    return {"end_time": END_TIME, "rows": rows, "orders": _orders(rows)}


class _Mesh:
    """The runs on one mesh."""

    def __init__(self, case: Path, folder: Path, cells: int, fewest: int):
        self.case, self.folder, self.cells, self.fewest = case, folder, cells, fewest
        self.word = comparison.sampling_word(case)
        self.reference = self._spectral(4 * fewest)
        # the limit of small steps: a step at which neither correctors nor scheme matter any more
        self.limit, _ = self._openfoam(Setting(_correctors(2, 2)), 16 * fewest)

    def rows(self, settings: Sequence[str]) -> list[dict]:
        rows = []
        for name in settings:
            setting = SETTINGS[name]
            runs = [(m * self.fewest, *self._openfoam(setting, m * self.fewest)) for m in setting.steps]
            # of the same work, the least disturbed
            seconds = min(second for _, _, second in runs)
            rows += [self._row(name, setting, steps, state, seconds * steps) for steps, state, _ in runs]
        base = next((r for r in rows if r["setting"] == "the case"), rows[0])
        for row in rows:
            share = np.sqrt(row["processor_seconds"] / base["processor_seconds"])
            for name in ("velocity", "fiber"):
                row[f"{name}_at_equal_cost"] = float(row[f"{name}_error"] * share)
        return rows

    def _row(self, name: str, setting: Setting, steps: int, state: State, seconds: float) -> dict:
        row = {"cells": self.cells, "setting": name, "time_step": END_TIME / steps}
        row |= {"velocity_error": comparison.velocity_distance(state, self.reference)}
        row |= {"fiber_error": _fibers(state, self.reference), "processor_seconds": seconds}
        if setting.same_space:
            row |= {
                "velocity_in_time": comparison.velocity_distance(state, self.limit),
                "fiber_in_time": _fibers(state, self.limit),
            }
        return row

    def _copy(self) -> Path:
        return self.folder / f"{len(list(self.folder.iterdir()))}"

    def _spectral(self, steps: int) -> State:
        copy = self._copy()
        comparison.make(self.case, copy, self.cells, steps)
        return comparison.run(copy, self.cells, steps, "spectral", "exact")

    def _openfoam(self, setting: Setting, steps: int) -> tuple[State, float]:
        """The state at the end, and the solver's processor time for a step [s], without its start."""
        copy = self._copy()
        comparison.make(self.case, copy, self.cells, steps, changes=SOLVER | setting.changes)
        state = comparison.run(copy, self.cells, steps, "openfoam", setting.interpolation or self.word)
        times = re.findall(
            r"^ExecutionTime = (\S+) s",
            log_file(copy, comparison.application(copy)).read_text(),
            re.MULTILINE,
        )
        return state, (float(times[-1]) - float(times[0])) / (len(times) - 1)


def _fibers(state: State, other: State) -> float:
    """Rms over the families."""
    return float(np.sqrt(np.mean(np.square(list(comparison.fiber_distance(state, other).values())))))


def _orders(rows: list[dict]) -> list[dict]:
    """Observed orders in the step, from its error by itself at the two smallest steps of each setting."""
    orders = []
    for key in dict.fromkeys((r["cells"], r["setting"]) for r in rows if "velocity_in_time" in r):
        ours = sorted((r for r in rows if (r["cells"], r["setting"]) == key), key=lambda r: r["time_step"])
        if len(ours) < 2:
            continue
        fine, coarse = ours[:2]
        ratio = np.log(coarse["time_step"] / fine["time_step"])
        order = {n: float(np.log(coarse[n] / fine[n]) / ratio) for n in ("velocity_in_time", "fiber_in_time")}
        orders.append({"cells": key[0], "setting": key[1], "time_step": fine["time_step"]} | order)
    return orders


def rows(result: dict) -> list[dict]:
    """The lines of a CSV file."""
    return result["rows"]


def table(result: dict) -> str:
    """The result of `run` as text, best first."""
    lines = [
        "Errors against the spectral solver; in time alone; and at the cost of the case at its longest step",
        f"{'cells':>5} {'setting':66} {'step [s]':>8} {'velocity':>10} {'fibers':>10} {'in time':>19} "
        f"{'at equal cost':>19} {'CPU [s]':>8}",
    ]
    for row in sorted(result["rows"], key=lambda r: (r["cells"], r["velocity_at_equal_cost"])):
        in_time = "".join(
            f"{row[f'{n}_in_time']:10.2e}" if f"{n}_in_time" in row else 10 * " "
            for n in ("velocity", "fiber")
        )
        lines.append(
            f"{row['cells']:5d} {row['setting']:66} {row['time_step']:8.4g} {row['velocity_error']:10.3e} "
            f"{row['fiber_error']:10.3e}{in_time}{row['velocity_at_equal_cost']:10.2e}"
            f"{row['fiber_at_equal_cost']:10.2e} {row['processor_seconds']:8.2f}"
        )
    lines.append("Observed orders in time: of the velocity, of the fibers")
    for order in result["orders"]:
        lines.append(
            f"{order['cells']:5d} {order['setting']:66} {order['time_step']:8.4g} "
            f"{order['velocity_in_time']:10.2f} {order['fiber_in_time']:10.2f}"
        )
    return "\n".join(lines)


def draw(result: dict) -> Figure:
    """Error of flow and fibers against processor time; the case and the best five settings are named."""
    rows = result["rows"]
    ranked = [r["setting"] for r in sorted(rows, key=lambda r: r["velocity_at_equal_cost"])]
    named = list(dict.fromkeys(["the case", *ranked]))[:6]
    figure = new_figure(9.5, 5.6)
    for axes, name in zip(figure.subplots(1, 2), ("velocity", "fiber"), strict=True):
        for cells, setting in dict.fromkeys((r["cells"], r["setting"]) for r in rows):
            ours = [r for r in rows if (r["cells"], r["setting"]) == (cells, setting)]
            known = setting in named
            colour = COLOURS[named.index(setting)] if known else "0.75"
            x, y = ([r[key] for r in ours] for key in ("processor_seconds", f"{name}_error"))
            axes.plot(x, y, "o-", color=colour, linewidth=1, zorder=3 if known else 2, label=setting)
        axes.set(xscale="log", yscale="log", xlabel="processor time of the solver [s]")
        axes.set_ylabel("error of the velocity" if name == "velocity" else "error of the fibers")
        for axis in (axes.xaxis, axes.yaxis):
            axis.set_major_locator(LogLocator(subs=(1, 2, 5)))
            axis.set_major_formatter("{x:g}")
            axis.set_minor_formatter(NullFormatter())
    handles = dict(zip(*reversed(axes.get_legend_handles_labels()), strict=True))
    figure.legend([handles[n] for n in named], named, loc="outside lower center", ncols=2, fontsize=9)
    return figure
