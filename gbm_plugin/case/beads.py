"""How many beads a fiber of a given length needs: the rule of `beads auto;`."""

from __future__ import annotations

import math
from dataclasses import dataclass

from ..fiber.model import Model
from .dictionary import Dictionary

RIGID, BENT = 1.0, 0.3  # of the rule, which bounds what `gbm study accuracy --only beads` finds
LEAST, MOST = 6, 500
DEFAULT_ERROR = 1e-2


@dataclass(frozen=True)
class Fluid:
    """What the fibers are in: density [kg/m3], μ [Pa s], and ε [m2/s3] where the forcing fixes it."""

    density: float
    viscosity: float
    dissipation: float | None

    def persistence_length(self, bending_stiffness: float) -> float:
        """K^(1/4)/(μρε)^(1/8) [m], eq. (15)."""
        assert self.dissipation
        return bending_stiffness**0.25 / (self.viscosity * self.density * self.dissipation) ** 0.125


def bead_error(beads: int, length_over_persistence: float) -> float:
    """Error of the ends of a chain in free drain, over its length, after two Kolmogorov times: (1 + 0.3 L/l_p)/N²
    bounds what was measured of l_p/L from 0.15 to 3 (docs/accuracy.md)."""
    return (RIGID + BENT * length_over_persistence) / beads**2


def enough_beads(error: float, length_over_persistence: float) -> int:
    """The least N, of at least 6, of a `bead_error` of so much."""
    return max(LEAST, math.ceil(math.sqrt((RIGID + BENT * length_over_persistence) / error)))


def read_beads(d: Dictionary, model: Model, fluid: Fluid) -> int:
    """The entry `beads` of a family: a number, or `auto` for as many as `beadError` asks for.

    CaseError where the rule does not hold or lacks a number: with rpy, whose bead is as wide as the fiber; without
    length and bendingStiffness; where the forcing does not fix the dissipation.
    """
    if "beads" not in d or d.word("beads") != "auto":
        return d.integer("beads", least=2)
    error = d.number("beadError", DEFAULT_ERROR, above=0)
    if model.mobility != "freeDrain":
        wrong = f"with mobility {model.mobility} beads are as wide as the fiber, and N is its aspect ratio: give it"
        raise d.fail("beads", f"is auto: {wrong}")
    for needed in ("length", "bendingStiffness"):
        if needed not in d:
            raise d.fail(
                "beads", f"is auto, which follows from length and bendingStiffness: '{needed}' is missing"
            )
    if not fluid.dissipation:
        wrong = "which only linearForcing of constantPower fixes: give a number"
        raise d.fail("beads", f"is auto: it needs the dissipation rate, {wrong}")
    length = d.number("length", above=0)
    persistence = fluid.persistence_length(d.number("bendingStiffness", above=0))
    beads = enough_beads(error, length / persistence)
    if beads > MOST:
        raise d.fail(
            "beadError", f"is {error:g}, which would take {beads} beads: at most {MOST} are chosen so"
        )
    return beads
