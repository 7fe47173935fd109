"""What the choice of a solver means: the word `application` of system/controlDict."""

from __future__ import annotations

from pathlib import Path

from .dictionary import Dictionary
from .scene import Scene

# words of boxSchemes: order in space, and the Courant number sum |u_d| dt/h_d up to which AB3 is stable with them
DIFFERENCES = {"central2": ("second", 0.72), "central4": ("fourth", 0.53), "central6": ("sixth", 0.46)}
# c of their second difference, sum c_m (u(+m) - 2u + u(-m))/h^2
SECOND = {"central2": (1.0,), "central4": (4 / 3, -1 / 12), "central6": (3 / 2, -3 / 20, 1 / 90)}


def scheme(scene: Scene) -> str:
    """The solver's order, in few words."""
    if scene.application != "boxFoam":
        return "finite volumes, by fvSchemes and fvSolution"
    box = Dictionary.read(scene.case, "system/fvSchemes").sub("boxSchemes", {})
    order, _ = DIFFERENCES[box.word("differences", DIFFERENCES, "central6")]
    return f"{order} order in space, third in time"


def stable_courant(scene: Scene) -> float | None:
    """The Courant number up to which the solver is stable; None where it is implicit."""
    if scene.application != "boxFoam":
        return None
    box = Dictionary.read(scene.case, "system/fvSchemes").sub("boxSchemes", {})
    return DIFFERENCES[box.word("differences", DIFFERENCES, "central6")][1]


def meaning(scene: Scene) -> str:
    """One line about the case's solver. CaseError for differences that boxFoam does not have."""
    if scene.application != "boxFoam":
        text = f"{scene.application}, finite volumes by system/fvSchemes and fvSolution, on any mesh"
        uniform = scene.box and scene.cells
        return (
            f"{text}; boxFoam solves this box of equal cells far faster (docs/boxfoam.md)"
            if uniform
            else text
        )
    order, courant = DIFFERENCES[_differences(scene.case)]
    text = f"boxFoam, {order} order in space, third in time, conserving momentum and energy"
    if not (scene.box and scene.cells):
        return text
    fastest = courant * min(b / n for b, n in zip(scene.box, scene.cells, strict=True)) / scene.time_step
    return f"{text}; stable while |u_x| + |u_y| + |u_z| is below {fastest:.3g} m/s"


def second_difference(case: Path) -> tuple[float, ...]:
    """c_m of the second difference sum c_m (u(+m) - 2u + u(-m))/h^2 of the case's solver on equal cells."""
    solver = Dictionary.read(case, "system/controlDict").word("application")
    return SECOND[_differences(case) if solver == "boxFoam" else "central2"]


def _differences(case: Path) -> str:
    box = Dictionary.read(case, "system/fvSchemes").sub("boxSchemes", {})
    return box.word("differences", DIFFERENCES, "central6")
