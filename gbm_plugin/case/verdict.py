"""Whether a scene's numbers suffice and the bead model holds: good, doubtful or wrong, with the line to change."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

from ..scales import coupling_error, coupling_step
from .beads import bead_error, enough_beads
from .expected import Expected
from .feedback import NEGLIGIBLE, STABLE, TOO_LARGE, cell_size, exchange_step, own_ratio, removes_own
from .layout import SPECTRAL
from .scene import Family, Scene
from .solver import TRUNCATED, stable_courant

GOOD, DOUBTFUL, WRONG = "good", "doubtful", "wrong"

# up to which a value is good, and up to which it is doubtful
CELLS = (2.1, 3.2)  # dx/eta: k_max eta = 1.5 and 1 (Pope, Turbulent Flows, 2000, section 9.1)
# of an explicit solver, over the limit at which every wave is stable everywhere: turbulence blew up at 1.5, not at 1.3
COURANT = (1.0, 1.3)
IMPLICIT_COURANT = (1.0, 5.0)  # of the others
FORECAST = (
    1e-3,
    1e-2,
)  # error of L in tau_eta of beads that go on from one sample a step, extrapolated along their paths
SUB_STEPS = (1000, 1_000_000)  # of ab3: dear, and refused
ENDS = (1e-2, 5e-2)  # error of the ends of a fiber by its number of beads
BEADS = (
    0.775,
    1.55,
)  # 2a/l_p: on a curve of radius l_p differences between beads err by (2a/l_p)^2/12, 5 and 20 %
# d/eta: up to a shear Reynolds number (d/2)^2/(nu tau_eta) of 1, and a Stokes number d^2/(18 eta^2) of about 1
BEAD = (2.0, 5.0)
EXCHANGE = (0.3, STABLE)  # with feedback, of the mean over the box: somewhere there are more beads
DENSE = (3.0, 10.0)  # n L^3: fibers in the cube of their length; beyond some they meet
LENGTH = (0.5, 1.0)  # L over the box: a longer fiber meets the flow of its own other end


@dataclass(frozen=True)
class Verdict:
    """One number judged: its name, value, grade, what was asked of it, and what to change where it is not good."""

    name: str
    value: float
    grade: str
    asked: str
    change: str = ""


def graded(name: str, value: float, limits: tuple[float, float], asked: str, change: str) -> Verdict:
    """Good up to the first of the limits, doubtful up to the second; `change` where it is not good."""
    grade = GOOD if value <= limits[0] else DOUBTFUL if value <= limits[1] else WRONG
    return Verdict(name, value, grade, asked, "" if grade == GOOD else change)


def verdicts(scene: Scene, flow: Expected) -> list[Verdict]:
    """Resolution first, then the model; of all families the worst. What needs a flow that the case does not tell is
    left out."""
    found = [*_of_the_flow(scene, flow), _sub_steps(scene)]
    eta = flow.kolmogorov_length
    if flow.dissipation:
        bends = [f for f in scene.families if f.bending_stiffness > 0]
        if bends:
            worst, ratio = _worst(
                bends, lambda f: 2 * f.radius / persistence_length(f, scene, flow.dissipation)
            )
            beads = math.ceil(worst.beads * ratio / BEADS[0])
            asked = f"{worst.name}: beads show its bends to {100 * ratio**2 / 12:.2g} %"
            found.append(_inverse("l_p/2a", ratio, BEADS, asked, f"beads {beads} (fiberProperties)"))
        found += _bead_error(scene, flow.dissipation)
        worst, size = _worst(scene.families, lambda f: 2 * f.radius / eta)
        numbers = f"{worst.name}: bead Re {size**2:.2g}, Stokes {size**2 / 18:.2g}"
        thinner = math.ceil(worst.beads * size / BEAD[0])
        found.append(graded("d/eta", size, BEAD, numbers, f"beads {thinner}, or thinner fibers"))
    if scene.coupling.feedback:
        found += _of_feedback(scene)
    if scene.box:
        worst, part = _worst(scene.families, lambda f: f.length / min(scene.box))
        found.append(
            graded("L/box", part, LENGTH, f"{worst.name}: up to half", f"length {min(scene.box) / 2:.3g}")
        )
    return found


def persistence_length(f: Family, scene: Scene, dissipation: float) -> float:
    """Eq. (15) of the paper [m]."""
    return f.bending_stiffness**0.25 / (scene.dynamic_viscosity * scene.density * dissipation) ** 0.125


def step_limit(f: Family, scene: Scene) -> float | None:
    """Eq. (10) [s]: mu d^4/K; None without stiffness."""
    mu, diameter = scene.dynamic_viscosity, 2 * f.radius
    return mu * diameter**4 / f.bending_stiffness if f.bending_stiffness > 0 else None


def sub_steps(f: Family, scene: Scene) -> int:
    """How many of ab3's steps eq. (10) asks for in a step of the flow."""
    limit = step_limit(f, scene)
    return max(1, math.ceil(scene.time_step / limit * (1 - 1e-12))) if limit else 1


def _of_the_flow(scene: Scene, flow: Expected) -> list[Verdict]:
    found, step, eta = [], scene.time_step, flow.kolmogorov_length
    if scene.box and scene.cells:
        width, length, number = max((b / n, b, n) for b, n in zip(scene.box, scene.cells, strict=True))
        if eta:
            resolved = TRUNCATED if scene.application == SPECTRAL else 1.0
            cells = tuple(c * resolved for c in CELLS)
            enough = math.ceil(length / (cells[0] * eta))
            change = f"n {enough + enough % 2} (blockMeshDict; now {number})"
            found.append(graded("dx/eta", width / eta, cells, f"up to {cells[0]:g} (k_max eta 1.5)", change))
        if flow.speed:
            limit = stable_courant(scene)
            narrow = min(b / n for b, n in zip(scene.box, scene.cells, strict=True))
            courant = flow.speed * step / narrow
            limits = tuple(c * limit for c in COURANT) if limit else IMPLICIT_COURANT
            asked = f"{scene.application} is stable to {limit:g}" if limit else f"up to {limits[0]:g}"
            change = f"deltaT {_below(limits[0] * narrow / flow.speed)} (controlDict)"
            found.append(graded("Courant", courant, limits, asked, change))
    if flow.kolmogorov_time:
        tau = flow.kolmogorov_time
        limits = (coupling_step(FORECAST[0], 1.0), coupling_step(FORECAST[1], 1.0))
        asked = f"one sample a step: {coupling_error(step, tau):.1g} L in tau_eta"
        change = f"deltaT {_below(limits[0] * tau)} (controlDict)"
        found.append(graded("dt/tau_eta", step / tau, limits, asked, change))
    return found


def _of_feedback(scene: Scene) -> list[Verdict]:
    """Whether beads are points to the flow, few enough for an explicit exchange, and fibers that do not touch."""
    loading = exchange_step(scene)
    found = [
        graded("exchange", loading, EXCHANGE, f"6 pi nu a n dt: stable to {STABLE:.2g}", "a shorter deltaT")
    ]
    if (cell := cell_size(scene)) is not None:
        worst, ratio = _worst(scene.families, lambda f: own_ratio(f.radius, cell))
        limits = (TOO_LARGE if removes_own(scene, worst) else NEGLIGIBLE, TOO_LARGE)
        asked = (
            f"{worst.name}: own disturbance of its slip, {'removed' if limits[0] > NEGLIGIBLE else 'kept'}"
        )
        found.append(graded("a/dx/1.77", ratio, limits, asked, "ownDisturbance auto (fiberProperties)"))
    if scene.box:
        worst, dense = _worst(scene.families, lambda f: f.total / math.prod(scene.box) * f.length**3)
        found.append(
            graded("n L^3", dense, DENSE, f"{worst.name}: no contact between fibers", "fewer fibers")
        )
    return found


def _bead_error(scene: Scene, dissipation: float) -> list[Verdict]:
    """What the number of beads costs, where it was measured: in free drain."""
    known = [f for f in scene.families if f.model.mobility == "freeDrain" and f.bending_stiffness > 0]
    if not known:
        return []
    worst, error = _worst(
        known, lambda f: bead_error(f.beads, f.length / persistence_length(f, scene, dissipation))
    )
    enough = enough_beads(ENDS[0], worst.length / persistence_length(worst, scene, dissipation))
    asked = f"{worst.name}: error of the ends of {worst.beads}, over L"
    return [graded("beads", error, ENDS, asked, f"beads {enough}, or auto (fiberProperties)")]


def _sub_steps(scene: Scene) -> Verdict:
    explicit = [f for f in scene.families if f.model.integrator == "ab3"]
    if not explicit:
        return Verdict("sub-steps", 1, GOOD, "implicit or auto: by their own error estimate")
    worst, count = _worst(explicit, lambda f: float(sub_steps(f, scene)))
    change = "integrator auto (fiberProperties)"
    return graded("sub-steps", count, SUB_STEPS, f"{worst.name}: ab3 within eq. (10)", change)


def _inverse(name: str, value: float, limits: tuple[float, float], asked: str, change: str) -> Verdict:
    """Judged by its inverse."""
    found = graded(name, value, limits, asked, change)
    return Verdict(name, 1 / value, found.grade, asked, found.change)


def _worst(families, value: Callable[[Family], float]) -> tuple[Family, float]:
    worst = max(families, key=value)
    return worst, value(worst)


def _below(value: float) -> str:
    """The next smaller number of two digits."""
    digits = 10 ** (math.floor(math.log10(value)) - 1)
    return f"{math.floor(value / digits * (1 + 1e-9)) * digits:.2g}"
