"""What a case contains, and the numbers that tell whether the bead model holds in it (`gbm info`)."""

from __future__ import annotations

import math
import shutil
from dataclasses import asdict

from ..scales import kolmogorov_length
from . import solver
from .disk import needed, readable
from .scene import Family, Scene

# beyond these a bead is no longer a passive point of the flow around it
BEAD_SIZE_LIMIT, STOKES_LIMIT, PERSISTENCE_LIMIT = 5.0, 1.0, 1.0


def figures(scene: Scene) -> dict:
    """Key figures of a scene, SI units. Those that need the dissipation rate are None where the forcing
    does not fix it (it is the input power of constantPower)."""
    dissipation = scene.forcing.values.get("power") if scene.forcing else None
    flow = {
        "solver": solver.meaning(scene),
        "viscosity": scene.kinematic_viscosity,
        "density": scene.density,
        "box": scene.box,
        "cells": scene.cells,
        "time_step": scene.time_step,
        "end_time": scene.end_time,
        "forcing": asdict(scene.forcing) if scene.forcing else None,
        "dissipation": dissipation,
        "kolmogorov_length": _kolmogorov(scene, dissipation),
    }
    if scene.box and scene.cells:
        flow["cell_size"] = max(b / n for b, n in zip(scene.box, scene.cells, strict=True))
        if dissipation:
            flow["cell_over_eta"] = flow["cell_size"] / flow["kolmogorov_length"]
    families = {f.name: _family(f, scene, dissipation) for f in scene.families}
    return {"flow": flow, "families": families, "disk": _disk(scene)}


def _disk(scene: Scene) -> dict:
    """What a run from startTime writes, and what is free [bytes]."""
    disk = needed(scene) | {"free": shutil.disk_usage(scene.case).free}
    short = disk["total"] > disk["free"]
    return disk | {"remarks": ["the disk has not the room for all that this run writes"] if short else []}


def _kolmogorov(scene: Scene, dissipation: float | None) -> float | None:
    return kolmogorov_length(scene.kinematic_viscosity, dissipation) if dissipation else None


def _family(f: Family, scene: Scene, dissipation: float | None) -> dict:
    mu = scene.dynamic_viscosity
    diameter = 2 * f.radius
    stiff = f.bending_stiffness > 0
    limit = mu * diameter**4 / f.bending_stiffness if stiff else None  # eq. (10)
    result = {
        "count": f.count,
        "beads": f.beads,
        "length": f.length,
        "diameter": diameter,
        "bending_stiffness": f.bending_stiffness,
        "time_step_limit": limit,
        "sub_steps": max(1, math.ceil(scene.time_step / limit)) if stiff else 1,
    }
    if dissipation:
        eta = _kolmogorov(scene, dissipation)
        persistence = f.bending_stiffness**0.25 / (mu * scene.density * dissipation) ** 0.125  # eq. (15)
        result |= {
            "persistence_length": persistence,
            "length_over_persistence": f.length / persistence if stiff else None,
            "persistence_over_diameter": persistence / diameter,
            "diameter_over_eta": diameter / eta,
            "bead_reynolds": (diameter / eta) ** 2,  # shear rate sqrt(eps/nu) times d^2/nu
            "bead_stokes": (diameter / eta) ** 2 / 18,  # neutrally buoyant, against the Kolmogorov time
            "remarks": _remarks(diameter / eta, persistence / diameter if stiff else None),
        }
    return result


def _remarks(size: float, persistence: float | None) -> list[str]:
    remarks = []
    if size > BEAD_SIZE_LIMIT:
        remarks.append(f"beads are {size:.1f} Kolmogorov lengths wide: the flow varies across a bead")
    if size**2 / 18 > STOKES_LIMIT:
        remarks.append(f"the bead Stokes number is {size**2 / 18:.1f}: beads do not follow the flow at once")
    if persistence is not None and persistence < PERSISTENCE_LIMIT:
        remarks.append(f"the persistence length is {persistence:.2f} beads: more beads would bend further")
    return remarks


def describe(result: dict) -> str:
    """The figures as text."""
    lines = []

    def table(title: str, values: dict) -> None:
        lines.append(title)
        for name, value in values.items():
            if value is None or name in ("remarks", "forcing"):
                continue
            text = f"{value:.6g}" if isinstance(value, float) else " ".join(map(_short, _listed(value)))
            lines.append(f"    {name.replace('_', ' '):<28}{text}")
        lines.extend(f"    note: {remark}" for remark in values.get("remarks", []))

    flow = result["flow"]
    table("flow (SI units)", flow)
    if flow["forcing"]:
        words = " ".join(f"{k} {v}" for k, v in flow["forcing"]["values"].items())
        lines.append(f"    {'forcing':<28}{flow['forcing']['type']}: {words}")
    for name, values in result["families"].items():
        table(f"family {name}", values)
    disk = result["disk"]
    sizes = {name: readable(size) for name, size in disk.items() if name != "remarks"}
    table("disk, about", sizes | {"remarks": disk["remarks"]})
    return "\n".join(lines)


def _listed(value) -> tuple:
    return tuple(value) if isinstance(value, tuple | list) else (value,)


def _short(value) -> str:
    return f"{value:.6g}" if isinstance(value, float) else str(value)
