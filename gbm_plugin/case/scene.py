"""An OpenFOAM case read into one typed description of the scene: flow, forcing, families of fibers."""

from __future__ import annotations

import math
import os
import re
from dataclasses import dataclass, field, fields, replace
from pathlib import Path

import numpy as np

from ..errors import CaseError
from ..fiber.model import Model, ModelError, entry_name
from .beads import Fluid, read_beads
from .dictionary import Dictionary
from .feedback import check_feedback
from .mesh import Box, read_box
from .positions import read_positions
from .share import Share
from .trust import is_inside

TRANSPORTS = ("socket", "tcp", "file")
START_FROM = ("latestTime", "startTime", "firstTime")
SHAPES = ("straight", "file")
RECORD = ("tension",)  # what a recording may have beside the positions
OWN_DISTURBANCE = ("auto", "kept", "removed")

LABEL_MAX = 2**31 - 1  # of the 32 bits that OpenFOAM's labels have at least


@dataclass(frozen=True)
class Family:
    """Fibers that are alike but for their place: `count` fibers of `beads` beads, length 2 a N [m],
    bending stiffness K^b [N m2]. positions (count, beads, 3) [m] of the whole family where the case gives them,
    else None: straight fibers at random."""

    name: str
    count: int
    beads: int
    length: float
    bending_stiffness: float
    seed: int
    shape: str
    model: Model
    positions: np.ndarray | None = field(default=None, repr=False, compare=False)
    first: int = 0  # number of the first of these fibers in the whole family
    whole: int = 0  # fibers of the whole family, where these are a part of it

    @property
    def total(self) -> int:
        """Fibers of the whole family."""
        return self.whole or self.count

    def part(self, share: Share) -> Family:
        """The fibers of one daemon."""
        own = share.part(self.count)
        return replace(self, count=own.stop - own.start, first=own.start, whole=self.count)

    @property
    def radius(self) -> float:
        """Bead radius a [m]."""
        return self.length / (2 * self.beads)


@dataclass(frozen=True)
class Forcing:
    """An active entry of constant/fvOptions that drives turbulence: its name, its type and its numbers.

    The name is that of its table, postProcessing/<name>/<start>/<name>.dat.
    """

    name: str
    type: str
    values: dict[str, float | str]
    table: bool = True  # a row of the flow's averages in each step

    @property
    def dissipation(self) -> float | None:
        """ε of the stationary state [m2/s3], where the forcing fixes it: the power of constantPower."""
        power = self.values.get("power")
        return float(power) if power else None


@dataclass(frozen=True)
class Coupling:
    """How OpenFOAM and the daemons talk; timeout in seconds."""

    transport: str = "socket"
    timeout: float = 120.0
    host: str = "127.0.0.1"
    port: int = 0
    daemons: int = 1  # that share the fibers
    feedback: bool = False  # whether fibers act on the flow
    own_disturbance: str = "auto"  # of beads in the flow that they sample, with feedback


@dataclass(frozen=True)
class Statistics:
    """When statistics of the fibers are gathered: from a time [s] on, every `interval` steps; correlations up to so
    many samples."""

    since: float
    interval: int
    lags: int


@dataclass(frozen=True)
class Scene:
    """What both engines read of a case. SI units."""

    case: Path
    application: str
    kinematic_viscosity: float
    density: float
    time_step: float
    start_time: float
    start_from: str  # where OpenFOAM begins: latestTime, startTime, firstTime
    end_time: float
    write_interval: float
    forcing: Forcing | None
    interpolation: str
    record_interval: int
    record: tuple[str, ...]  # of RECORD: beside the positions
    coupling: Coupling
    families: tuple[Family, ...]
    statistics: Statistics | None = None
    box: tuple[float, float, float] | None = None
    origin: tuple[float, float, float] | None = None
    cells: tuple[int, int, int] | None = None
    texts: dict[str, str] = field(default_factory=dict, repr=False)

    @property
    def steps(self) -> int:
        """From startTime to endTime."""
        return round(max(0.0, self.end_time - self.start_time) / self.time_step)

    @property
    def dynamic_viscosity(self) -> float:
        """mu = rho nu [Pa s]."""
        return self.density * self.kinematic_viscosity

    def part(self, share: Share) -> Scene:
        """The scene of one daemon, with its part of every family."""
        return replace(self, families=tuple(f.part(share) for f in self.families))


def box_of(box: Box | None) -> dict[str, tuple | None]:
    """The fields of a scene that say what its box is."""
    return {
        "box": box and box.size,
        "origin": box and box.origin,
        "cells": box and box.cells,
    }


def read_scene(case: Path | str) -> Scene:
    """The scene of an OpenFOAM case. CaseError, in one line, for every mistake."""
    case = Path(case)
    if not case.is_dir():
        raise CaseError(f"there is no case folder {case}")
    if bad := re.search(r"[\s\"']", str(case.resolve())):
        raise CaseError(
            f"the path of the case, {case.resolve()}, has the character {bad[0]!r}, which OpenFOAM does not take"
        )
    control = Dictionary.read(case, "system/controlDict")
    if "adjustTimeStep" in control and control.switch("adjustTimeStep"):
        raise control.fail(
            "adjustTimeStep",
            "is yes: fibers move with a fixed time step; set it to no and deltaT to the smallest step needed",
        )
    time_step = control.number("deltaT", above=0)
    fibers = Dictionary.read(case, "constant/fiberProperties")
    density, viscosity = fibers.number("rho", 1.0, above=0), _read_viscosity(case)
    forcing = _read_forcing(case)
    fluid = Fluid(density, density * viscosity, forcing.dissipation if forcing else None)
    scene = Scene(
        case=case,
        application=_read_application(control),
        kinematic_viscosity=viscosity,
        density=density,
        time_step=time_step,
        start_time=control.number("startTime", 0.0),
        start_from=control.word("startFrom", START_FROM, "latestTime"),
        end_time=control.number("endTime"),
        write_interval=_write_interval(control, time_step),
        forcing=forcing,
        interpolation=fibers.word("interpolation", default="trilinear"),
        record_interval=fibers.integer("recordInterval", 10, least=1),
        record=fibers.words("record", RECORD),
        coupling=_read_coupling(fibers),
        families=_read_families(case, fibers, fluid),
        statistics=_read_statistics(fibers),
        **box_of(read_box(case)),
        texts=_texts(case),
    )
    fibers.done()
    _check_memory(scene)
    check_feedback(scene)
    for family in scene.families:
        if family.model.repulsion * time_step > 1:
            raise CaseError(
                f"{fibers.where}: repulsion is {family.model.repulsion:g} in family {family.name}: with deltaT "
                f"{time_step:g} at most 1/deltaT = {1 / time_step:g} is stable"
            )
        if family.count < scene.coupling.daemons:
            raise CaseError(
                f"{case}/constant/fiberProperties: {scene.coupling.daemons} daemons cannot share the {family.count} "
                f"fibers of family {family.name}: each needs at least one"
            )
    return scene


BYTES = 300  # at least, that a bead takes: states before and after a step, rates, multipliers, three samples


def _check_memory(scene: Scene) -> None:
    need = BYTES * sum(f.count * f.beads for f in scene.families) / scene.coupling.daemons
    there = os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES")
    if need > there:
        raise CaseError(
            f"{scene.case}/constant/fiberProperties: not enough memory: {_beads(scene)} beads take {need / 1e9:.0f} GB "
            f"or more in each daemon, and this machine has {there / 1e9:.0f} GB"
        )


def _beads(scene: Scene) -> str:
    return f"{sum(f.count * f.beads for f in scene.families):.3g}"


def _read_application(control: Dictionary) -> str:
    """The solver: a program of the PATH, and neither a file that the case brings nor options."""
    name = control.word("application", default="pimpleFoam")
    if not re.fullmatch(r"[A-Za-z]\w*", name, flags=re.ASCII):
        raise control.fail(
            "application", f"is '{name}': the name of a program on the PATH is needed, as pimpleFoam"
        )
    return name


def _write_interval(control: Dictionary, time_step: float) -> float:
    """Time between writes [s]; infinite where OpenFOAM decides by other clocks."""
    interval = control.number("writeInterval", math.inf)
    kind = control.word("writeControl", default="timeStep")
    if kind == "timeStep":
        return interval * time_step
    return interval if kind in ("runTime", "adjustable", "adjustableRunTime") else math.inf


def _read_model(d: Dictionary, default: Model) -> Model:
    """Every option of the model, as an entry of its name."""
    chosen = {}
    for option in fields(Model):
        entry, value = entry_name(option.name), getattr(default, option.name)
        if allowed := option.metadata.get("allowed"):
            chosen[option.name] = d.word(entry, allowed, value)
        elif isinstance(option.default, bool):
            chosen[option.name] = d.switch(entry, value)
        elif option.metadata["least"] == "positive":
            chosen[option.name] = d.number(entry, value, above=0)
        else:
            chosen[option.name] = d.number(entry, value, least=0)
    try:
        return Model(**chosen)
    except ModelError as error:
        raise d.fail(entry_name(error.option), error.wrong) from None


def _read_families(case: Path, fibers: Dictionary, fluid: Fluid) -> tuple[Family, ...]:
    model = _read_model(fibers, Model())
    group = fibers.sub("families")
    families = tuple(_read_family(case, name, d, model, fluid) for name, d in group.subs().items())
    if not families:
        raise fibers.fail("families", "is empty: at least one family of fibers is needed")
    return families


def _read_family(case: Path, name: str, d: Dictionary, model: Model, fluid: Fluid) -> Family:
    model = _read_model(d, model)
    shape = d.word("shape", SHAPES, "straight")
    positions = None
    if shape == "file":
        positions = _read_positions(case, d)
        count, beads = positions.shape[:2]
        length = beads * float(np.linalg.norm(np.diff(positions, axis=1), axis=2).mean())
        seed = 0
    else:
        count, beads = d.integer("count", least=1), read_beads(d, model, fluid)
        seed = d.integer("seed", 1, least=0)
        length = _read_length(d, beads)
    stiffness = _read_stiffness(d, length / beads)
    family = Family(name, count, beads, length, stiffness, seed, shape, model, positions)
    d.done()
    return family


def _read_positions(case: Path, d: Dictionary) -> np.ndarray:
    path = case / d.word("positions")
    try:
        return read_positions(path)
    except ValueError as error:
        raise d.fail("positions", f"names {path}, which {error}") from None


def _read_length(d: Dictionary, beads: int) -> float:
    length, radius = d.either("length", "radius", "'length' (2 a N) and 'radius' (a)", above=0)
    return length if length is not None else 2 * radius * beads


def _read_stiffness(d: Dictionary, diameter: float) -> float:
    stiffness, modulus = d.either(
        "bendingStiffness", "youngModulus", "'bendingStiffness' (K^b) and 'youngModulus'", least=0
    )
    return stiffness if stiffness is not None else modulus * math.pi * diameter**4 / 64  # eq. (10)


def _read_coupling(fibers: Dictionary) -> Coupling:
    if "coupling" not in fibers:
        fibers.raw("coupling", None)
        return Coupling()
    d = fibers.sub("coupling")
    coupling = Coupling(
        transport=d.word("transport", TRANSPORTS, "socket"),
        timeout=d.number("timeout", 120.0, above=0),
        host=d.word("host", default="127.0.0.1"),
        port=d.integer("port", 0, least=0),
        daemons=d.integer("daemons", 1, least=1),
        feedback=d.switch("feedback", False),
        own_disturbance=d.word("ownDisturbance", OWN_DISTURBANCE, "auto"),
    )
    if not coupling.feedback and coupling.own_disturbance != "auto":
        raise d.fail("ownDisturbance", "goes with feedback yes: without it beads disturb nothing")
    if coupling.port and coupling.daemons > 1:
        raise d.fail(
            "port", f"is one for {coupling.daemons} daemons; with several it must be 0, any free one"
        )
    if coupling.port > 65535:
        raise d.fail("port", f"is {coupling.port}; allowed: 0 (any free one) to 65535")
    d.done()
    return coupling


def _read_statistics(fibers: Dictionary) -> Statistics | None:
    """None where the dictionary does not ask for them: nothing is then computed."""
    every = fibers.integer("recordInterval", 10, least=1)
    if "statistics" not in fibers:
        fibers.raw("statistics", None)
        return None
    d = fibers.sub("statistics")
    statistics = Statistics(
        d.number("from", 0.0), d.integer("interval", every, least=1), d.integer("lags", 100, least=0)
    )
    d.done()
    return statistics


def _read_forcing(case: Path) -> Forcing | None:
    """The forcing that both engines know; other fvOptions are OpenFOAM's own business.

    As OpenFOAM does, from constant/fvOptions or else system/fvOptions, in a dictionary `options` if there is one.
    """
    names = [n for n in ("constant/fvOptions", "system/fvOptions") if (case / n).is_file()]
    if not names:
        return None
    options = Dictionary.read(case, names[0])
    if "options" in options:
        options = options.sub("options")
    forcing = None
    for name, d in options.subs(others=True).items():
        kind = d.word("type")
        if kind not in ("linearForcing", "eswaranPope") or not d.switch("active", True):
            continue
        if forcing is not None:
            raise CaseError(f"{options.where}: more than one active forcing")
        coeffs = d.sub(f"{kind}Coeffs") if f"{kind}Coeffs" in d else d
        for entry in ("type", "active", "U", "phi", "libs"):
            coeffs.raw(entry, None)
        values = _linear_forcing(coeffs) if kind == "linearForcing" else _eswaran_pope(coeffs)
        forcing = Forcing(name, kind, values, coeffs.switch("writeToFile", True))
        coeffs.done()
    return forcing


def _linear_forcing(d: Dictionary) -> dict[str, float | str]:
    mode = d.word("mode", ("constantCoefficient", "constantPower"))
    entry = "A" if mode == "constantCoefficient" else "power"
    return {"mode": mode, entry: d.number(entry, least=0)}


def _eswaran_pope(d: Dictionary) -> dict[str, float | str]:
    values = {name: d.number(name, above=0) for name in ("variance", "timeScale")}
    values |= {"cutoff": d.number("cutoff", least=1), "seed": d.integer("seed", 1, least=0)}
    if values["seed"] > LABEL_MAX:
        raise d.fail("seed", f"is {values['seed']}; allowed: 0 to {LABEL_MAX}, OpenFOAM's whole numbers")
    return values


def _read_viscosity(case: Path) -> float:
    """nu of a Newtonian fluid."""
    transport = Dictionary.read(case, "constant/transportProperties")
    transport.word("transportModel", ("Newtonian",), "Newtonian")
    return transport.number("nu", above=0)


def _texts(case: Path) -> dict[str, str]:
    """The dictionaries of the case as they are, for the recording."""
    names = (
        "constant/fiberProperties",
        "constant/transportProperties",
        "constant/turbulenceProperties",
        "constant/fvOptions",
        "system/controlDict",
        "system/fvSchemes",
        "system/fvSolution",
        "system/blockMeshDict",
        "system/initialFieldDict",
    )
    return {
        n: (case / n).read_text(errors="replace") if is_inside(case, case / n) else "(a link out of the case)"
        for n in names
        if (case / n).is_file()
    }
