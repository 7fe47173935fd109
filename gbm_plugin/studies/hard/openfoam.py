"""Hard cases of OpenFOAM's flows with fibers: steps that are too long, eddies not resolved, nothing to force."""

from __future__ import annotations

import tempfile
from pathlib import Path

import numpy as np

from ...case.layout import results
from ...case.new import SHIPPED
from ...output.recording import open_recording
from ...output.tables import read_dat
from ...run.openfoam import run
from ..scenes import scene_copy, three_families
from ..study import quiet
from .case import Case, Found

CELLS = 16
SPEED = 2.9  # largest |u_x| + |u_y| + |u_z| of these fields [m/s]
RANDOM = "field random; kineticEnergy 0.5; peakWavenumber 2; maxWavenumber 5; seed 1;\n"
NOTHING = "field modes; modes (((0 0 0) ({0} {0} {0}) (0 0 0)));\n"
INPUT = 0.1  # [m2/s3]
POWER = f"linearForcing {{ type linearForcing; mode constantPower; power {INPUT}; }}\n"
COEFFICIENT = "linearForcing { type linearForcing; mode constantCoefficient; A 0.1; }\n"
STIRRED = "eswaranPope { type eswaranPope; variance 0.02; timeScale 1; cutoff 2; seed 1; }\n"
TOO_LONG = "predicted with an error|blown up|not finite|[Ff]loating point|SIGFPE"


def unresolving(product: float) -> float:
    """Viscosity at which the largest wavenumber of the cells, π/Δx, times η is so much."""
    return float(((product * 2 / CELLS) ** 4 * INPUT) ** (1 / 3))


def ran(
    application: str,
    courant: float,
    steps: int = 20,
    viscosity: float = 0.01,
    force: str = POWER,
    initial: str = RANDOM,
    fibers: int = 5,
) -> Found:
    """A run of gbm: k at its end over that at its start, and the fibers' length."""
    step = courant * 2 * np.pi / CELLS / SPEED
    texts = {
        "constant/fvOptions": force,
        "system/initialFieldDict": initial,
        "constant/fiberProperties": three_families(fibers, 10, 1e-3, "trilinear"),
    }
    with tempfile.TemporaryDirectory(prefix="gbm-stability-") as folder:
        case = scene_copy(
            SHIPPED, Path(folder) / "case", cells=CELLS, steps=steps, end_time=steps * step, viscosity=viscosity,
            write_every=steps, texts=texts, entries={"system/controlDict": {"application": application}},
        )  # fmt: skip
        with quiet():
            run(case)
        return _found(case, force.split()[0])


def _found(case: Path, force: str) -> Found:
    energy = read_dat(case / "postProcessing" / force, f"{force}.dat")["k"]
    found: Found = {
        "finite": bool(np.isfinite(energy).all()),
        "energy": float(energy[-1] / (energy[0] or 1.0)),
    }
    with open_recording(results(case)) as recording:
        worst = 0.0
        for family in recording.families.values():
            spacing = np.linalg.norm(np.diff(family.positions[-1], axis=1), axis=2)
            worst = max(worst, float(np.abs(spacing / (2 * family.radius) - 1).max()))
    return found | {"length_error": worst, "beads": 20}


def _cases() -> list[Case]:
    cases = []
    for application, limits in {"boxFoam": (0.3, 1.0, 5.0), "pimpleFoam": (0.3, 1.0, 5.0)}.items():
        for courant in limits:
            stable = (
                0.46 if application == "boxFoam" else 1.0
            )  # pimpleFoam's implicit steps are, at less accuracy
            refused = TOO_LONG if courant > stable else None
            cases.append(Case(
                "OpenFOAM's flow", f"Courant number {courant:g}, {application}",
                lambda a=application, c=courant: ran(a, c), refused, openfoam=True,
            ))  # fmt: skip
        cases += [
            *(
                Case("OpenFOAM's flow", f"k_max η = {product:g}, {application}",
                     lambda a=application, p=product: ran(a, 0.2, 40, viscosity=unresolving(p)), openfoam=True)
                for product in (0.5, 0.1)
            ),
            Case("forcing", f"constant power, fluid in uniform motion, {application}",
                 lambda a=application: ran(a, 0.2, 5, initial=NOTHING.format(0.5)), "nothing to force", openfoam=True),
            Case("forcing", f"eswaranPope, fluid at rest, {application}",
                 lambda a=application: ran(a, 0.2, 20, force=STIRRED, initial=NOTHING.format(0)), openfoam=True),
        ]  # fmt: skip
    return cases


CASES = _cases()
