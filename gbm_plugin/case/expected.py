"""The flow that a scene will have, estimated before it runs."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..errors import CaseError
from ..scales import kolmogorov_length, kolmogorov_time
from .dictionary import Dictionary
from .initial import read_initial_field
from .scene import Scene

LARGEST = 0.19  # u'^3/(epsilon box), of turbulence forced at the scale of its box
BETA = 0.8  # of Eswaran & Pope (1988): how much the flow's own time shortens the force's
EXTREME = (
    7.0  # largest sum of |u_x|, |u_y|, |u_z| in a field, over u': Gaussian components on 1e5 to 1e7 cells
)
LATTICE = 32  # cells in a direction on which the fastest place of the initial field is looked for


@dataclass(frozen=True)
class Expected:
    """u' [m/s], rms of one component; dissipation [m2/s3], its source in words; speed [m/s], the largest |u_x| + |u_y|
    + |u_z|; None where the case does not tell."""

    viscosity: float
    velocity: float | None = None
    dissipation: float | None = None
    speed: float | None = None
    source: str = ""

    @property
    def kolmogorov_length(self) -> float | None:
        return kolmogorov_length(self.viscosity, self.dissipation) if self.dissipation else None

    @property
    def kolmogorov_time(self) -> float | None:
        return kolmogorov_time(self.viscosity, self.dissipation) if self.dissipation else None


def expected(scene: Scene) -> Expected:
    """By the forcing: its power where that is given, else by u'^3/epsilon = 0.19 of the box; without one by the initial
    field, whose large eddies pass their energy on at that rate."""
    nu = scene.kinematic_viscosity
    start, fastest, own = _initial(scene)
    width = min(scene.box) if scene.box else None
    forced, source = _forced(scene, width)
    velocity = (LARGEST * width * forced) ** (1 / 3) if forced and width else None
    speeds = [EXTREME * velocity] if velocity else []
    speeds += [fastest or EXTREME * start] if start else []
    if not forced:
        velocity = start
        forced = max(own or 0.0, start**3 / (LARGEST * width) if start and width else 0.0) or None
        source = "of the initial field" if forced else ""
    return Expected(nu, velocity, forced, max(speeds, default=None), source)


def _forced(scene: Scene, width: float | None) -> tuple[float | None, str]:
    """Dissipation of the stationary state, and what says so."""
    if scene.forcing is None:
        return None, ""
    v = scene.forcing.values
    if scene.forcing.type == "eswaranPope":
        if width is None:
            return None, ""
        reach = np.arange(-int(v["cutoff"]), int(v["cutoff"]) + 1) ** 2
        squares = reach[:, None, None] + reach[:, None] + reach
        modes = int((squares <= v["cutoff"] ** 2 * (1 + 1e-12)).sum()) - 1
        free = 4 * v["variance"] * v["timeScale"] * modes
        own_time = v["timeScale"] * free ** (1 / 3) * (2 * np.pi / width) ** (2 / 3)
        return free / (1 + own_time / BETA), "about, by Eswaran & Pope"
    if v["mode"] == "constantPower":
        return v["power"] or None, "the power"
    if width is None or not v["A"]:
        return None, ""
    return 27 * LARGEST**2 * v["A"] ** 3 * width**2, "about, by A and the box"


def _initial(scene: Scene) -> tuple[float | None, float | None, float | None]:
    """u' of the initial field, its largest |u_x| + |u_y| + |u_z|, and its dissipation."""
    try:
        kind = Dictionary.read(scene.case, "system/initialFieldDict").word("field")
        if kind == "run" or scene.box is None:  # another run's state is large, and about as this one will be
            return None, None, None
        modes = read_initial_field(scene.case).modes
    except CaseError:
        return None, None, None
    square = (np.abs(modes.amplitudes) ** 2).sum(axis=1)
    k2 = ((2 * np.pi * modes.wavevectors / np.array(scene.box)) ** 2).sum(axis=1)
    highest = int(np.abs(modes.wavevectors).max(initial=0))
    fastest = None
    if 0 < highest < LATTICE // 2:
        fastest = float(np.abs(modes.on_lattice((LATTICE,) * 3)).sum(axis=0).max())
    return (
        float(np.sqrt(square.sum() / 6)),
        fastest,
        float(scene.kinematic_viscosity * (k2 * square).sum() / 2),
    )
