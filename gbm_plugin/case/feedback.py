"""Whether beads that act on the flow can be points in it: numbers of a scene with feedback, and what is refused.

A Scene and its Family, which `scene` has, go without a type here: it asks this module, and no import runs in a circle.
"""

from __future__ import annotations

import math

from ..errors import CaseError

NEGLIGIBLE, TOO_LARGE = (
    0.05,
    0.5,
)  # of its slip, that a bead finds: nothing is done below, nothing helps above
STABLE = 0.5  # exchange_step: seen unstable from 0.35 to 3 on, by beads and interpolation (docs/results/feedback.md)


def cell_size(scene) -> float | None:
    """Cube root of the volume of a cell; None where the mesh is not known."""
    if scene.box is None or scene.cells is None:
        return None
    return (math.prod(scene.box) / math.prod(scene.cells)) ** (1 / 3)


def own_ratio(radius: float, cell: float) -> float:
    """a/(√π Δx): what a bead finds of its own slip in the flow, spread over about a cell."""
    return radius / (math.sqrt(math.pi) * cell)


def removes_own(scene, family) -> bool:
    """Whether the own disturbance of a family's beads is taken out of what they sample."""
    if not scene.coupling.feedback:
        return False
    choice, cell = scene.coupling.own_disturbance, cell_size(scene)
    if choice == "kept" or cell is None:
        return False
    return choice == "removed" or own_ratio(family.radius, cell) > NEGLIGIBLE


def exchange_step(scene) -> float:
    """6πνa n Δt of all beads, n of them in a volume: what the flow loses in a step to beads that do not follow it."""
    if scene.box is None:
        return 0.0
    sizes = sum(f.total * f.beads * f.radius for f in scene.families)
    return 6 * math.pi * scene.kinematic_viscosity * scene.time_step * sizes / math.prod(scene.box)


def reaction(f, scene) -> dict[str, float | str]:
    """What fibers that act on the flow are to it; of a scene whose box is known."""
    density = f.total / math.prod(scene.box or ())
    result: dict[str, float | str] = {
        "volume_fraction": density * f.beads * 4 / 3 * math.pi * f.radius**3,
        "number_density_times_length_cubed": density * f.length**3,
        # of stiff rods much shorter than the scales of the flow, at random orientations
        "added_viscosity_ratio": 2 * math.pi / 15 * density * f.radius**3 * f.beads * (f.beads**2 - 1),
    }
    if (cell := cell_size(scene)) is not None:
        result["own_disturbance"] = own_ratio(f.radius, cell)
        result["own_disturbance_is"] = "removed" if removes_own(scene, f) else "kept"
    return result


def check_feedback(scene) -> None:
    """CaseError for beads too large for their cells, and for more of them than an explicit exchange bears."""
    if not scene.coupling.feedback:
        return
    where, cell = f"{scene.case}/constant/fiberProperties", cell_size(scene)
    for family in scene.families:
        if cell is not None and (ratio := own_ratio(family.radius, cell)) > TOO_LARGE:
            raise CaseError(
                f"{where}: with feedback the beads of family {family.name} are too large for the cells: radius "
                f"{family.radius:g} over sqrt(pi) times {cell:g} is {ratio:.2g}, at most {TOO_LARGE:g} is allowed. A "
                "bead would sample mostly what it did itself, and no quasi-steady correction holds"
            )
    if (loading := exchange_step(scene)) > STABLE:
        raise CaseError(
            f"{where}: with feedback there are too many beads for deltaT {scene.time_step:g}: 6 pi nu a n deltaT is "
            f"{loading:.2g}, and the explicit exchange is stable up to {STABLE:.2g}; take a shorter deltaT, or fewer "
            "beads"
        )
