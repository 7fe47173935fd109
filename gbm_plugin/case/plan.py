"""What a scene will compute, exchange and store, and which choice asked for it."""

from __future__ import annotations

from dataclasses import dataclass

from ..fiber.model import AFFORDABLE
from ..sampling import NUMBERS
from .dictionary import Dictionary
from .disk import readable, writes
from .layout import SPECTRAL
from .scene import Family, Scene
from .solver import asked_by, scheme
from .verdict import sub_steps

FIBERS = "constant/fiberProperties"
WORDS = {"freeDrain": "free drain", "rpy": "RPY"}
LAWS = ("bending_torque", "curvature_law")


@dataclass(frozen=True)
class Item:
    """A thing that is done, in words, and why."""

    what: str
    how: str
    why: str


def need(scene: Scene) -> str:
    """What is sampled at the beads beside the velocity: "rotation", or "gradient" where a family feels the strain."""
    return "gradient" if any(f.model.strain_coupling for f in scene.families) else "rotation"


def computed(scene: Scene) -> list[Item]:
    """The flow, its forcing, every family, and what is sampled for them."""
    chosen = _Choices(scene)
    items = [Item("flow", scheme(scene), asked_by(scene))]
    if scene.forcing:
        values = " ".join(
            f"{k} {v:g}" if isinstance(v, float) else f"{k} {v}" for k, v in scene.forcing.values.items()
        )
        items.append(Item("forcing", f"{scene.forcing.type} {values}", "fvOptions"))
    if scene.coupling.feedback:
        items.append(Item("feedback", "forces and torques of the beads on the flow", "coupling: feedback"))
    items += [_family(f, scene, chosen) for f in scene.families]
    wanted = need(scene)
    if wanted == "gradient":
        why = ", ".join(f.name for f in scene.families if f.model.strain_coupling) + ": strainCoupling"
    else:
        why = chosen.of("interpolation")
    items.append(Item("sampling", f"velocity and {wanted} at the beads, {scene.interpolation}", why))
    return items


def left_out(scene: Scene) -> list[str]:
    """What nothing in the case asks for, and so is neither computed nor sent."""
    models = [f.model for f in scene.families]
    asked = {
        "mobility rpy": any(m.mobility == "rpy" for m in models),
        "strainCoupling": any(m.strain_coupling for m in models),
        "repulsion": any(m.repulsion for m in models),
        "tension (record)": "tension" in scene.record,
        "statistics on the fly": scene.statistics is not None,
        "feedback": scene.coupling.feedback,
        "a forcing": scene.forcing is not None,
        "a table of the flow": scene.forcing is None or scene.forcing.table,
    }
    return [name for name, there in asked.items() if not there]


def exchanged(scene: Scene) -> Item:
    """Bytes of a step between solver and daemons."""
    if scene.application == SPECTRAL:
        return Item("exchanges", "nothing: flow and fibers are one process", asked_by(scene))
    beads = sum(f.count * f.beads for f in scene.families)
    out, back = (72 if scene.coupling.feedback else 24) * beads, 8 * NUMBERS[need(scene)] * beads
    daemons = f"{scene.coupling.daemons} daemons" if scene.coupling.daemons > 1 else "1 daemon"
    how = f"{readable(out)} out, {readable(back)} back a step, {daemons}"
    return Item("exchanges", how, f"{scene.coupling.transport}, {beads} beads")


def stored(scene: Scene) -> list[Item]:
    """Time folders, recordings and tables."""
    control = Dictionary.read(scene.case, "system/controlDict")
    fields = "U, p, phi,"
    if scene.application == "boxFoam" and not control.switch("writePressure", True):
        fields = "U,"
    if scene.coupling.feedback:
        fields += " fiberForce,"
    if scene.application == SPECTRAL:
        fields = f"{SPECTRAL}/<time>: U,"
    state = "flow and fibers" if scene.application in ("boxFoam", SPECTRAL) else "fibers"
    items = [Item("stores", f"{fields} states of {state} {writes(scene)} times", "writeInterval")]
    if scene.statistics:
        s = scene.statistics
        items.append(Item("", f"statistics.h5, every {s.interval} steps from t = {s.since:g}", "statistics"))
    beside = "positions" + "".join(f", {name}" for name in scene.record)
    records = scene.steps // scene.record_interval + 1
    items.append(Item("", f"{beside} of all beads, {records} times", "recordInterval"))
    tables = "rows of flow and fibers" if scene.forcing and scene.forcing.table else "a row of the fibers"
    items.append(Item("", f"{tables} in {scene.steps} steps", "always"))
    return items


class _Choices:
    """Where an entry of constant/fiberProperties was made."""

    def __init__(self, scene: Scene):
        self._top = Dictionary.read(scene.case, FIBERS)
        self._families = self._top.sub("families").subs()

    def of_family(self, entry: str, family: str) -> str | None:
        """The value that a family has, as it is written."""
        d = self._families[family]
        return d.word(entry) if entry in d else None

    def of(self, entry: str, family: str | None = None) -> str:
        if family is not None and entry in self._families[family]:
            return f"{family}: {entry}"
        return entry if entry in self._top else f"{entry} by default"


def _family(f: Family, scene: Scene, chosen: _Choices) -> Item:
    how, why = _steps(f, scene, chosen)
    extras = [
        name
        for name, there in (("strain", f.model.strain_coupling), ("repulsion", f.model.repulsion))
        if there
    ]
    extras += [value for law in LAWS if (value := getattr(f.model, law)) in ("asPrinted", "discreteRod")]
    words = ", ".join([f"{f.count} x {f.beads}", WORDS[f.model.mobility], *extras, how])
    if chosen.of_family("beads", f.name) == "auto":
        why = f"beads auto; {why}"
    return Item(f.name, words, why)


def _steps(f: Family, scene: Scene, chosen: _Choices) -> tuple[str, str]:
    count = sub_steps(f, scene)
    source = chosen.of("integrator", f.name)
    steps = f"{count} sub-steps" if count > 1 else "one step"
    if f.model.integrator == "ab3":
        return f"ab3, {steps}", f"{source}, eq. (10)" if count > 1 else source
    if f.model.integrator == "implicit":
        return "implicit by error", source
    if count <= AFFORDABLE:
        return "ab3, implicit by error", f"auto: eq. (10) asks {count}"
    return "implicit by error", f"auto: eq. (10) asks {count}"
