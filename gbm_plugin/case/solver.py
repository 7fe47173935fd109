"""What the choice of a solver means: the word `application` of system/controlDict."""

from __future__ import annotations

from .dictionary import Dictionary
from .scene import Scene

# words of boxSchemes: order in space, and the Courant number sum |u_d| dt/h_d up to which AB3 is stable with them
DIFFERENCES = {"central2": ("second", 0.72), "central4": ("fourth", 0.53), "central6": ("sixth", 0.46)}


def meaning(scene: Scene) -> str:
    """One line about the case's solver. CaseError for differences that boxFoam does not have."""
    if scene.application != "boxFoam":
        return f"{scene.application}, finite volumes by system/fvSchemes and fvSolution"
    box = Dictionary.read(scene.case, "system/fvSchemes").sub("boxSchemes", {})
    order, courant = DIFFERENCES[box.word("differences", DIFFERENCES, "central6")]
    text = f"boxFoam, {order} order in space, third in time, conserving momentum and energy"
    if not (scene.box and scene.cells):
        return text
    fastest = courant * min(b / n for b, n in zip(scene.box, scene.cells, strict=True)) / scene.time_step
    return f"{text}; stable while |u_x| + |u_y| + |u_z| is below {fastest:.3g} m/s"
