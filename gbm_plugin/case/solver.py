"""What the choice of a solver means: the word `application` of system/controlDict."""

from __future__ import annotations

import re
from pathlib import Path

from .dictionary import Dictionary
from .scene import Scene

# words of boxSchemes: order in space, and the Courant number sum |u_d| dt/h_d up to which AB3 is stable with them
DIFFERENCES = {"central2": ("second", 0.72), "central4": ("fourth", 0.53), "central6": ("sixth", 0.46)}
# c of their second difference, sum c_m (u(+m) - 2u + u(-m))/h^2
SECOND = {"central2": (1.0,), "central4": (4 / 3, -1 / 12), "central6": (3 / 2, -3 / 20, 1 / 90)}


def scheme(scene: Scene) -> str:
    """What the case's solver does, in few words. CaseError for differences that boxFoam does not have."""
    if scene.application == "boxFoam":
        order, _ = DIFFERENCES[_differences(scene.case)]
        return f"{order} order in space, third in time"
    text = "finite volumes, by fvSchemes and fvSolution"
    return f"{text}; boxFoam solves this box far faster" if scene.box and scene.cells else text


def stable_courant(scene: Scene) -> float | None:
    """The Courant number sum |u_d| dt/h_d up to which the solver is stable; None where it is implicit."""
    return DIFFERENCES[_differences(scene.case)][1] if scene.application == "boxFoam" else None


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
    patterns = [n for n in reversed(group.names) if n != name and re.fullmatch(n, name)]
    found = next((n for n in (name, *patterns, "default") if n in group), None)
    return str(group.raw(found)) if found else ""


def _differences(case: Path) -> str:
    box = Dictionary.read(case, "system/fvSchemes").sub("boxSchemes", {})
    return box.word("differences", DIFFERENCES, "central6")
