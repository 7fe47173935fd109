"""Where the time of a step of OpenFOAM goes: the default case beside the best of OpenFOAM's own solvers.

The case without fibers. OpenFOAM's profiling is written at every step; the settings take turns, and
each time is the smallest of all steps but the first, so that what else the machine does is left out.
--processor-time leaves out also the time in which the process did not run; it is for one rank.
"""

from __future__ import annotations

import argparse
import re
import shutil
import subprocess
import tempfile
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path

from ...case.copies import HEADER
from ...case.openfoam import command, environment, utility
from ...case.prepare import initial_fields
from ...case.scene import read_scene
from ..study import option
from ..study import steps as study_steps

FFT = "solver PCG; preconditioner periodicFFT;"
GAMG = "solver GAMG; smoother {};"
PCG_GAMG = "solver PCG; preconditioner {{ preconditioner GAMG; smoother {}; nVcycles {}; }}"
LOOSE = "tolerance 1e-7; relTol 0.01;", "tolerance 1e-6; relTol 0;"
TIGHT = "tolerance 1e-8; relTol 0;", "tolerance 1e-8; relTol 0;"
U = "solver PBiCGStab; preconditioner diagonal; tolerance 1e-8; relTol 0;"
SMOOTH = "solver smoothSolver; smoother {}; tolerance 1e-8; relTol 0;"
COUPLED = "type coupled; tolerance (1e-8 1e-8 1e-8); relTol (0 0 0); solver {};"


@dataclass(frozen=True)
class Setting:
    """Solvers of pressure and momentum, tolerances of p and pFinal, laminar model, interpolation, correctors."""

    pressure: str = FFT
    tolerances: tuple[str, str] = TIGHT
    momentum: str = U
    laminar: str = "constantViscosity"
    cubic: str = "leanCubic"  # or cubic, or linear: convection, grad(p), fluxes
    outer: int = 2
    inner: int = 2

    def write(self, case: Path) -> None:
        p, final = self.tolerances
        (case / "system/fvSolution").write_text(
            HEADER + f"solvers {{ p {{ {self.pressure} {p} }} pFinal {{ {self.pressure} {final} }}"
            f' "U|UFinal" {{ {self.momentum} }} }}\n'
            f"PIMPLE {{ nOuterCorrectors {self.outer}; nCorrectors {self.inner}; pRefCell 0; pRefValue 0; }}\n"
        )
        (case / "constant/turbulenceProperties").write_text(
            HEADER + f"simulationType laminar; laminar {{ laminarModel {self.laminar}; }}\n"
        )
        schemes = case / "system/fvSchemes"
        viscous = "div((nuEff*dev2(T(grad(U))))) Gauss linear;"
        pressure = "linear" if self.cubic == "linear" else "cubic"
        schemes.write_text(
            HEADER
            + f"""ddtSchemes {{ default backward; }}
            gradSchemes {{ default Gauss linear; grad(p) Gauss {pressure}; }}
            divSchemes {{ default none; div(phi,U) Gauss {self.cubic}; {viscous} }}
            laplacianSchemes {{ default Gauss linear orthogonal; }}
            interpolationSchemes {{ default linear; "(flux|dotInterpolate)\\(.*\\)" {self.cubic}; }}
            snGradSchemes {{ default orthogonal; }}
            """
        )


STOCK = {"laminar": "Stokes", "cubic": "cubic"}
FORMER = {"cubic": "linear", "outer": 1, "inner": 2}
SETTINGS = {
    "ours": Setting(),
    "ours, Stokes": Setting(laminar="Stokes"),
    "ours, cubic": Setting(cubic="cubic"),
    "ours, linear": Setting(cubic="linear"),
}
for accuracy, tolerances in (("loose", LOOSE), ("1e-8", TIGHT)):
    for name, solver in {
        "GAMG GaussSeidel": GAMG.format("GaussSeidel"),
        "GAMG DICGaussSeidel": GAMG.format("DICGaussSeidel"),
        "PCG GAMG GaussSeidel": PCG_GAMG.format("GaussSeidel", 1),
        "PCG DIC": "solver PCG; preconditioner DIC;",
    }.items():
        SETTINGS[f"stock {name} {accuracy}"] = Setting(solver, tolerances, **STOCK)
    best = PCG_GAMG.format("GaussSeidel", 1)
    SETTINGS[f"1x2 linear stock {accuracy}"] = Setting(best, tolerances, **FORMER, laminar="Stokes")
SETTINGS["1x2 linear ours"] = Setting(**FORMER)
SETTINGS |= {
    f"U {name}": Setting(momentum=solver)
    for name, solver in {
        "GaussSeidel": SMOOTH.format("GaussSeidel"),
        "symGaussSeidel": SMOOTH.format("symGaussSeidel"),
        "PBiCGStab DILU": U.replace("diagonal", "DILU"),
        "PBiCG diagonal": U.replace("PBiCGStab", "PBiCG"),
        "coupled GaussSeidel": COUPLED.format("SmoothSolver; smoother GaussSeidel"),
        "coupled PBiCICG diagonal": COUPLED.format("PBiCICG; preconditioner diagonal"),
    }.items()
}

# one of std::chrono's clocks, that of OpenFOAM's profiling or of the coupling's table, replaced by that of the thread
PROCESS_CLOCK = """
#include <chrono>
#include <ctime>
std::chrono::CLOCK::time_point std::chrono::CLOCK::now() noexcept
{
    timespec t;
    clock_gettime(CLOCK_THREAD_CPUTIME_ID, &t);
    return time_point(std::chrono::seconds(t.tv_sec) + std::chrono::nanoseconds(t.tv_nsec));
}
"""

PARTS = ("step", "pressure", "momentum", "forcing", "rest")


def make_case(case: Path, path: Path, cells: int, ranks: int, steps: int) -> None:
    """The case with this many cells, no fibers, and profiling written at every step."""
    for folder in ("0.orig", "constant", "system"):
        shutil.copytree(case / folder, path / folder, ignore=shutil.ignore_patterns("polyMesh"))
    time_step = 0.64 / cells  # the same Courant number on every mesh
    block = path / "system/blockMeshDict"
    block.write_text(re.sub(r"^n .*?;", f"n {cells};", block.read_text(), flags=re.M))
    control = path / "system/controlDict"
    text = control.read_text()
    text = text[: text.index("functions")] + "profiling { active true; }\n"
    end = time_step * (steps + 0.5)
    for name, value in {"deltaT": time_step, "endTime": end, "writeInterval": 1}.items():
        text = re.sub(rf"^{name} .*?;", f"{name} {value!r};", text, flags=re.M)
    control.write_text(text)
    (path / "system/decomposeParDict").write_text(
        HEADER + f"numberOfSubdomains {ranks}; method simple; simpleCoeffs {{ n (1 1 {ranks}); }}\n"
    )
    utility(path, "blockMesh")
    initial_fields(read_scene(path))
    if ranks > 1:
        utility(path, "decomposePar")


def totals(profile: Path) -> dict[str, float]:
    """Seconds up to a step: the whole without what is written, and its parts. The rest is pimpleFoam's own:
    assembly, interpolation, gradients and fluxes."""
    spent: dict[str, float] = {}
    for trigger in re.findall(r"trigger\d+\s*\{(.*?)\}", profile.read_text(), flags=re.S):
        name = re.search(r'description\s+"(.*?)[ "]', trigger)[1]
        spent[name] = spent.get(name, 0) + float(re.search(r"totalTime\s+(.*?);", trigger)[1])
    step = spent["time.run()"] - spent.get("objectRegistry::writeObject", 0)
    parts = {
        "pressure": spent["fvMatrix::solve.p"],
        "momentum": spent["fvMatrix::solve.U"],
        "forcing": sum(seconds for name, seconds in spent.items() if name.endswith(".linearForcing")),
    }
    return {"step": step, **parts, "rest": step - sum(parts.values())}


def process_clock(folder: Path, clock: str = "system_clock") -> Path:
    """A library to be loaded before all others."""
    source = folder / "clock.cpp"
    source.write_text(PROCESS_CLOCK.replace("chrono::CLOCK", f"chrono::{clock}"))
    library = folder / "libclock.so"
    subprocess.run(["g++", "-O2", "-shared", "-fPIC", source, "-o", library], check=True)
    return library


def measure(path: Path, ranks: int, setting: Setting, clock: Path | None) -> dict[str, float | str]:
    """Smallest times [ms] of a step and its solves; iterations and continuity error of the last step."""
    setting.write(path)
    root = path / "processor0" if ranks > 1 else path
    argv = command("pimpleFoam", path, ranks)
    env = environment() | ({"LD_PRELOAD": str(clock)} if clock else {})
    done = subprocess.run(argv, env=env, capture_output=True, text=True)
    if done.returncode:
        raise RuntimeError(f"pimpleFoam failed:\n{done.stdout[-2000:]}{done.stderr[-2000:]}")
    folders = sorted((f for f in root.glob("0.*[0-9]")), key=lambda f: float(f.name))
    series = [totals(f / "uniform/profiling") for f in folders]
    best = {k: 1e3 * min(b[k] - a[k] for a, b in pairwise(series)) for k in series[0]}
    for folder in path.glob("**/0.[0-9]*"):
        if folder.is_dir():
            shutil.rmtree(folder)
    counts = re.findall(r"Solving for (\w+),.*No Iterations (\S+)", done.stdout)
    p_counts = [n for name, n in counts if name == "p"][-2:]
    u_counts = [n for name, n in counts if name.startswith("U")][-1:]
    iterations = f"p {' '.join(p_counts)}; U {' '.join(u_counts)}"
    return best | {
        "iterations": iterations,
        "continuity": re.findall(r"sum local = (\S+),", done.stdout)[-1],
    }


def add_arguments(parser: argparse.ArgumentParser) -> None:
    option(parser, run, "case", "OpenFOAM case of pimpleFoam (default: this folder)")
    option(parser, run, "cells", "in each direction, one mesh after the other")
    option(parser, run, "ranks", "of OpenFOAM, in slabs")
    option(parser, run, "steps", "of each run")
    option(parser, run, "repeats", "of which the best counts")
    option(parser, run, "only", "settings whose names begin with one of these (default: all)", metavar="WORD")
    option(parser, run, "processor_time", "without the time in which the process did not run; for one rank")


def run(
    case: Path | str,
    cells: Sequence[int] = (32, 64),
    ranks: Sequence[int] = (1, 2),
    steps: int = 5,
    repeats: int = 3,
    only: Sequence[str] = ("",),
    processor_time: bool = False,
) -> dict:
    """Smallest times [ms] of a step and its parts, for each mesh, number of ranks and setting."""
    if processor_time and list(ranks) != [1]:
        raise ValueError("--processor-time is for --ranks 1: ranks that wait use the processor, too")
    names = [n for n in SETTINGS if n.startswith(tuple(only))]
    if not names:
        raise ValueError(f"--only {' '.join(only)} is none of {', '.join(SETTINGS)}")
    rows = []
    meshes = [(n, r) for n in cells for r in ranks]
    for n, r in study_steps(meshes, len(meshes), "meshes"):
        with tempfile.TemporaryDirectory(prefix="gbm-bench-") as folder:
            path = Path(folder) / "case"
            make_case(Path(case), path, n, r, steps)
            clock = process_clock(Path(folder)) if processor_time else None
            best: dict[str, dict] = {}
            for _ in range(repeats):
                for name in names:
                    new, old = measure(path, r, SETTINGS[name], clock), best.get(name)
                    best[name] = new | {k: min(new[k], old[k]) if old else new[k] for k in PARTS}
        rows += [{"cells": n, "ranks": r, "setting": name} | b for name, b in best.items()]
    return {"rows": rows}


def rows(result: dict) -> list[dict]:
    """The lines of a CSV file."""
    return result["rows"]


def table(result: dict) -> str:
    """The result of `run` as text."""
    lines = [f"{'cells':>5} {'ranks':>5} {'setting':32} {' '.join(f'{part:>8}' for part in PARTS)} [ms]"]
    for b in result["rows"]:
        times = " ".join(f"{b[k]:8.1f}" for k in PARTS)
        lines.append(
            f"{b['cells']:5} {b['ranks']:5} {b['setting']:32} {times}"
            f"  iterations {b['iterations']}; continuity {float(b['continuity']):.1e}"
        )
    return "\n".join(lines)
