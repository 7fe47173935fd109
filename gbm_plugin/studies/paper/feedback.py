"""Fibers that act on forced turbulence: what they take, on which scales, and what becomes of them

A box of turbulence at constant power, developed without fibers, goes on with straight ones at several volume fractions,
rods and flexible ones, in the spectral solver with feedback. Beads are so small beside a cell that their own
disturbance is below a twentieth of their slip (docs/equations.md). Every run that is done is kept beside `--out`, and a
repeated call goes on from there.
"""

from __future__ import annotations

import argparse
import json
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure

from ...fiber import Fibers, Group, Stepper
from ...spectral import LinearForcing, SpectralSolver
from ...statistics.fibers import end_to_end, end_to_end_squared_ratio
from ...statistics.series import batch_means
from ..study import option, steps

POWER, BOX, RESOLUTION = 0.1, 2 * np.pi, 1.5  # of k_max η
OWN_DISTURBANCE = 0.05  # a/(√π Δx)
BEADS = 56
FLEXIBLE = 5.0  # L/l_p of the flexible ones
EVERY = 10  # steps between samples
BATCHES = 6  # of the standard errors
QUANTITIES = ("k", "epsilon", "exchange", "R2", "tumbling")


def add_arguments(parser: argparse.ArgumentParser) -> None:
    option(parser, run, "out", "where finished runs are kept, NAME.json and so on")
    option(parser, run, "cells", "in each direction; with them η = 1.5/k_max, and the beads' size")
    option(parser, run, "counts", "of fibers, besides none")
    option(parser, run, "time_step", "[s]")
    option(parser, run, "develop", "without fibers before they are put in [s]")
    option(parser, run, "settle", "with fibers before averages begin [s]")
    option(parser, run, "end", "of the averages [s]")


def run(
    out: str = "feedback",
    cells: int = 40,
    counts: Sequence[int] = (60, 120, 240),
    time_step: float = 0.0125,
    develop: float = 12.0,
    settle: float = 6.0,
    end: float = 30.0,
) -> dict:
    """Averages with standard errors of every run: rows of k, ε, the exchange, ⟨R²⟩/L² and ⟨ṗ²⟩τ²; spectra E(k), and of
    the exchange. Raises ValueError where a kept run is of other parameters."""
    if not 0 < settle < end:
        raise ValueError(f"settle is {settle:g}; it must lie between 0 and end, {end:g}")
    eta = RESOLUTION / ((cells - 1) // 3 * 2 * np.pi / BOX)
    viscosity = (eta**4 * POWER) ** (1 / 3)
    radius = OWN_DISTURBANCE * np.sqrt(np.pi) * BOX / cells
    length = 2 * radius * BEADS
    flexible = (length / FLEXIBLE) ** 4 * np.sqrt(viscosity * POWER)
    scene = {
        "cells": cells,
        "viscosity": viscosity,
        "eta": eta,
        "radius": radius,
        "length": length,
        "time_step": time_step,
        "develop": develop,
        "settle": settle,
        "end": end,
    }
    plan = [("none", 0, 0.0)]
    plan += [(name, n, k) for n in counts for name, k in (("rods", 1e3 * flexible), ("flexible", flexible))]
    result: dict = {"scene": scene, "runs": []}
    start = None
    for name, count, stiffness in plan:
        path = Path(f"{out}_{name}_{count}.json")
        if path.is_file():
            done = json.loads(path.read_text())
            if done["scene"] != scene:
                raise ValueError(f"{path} is of other parameters: remove it, or give another --out")
        else:
            start = start or _developed(scene)
            done = {"name": name, "count": count, "scene": scene}
            done |= _averages(scene, start, count, stiffness, f"{count} {name}")
            path.write_text(json.dumps(done))
        density = count / BOX**3
        done["volume_fraction"] = density * BEADS * 4 / 3 * np.pi * radius**3
        done["dilute_viscosity"] = 2 * np.pi / 15 * density * radius**3 * BEADS * (BEADS**2 - 1)
        result["runs"].append(done)
    return result


def _solver(scene: dict) -> SpectralSolver:
    forcing = LinearForcing(power=POWER)
    options = {"time_step": scene["time_step"], "precision": "single"}
    return SpectralSolver(scene["cells"], scene["viscosity"], BOX, forcing, **options)


def _developed(scene: dict) -> dict:
    """The state of the flow without fibers."""
    solver, n = _solver(scene), scene["cells"]
    solver.set_velocity(np.random.default_rng(1).standard_normal((3, n, n, n)))
    k, spectrum = solver.spectrum()
    wanted = np.where((k > 0) & (k <= 4), 1.0, 0.0)  # the large scales alone, at about their later energy
    shell = np.rint(np.sqrt(solver.modes.k_squared) / solver.modes.k0).astype(int)
    factor = np.sqrt(wanted / np.maximum(spectrum, 1e-30))[shell] * 0.3
    solver.set_velocity(solver.operators.to_physical((solver.coefficients * factor).astype(np.complex64)))
    for _ in steps(range(round(scene["develop"] / scene["time_step"])), 0, "develop"):
        solver.advance(1)
    return solver.state()


def _averages(scene: dict, start: dict, count: int, stiffness: float, title: str) -> dict:
    solver, h = _solver(scene), scene["time_step"]
    solver.restore(start)
    begin = solver.time
    group = None
    if count:
        mu = scene["viscosity"]  # density 1
        fibers = Fibers.straight(count, BEADS, scene["length"], stiffness, mu, box=BOX, seed=1)
        group = Group([Stepper(fibers, begin, "implicit")])

    def sample():
        return solver.sample(group.positions, solver.time, "rotation")

    def observe():
        group.observe(group.time, *sample())

    series: dict[str, list[float]] = {name: [] for name in QUANTITIES}
    spectra, exchanges, times = [], [], []
    before = None
    if group:
        observe()
    total = round(scene["end"] / h)
    for step in steps(range(1, total + 1), total, title):
        if group:
            r = group.reaction(h)
            solver.set_point_forces(group.positions, r.force, r.torque)
        solver.advance(1)
        if group:
            group.advance(h)
            observe()
            while group.provisional:
                group.correct()
                observe()
        late = step * h > scene["settle"]
        if group and late and step % EVERY == EVERY - 1:
            before = _directions(group)
        if late and step % EVERY == 0:
            if group:
                r = group.reaction(h)
                solver.set_point_forces(group.positions, r.force, r.torque)
                ratio = end_to_end_squared_ratio(group.by_family[0], scene["radius"]).mean()
                turn = ((_directions(group) - before) ** 2).sum(axis=1).mean() / h**2
            else:
                ratio = turn = 0.0
            energies = solver.energetics()
            values = (energies["kinetic_energy"], energies["dissipation"], energies["exchange"], ratio)
            tumbling = turn * scene["viscosity"] / energies["dissipation"]
            for name, value in zip(QUANTITIES, (*values, tumbling), strict=True):
                series[name].append(float(value))
            times.append(solver.time - begin)
            k, e = solver.spectrum()
            spectra.append(e.tolist())
            exchanges.append(solver.exchange_spectrum()[1].tolist())
    found = {name: batch_means(values, BATCHES) for name, values in series.items()}
    by_shell = [[batch_means(s, BATCHES) for s in np.transpose(all_)] for all_ in (spectra, exchanges)]
    return {
        "means": {name: [float(v) for v in value] for name, value in found.items()},
        "wavenumbers": k.tolist(),
        "spectrum": [[float(v) for v in value] for value in by_shell[0]],
        "exchange_spectrum": [[float(v) for v in value] for value in by_shell[1]],
        "times": times,
        "series": series,
    }


def _directions(group: Group) -> np.ndarray:
    ends = end_to_end(group.by_family[0])
    return ends / np.linalg.norm(ends, axis=1, keepdims=True)


def rows(result: dict) -> list[dict]:
    """The lines of a CSV file."""
    lines = []
    for r in result["runs"]:
        line = {"fibers": r["name"], "count": r["count"], "volume_fraction": r["volume_fraction"]}
        line["dilute_viscosity"] = r["dilute_viscosity"]
        for name in QUANTITIES:
            line[name], line[f"{name}_error"] = r["means"][name]
        lines.append(line)
    return lines


def table(result: dict) -> str:
    """The result of `run` as text."""
    head = f"{'fibers':>9} {'count':>5} {'fraction':>9} {'nu_f/nu':>8}  " + "  ".join(
        f"{q:^17}" for q in QUANTITIES
    )
    lines = [head]
    for r in rows(result):
        text = "  ".join(f"{r[q]:8.4f} ± {r[f'{q}_error']:6.4f}" for q in QUANTITIES)
        lines.append(
            f"{r['fibers']:>9} {r['count']:5d} {r['volume_fraction']:9.2e} {r['dilute_viscosity']:8.3f}  {text}"
        )
    return "\n".join(lines)


def draw(result: dict) -> Figure:
    """Spectra of the energy, over that without fibers, and of the exchange."""
    figure = Figure(figsize=(9, 4), layout="constrained")
    left, right = figure.subplots(1, 2)
    none = np.array(result["runs"][0]["spectrum"])[:, 0]
    densities = sorted({r["count"] for r in result["runs"]})
    for r in result["runs"]:
        k = np.array(r["wavenumbers"])
        some = (k > 0) & (none > 0) & (k <= (r["scene"]["cells"] - 1) // 3)
        k, e, x = (
            k[some] * r["scene"]["eta"],
            np.array(r["spectrum"])[some],
            np.array(r["exchange_spectrum"])[some],
        )
        style = {
            "fmt": {"rods": "o-", "flexible": "s--"}.get(r["name"], ":"),
            "markersize": 3,
            "color": f"C{densities.index(r['count'])}" if r["count"] else "0.3",
            "label": f"{r['name']}, φ = {r['volume_fraction']:.1e}" if r["count"] else "none",
        }
        left.errorbar(k, e[:, 0] / none[some], e[:, 1] / none[some], **style)
        if r["count"]:
            right.errorbar(k, 1e3 * x[:, 0], 1e3 * x[:, 1], **style)
    left.set(xlabel="kη", ylabel="E(k) over that without fibers")
    right.set(xlabel="kη", ylabel="power given to a shell, 10⁻³ m³/s³")
    right.axhline(0, color="0.7", linewidth=0.8)
    left.legend(fontsize="small")
    return figure
