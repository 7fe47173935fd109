"""What a scene will do, what it takes, and whether its numbers suffice (`gbm info`), on one screen."""

from __future__ import annotations

import shutil
import textwrap
from dataclasses import asdict

from . import plan
from .cost import cost, patience
from .disk import needed, readable
from .expected import Expected, expected
from .feedback import reaction
from .scene import Family, Scene
from .verdict import GOOD, Verdict, persistence_length, step_limit, sub_steps, verdicts

WIDTH = 80  # columns of a screen
NAMES, WHY = 11, 24  # of them for what a line is about, and for why
FAMILIES = 4  # so many have a line
PARTS = ("start", "flow", "fibers", "coupling", "writing")  # of the time
HIDDEN = {"fibers": "the fibers", "coupling": "the coupling"}


def figures(scene: Scene) -> dict:
    """Key figures of a scene, SI units, as numbers and lists of them. What needs the flow's dissipation rate is None
    where the case does not tell it."""
    flow = expected(scene)
    families = {f.name: _family(f, scene, flow) for f in scene.families}
    disk = needed(scene) | {"free": shutil.disk_usage(scene.case).free}
    takes = cost(scene)
    return {
        "case": scene.case.resolve().name,
        "flow": _flow(scene, flow),
        "families": families,
        "computes": [asdict(item) for item in plan.computed(scene)],
        "left_out": plan.left_out(scene),
        "exchanges": asdict(plan.exchanged(scene)),
        "stores": [asdict(item) for item in plan.stored(scene)],
        "cost": asdict(takes),
        "disk": disk,
        "verdicts": [asdict(v) for v in (*verdicts(scene, flow), *patience(scene, takes))],
    }


def _flow(scene: Scene, flow: Expected) -> dict:
    result = {
        "solver": scene.application,
        "viscosity": scene.kinematic_viscosity,
        "density": scene.density,
        "box": scene.box,
        "cells": scene.cells,
        "time_step": scene.time_step,
        "start_time": scene.start_time,
        "end_time": scene.end_time,
        "forcing": asdict(scene.forcing) if scene.forcing else None,
        "velocity_rms": flow.velocity,
        "largest_speed": flow.speed,
        "dissipation": flow.dissipation,
        "dissipation_from": flow.source,
        "kolmogorov_length": flow.kolmogorov_length,
        "kolmogorov_time": flow.kolmogorov_time,
    }
    if scene.box and scene.cells:
        result["cell_size"] = max(b / n for b, n in zip(scene.box, scene.cells, strict=True))
        if flow.kolmogorov_length:
            result["cell_over_eta"] = result["cell_size"] / flow.kolmogorov_length
    return result


def _family(f: Family, scene: Scene, flow: Expected) -> dict:
    diameter = 2 * f.radius
    result = {
        "count": f.count,
        "beads": f.beads,
        "length": f.length,
        "diameter": diameter,
        "bending_stiffness": f.bending_stiffness,
        "time_step_limit": step_limit(f, scene),
        "sub_steps": sub_steps(f, scene),
    }
    if scene.coupling.feedback and scene.box is not None:
        result |= reaction(f, scene)
    if flow.dissipation:
        size = diameter / flow.kolmogorov_length
        persistence = persistence_length(f, scene, flow.dissipation)
        result |= {
            "persistence_length": persistence,
            "length_over_persistence": f.length / persistence if persistence else None,
            "persistence_over_diameter": persistence / diameter,
            "diameter_over_eta": size,
            "bead_reynolds": size**2,  # shear rate sqrt(eps/nu) times d^2/nu
            "bead_stokes": size**2 / 18,  # neutrally buoyant, against the Kolmogorov time
        }
    return result


def describe(result: dict) -> str:
    """The figures as one screen of text."""
    flow, disk, cost = result["flow"], result["disk"], result["cost"]
    cells = " x ".join(map(str, flow["cells"] or ())) or "its own mesh of"
    fibers = sum(f["count"] for f in result["families"].values())
    steps = round((flow["end_time"] - flow["start_time"]) / flow["time_step"])
    lines = [
        f"{result['case']}: {cells} cells, {fibers} fibers, "
        f"t = {flow['start_time']:g} to {flow['end_time']:g} s in {steps} steps",
        "",
        f"{'computes':<{WIDTH - WHY + 1}}asked for by",
    ]
    families = len(result["families"])
    *before, sampling = result[
        "computes"
    ]  # the flow and its forcing, the families, and what is sampled for them
    for item in before[: len(before) - max(0, families - FAMILIES)]:
        lines += _row(**item)
    if families > FAMILIES:
        lines += _row("", f"and {families - FAMILIES} more families", "")
    lines += _row(**sampling)
    if result["left_out"]:
        lines += textwrap.wrap(f"not, as nothing asks: {', '.join(result['left_out'])}", WIDTH - 2,
                               initial_indent="  ", subsequent_indent="    ")  # fmt: skip
    lines += ["", *_row(**result["exchanges"], indent="")]
    for item in result["stores"]:
        lines += _row(**item, indent="" if item["what"] else "  ")
    lines += _takes(cost, disk)
    lines += ["", *_about(flow)]
    for v in result["verdicts"]:
        lines += _verdict(Verdict(**v))
    return "\n".join(lines)


def _row(what: str, how: str, why: str, indent: str = "  ") -> list[str]:
    """A thing, in words that may take several lines, and why."""
    head = max(NAMES + 1, len(indent + what))  # a long name takes from the words
    room = WIDTH - 1 - head - WHY
    parts, reasons = _wrapped(how, room) or [""], _wrapped(why, WHY - 1) or [""]
    rows = max(len(parts), len(reasons))
    parts, reasons = (column + [""] * (rows - len(column)) for column in (parts, reasons))
    names = [f"{indent}{what}", *[""] * (rows - 1)]
    pairs = zip(names, parts, reasons, strict=True)
    return [f"{name:<{head}} {part:<{room}} {reason}".rstrip() for name, part, reason in pairs]


def _takes(cost: dict, disk: dict) -> list[str]:
    time = "a time that no measurement tells"
    if cost["total"] is not None:
        parts = ", ".join(f"{name} {_seconds(cost[name])}" for name in PARTS if cost[name])
        names = [what for name, what in HIDDEN.items() if not cost[name]]
        hidden = f"; the flow hides {' and '.join(names)}" if names else ""
        time = f"about {_seconds(cost['total'])} on this machine, idle: {parts}{hidden}"
    room = f"disk {readable(disk['total'])}, {readable(disk['free'])} are free"
    text = f"{time}; memory {readable(cost['memory'])}; {room}"
    if disk["total"] > disk["free"]:
        text += ": wrong, it has not the room; → a larger writeInterval (controlDict)"
    rows = _wrapped(text, WIDTH - NAMES - 2)
    return [f"{'takes' if n == 0 else '':<{NAMES + 1}} {row}" for n, row in enumerate(rows)]


def _about(flow: dict) -> list[str]:
    if not flow["dissipation"]:
        return ["the case does not tell how fast its flow dissipates: its scales are not judged"]
    numbers = f"eps {flow['dissipation']:.2g} m2/s3 ({flow['dissipation_from']})"
    numbers += f", eta {flow['kolmogorov_length']:.2g} m, tau_eta {flow['kolmogorov_time']:.2g} s"
    if flow["velocity_rms"]:
        numbers += f", u' {flow['velocity_rms']:.2g} m/s"
    return textwrap.wrap(f"expects {numbers}", WIDTH, subsequent_indent="  ")


def _verdict(v: Verdict) -> list[str]:
    text = v.asked if v.grade == GOOD else f"{v.asked}; → {v.change}"
    head = f"  {v.name:<{NAMES}}{v.value:<9.3g}{v.grade:<10}"
    rows = _wrapped(text, WIDTH - len(head))
    return [f"{head if n == 0 else ' ' * len(head)}{row}" for n, row in enumerate(rows)]


def _wrapped(text: str, width: int) -> list[str]:
    return textwrap.wrap(text, width, break_on_hyphens=False)


def _seconds(time: float) -> str:
    if time < 60:
        return f"{time:.2g} s"
    return f"{time / 60:.2g} min" if time < 3600 else f"{time / 3600:.2g} h"
