"""What the choice of a solver means: `application` of system/controlDict, or the spectral solver in its place."""

from __future__ import annotations

import re
from pathlib import Path

from .dictionary import Dictionary
from .layout import SPECTRAL
from .scene import Scene

# of the spectral solver: the Courant number of a step of its flow; how much it keeps of the wavenumbers of its nodes
SPECTRAL_COURANT, TRUNCATED = 0.34, 2 / 3

# words of boxSchemes: order in space, and the Courant number sum |u_d| dt/h_d up to which AB3 is stable with them
DIFFERENCES = {"central2": ("second", 0.72), "central4": ("fourth", 0.53), "central6": ("sixth", 0.46)}
# c of their second difference, sum c_m (u(+m) - 2u + u(-m))/h^2
SECOND = {"central2": (1.0,), "central4": (4 / 3, -1 / 12), "central6": (3 / 2, -3 / 20, 1 / 90)}


def scheme(scene: Scene) -> str:
    """What the case's solver does, in few words. CaseError for differences that boxFoam does not have."""
    if scene.application == "boxFoam":
        order, _ = DIFFERENCES[_differences(scene.case)]
        return f"{order} order in space, third in time"
    if scene.application == SPECTRAL:
        cycles = sub_cycles(scene.case)
        return "pseudo-spectral, 2/3 of the modes, third order in time" + f", {cycles} steps in one" * (
            cycles > 1
        )
    text = "finite volumes, by fvSchemes and fvSolution"
    return f"{text}; boxFoam solves this box far faster" if scene.box and scene.cells else text


def stable_courant(scene: Scene) -> float | None:
    """The Courant number sum |u_d| dt/h_d up to which the solver is stable; None where it is implicit."""
    if scene.application == SPECTRAL:
        return SPECTRAL_COURANT * sub_cycles(scene.case)
    return DIFFERENCES[_differences(scene.case)][1] if scene.application == "boxFoam" else None


def asked_by(scene: Scene) -> str:
    """Where the solver is chosen."""
    return f"--flow {SPECTRAL}" if scene.application == SPECTRAL else f"application {scene.application}"


def sub_cycles(case: Path) -> int:
    """Steps of the spectral flow in one deltaT, of the fibers and of the coupling: fvSolution, spectral { nSubCycles
    n; }."""
    solution = Dictionary.read(case, "system/fvSolution") if (case / "system/fvSolution").is_file() else None
    if solution is None or SPECTRAL not in solution:
        return 1
    d = solution.sub(SPECTRAL)
    cycles = d.integer("nSubCycles", 1, least=1)
    d.done()
    return cycles


def second_difference(case: Path) -> tuple[float, ...]:
    """c_m of the second difference sum c_m (u(+m) - 2u + u(-m))/h^2 of the case's solver on equal cells."""
    solver = Dictionary.read(case, "system/controlDict").word("application")
    return SECOND[_differences(case) if solver == "boxFoam" else "central2"]


def face_values(case: Path) -> tuple[str, str]:
    """cubic, or linear as which all others count: what a solver of finite volumes has at faces for grad(p) and for the
    fluxes whose divergence its pressure removes."""
    schemes = Dictionary.read(case, "system/fvSchemes")
    gradient = _scheme(schemes.sub("gradSchemes", {}), "grad(p)")
    fluxes = _scheme(schemes.sub("interpolationSchemes", {}), "flux(HbyA)")
    return tuple("cubic" if "cubic" in word.lower() else "linear" for word in (gradient, fluxes))


def _scheme(group: Dictionary, name: str) -> str:
    """What OpenFOAM finds for a name, or a pattern of it, or the default."""
    patterns = [n for n in reversed(group.names) if n != name and _matches(group, n, name)]
    found = next((n for n in (name, *patterns, "default") if n in group), None)
    return str(group.raw(found)) if found else ""


def _matches(group: Dictionary, pattern: str, name: str) -> bool:
    try:
        return re.fullmatch(pattern, name) is not None
    except re.error as error:
        raise group.fail(pattern, f"is no pattern of names: {error}") from None


def _differences(case: Path) -> str:
    box = Dictionary.read(case, "system/fvSchemes").sub("boxSchemes", {})
    return box.word("differences", DIFFERENCES, "central6")
