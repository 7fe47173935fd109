"""What must be right before OpenFOAM is started, and what is worth a word: found by reading, in a moment."""

from __future__ import annotations

import gzip
from collections.abc import Iterator
from pathlib import Path

from ..errors import CaseError
from .dictionary import Dictionary
from .expected import expected
from .layout import SPECTRAL, processors, velocity_file
from .scene import Scene
from .syntax import SyntaxFault, parse, tokens
from .verdict import WRONG, verdicts

LIBRARY = "gbmPlugin"
WITHOUT_OPTIONS = ("icoFoam", "dnsFoam")  # solvers that never look at fvOptions
FEEDBACK_WORDS = ("trilinear", "cubic", "quintic")  # interpolations whose transpose spreads forces
STEADY = ("simpleFoam", "porousSimpleFoam", "SRFSimpleFoam", "potentialFoam")
WORDS = {  # what the plugin brings, by the dictionary that names it
    "constant/turbulenceProperties": ("constantViscosity",),
    "system/fvSchemes": (
        "leanCubic",
    ),  # but not what fvSolution names: that is looked up at the first solution
}
ADVICE = f'functions {{ fibers {{ type fiberCoupling; libs ("lib{LIBRARY}.so"); }} }}'
RESOLVED = 2.5  # Δx/η; k_max η = 1.5, usual for resolved turbulence, is 2.1 (Pope, Turbulent Flows, 2000, section 9.1)


def check_openfoam(scene: Scene) -> None:
    """CaseError for a case that OpenFOAM would run without fibers, without its forcing, or not at all."""
    control = Dictionary.read(scene.case, "system/controlDict")
    if (stop := control.word("stopAt", default="endTime")) != "endTime":
        raise control.fail("stopAt", f"is '{stop}', at which the run would end too early; allowed: endTime")
    if scene.application in STEADY:
        raise control.fail("application", f"is {scene.application}, whose steps are no time: fibers need one")
    if scene.forcing is not None and scene.application in WITHOUT_OPTIONS:
        raise control.fail(
            "application",
            f"is {scene.application}, which does not look at fvOptions: the forcing {scene.forcing.name} would do "
            "nothing; pimpleFoam, pisoFoam and boxFoam do",
        )
    if scene.coupling.feedback:
        _check_feedback(scene, control)
    _check_functions(control)
    _check_libraries(scene, control)


def _check_feedback(scene: Scene, control: Dictionary) -> None:
    """What OpenFOAM would find out at its first step."""
    if scene.application in WITHOUT_OPTIONS:
        raise control.fail(
            "application",
            f"is {scene.application}, which does not look at fvOptions: the fibers' feedback would do nothing; "
            "pimpleFoam, pisoFoam and boxFoam do",
        )
    if scene.interpolation not in FEEDBACK_WORDS:
        raise CaseError(
            f"{scene.case}/constant/fiberProperties: interpolation is {scene.interpolation}, whose weights OpenFOAM "
            f"does not tell: with feedback allowed are {' '.join(FEEDBACK_WORDS)}"
        )


def _check_functions(control: Dictionary) -> None:
    functions = control.sub("functions") if "functions" in control else None
    ours = [d for d in _subs(functions) if "type" in d and d.word("type") == "fiberCoupling"]
    if not ours:
        raise CaseError(
            f"{control.where}: no function object fiberCoupling: OpenFOAM would run without fibers; add {ADVICE}"
        )
    coupling = ours[0]
    if not coupling.switch("enabled", True):
        raise coupling.fail("enabled", "is no: OpenFOAM would run without fibers")
    if not _names_library(coupling) and not _names_library(control):
        raise CaseError(f'{coupling.where}: libs ("lib{LIBRARY}.so") is missing, which brings fiberCoupling')


def _check_libraries(scene: Scene, control: Dictionary) -> None:
    """What solvers need when they begin must be in controlDict's own libs: those of function objects come later."""
    if _names_library(control):
        return
    for user in _users(scene):
        raise CaseError(
            f'{control.where}: libs ("lib{LIBRARY}.so") is missing, for {user}: of a function object it comes late'
        )


def _users(scene: Scene) -> Iterator[str]:
    if scene.forcing is not None:
        yield f"the forcing {scene.forcing.type} of fvOptions"
    for name, words in WORDS.items():
        file = scene.case / name
        if file.is_file():
            text = file.read_text(errors="replace")
            yield from (f"the {word} of {name}" for word in words if any(word == t for t in _words(text)))


def _words(text: str) -> Iterator[str]:
    try:
        yield from (token.text for token in tokens(text))
    except SyntaxFault:
        return  # OpenFOAM names it


def _subs(d: Dictionary | None) -> list[Dictionary]:
    return [] if d is None else list(d.subs(others=True).values())


def _names_library(d: Dictionary) -> bool:
    return "libs" in d and LIBRARY in str(d.raw("libs"))


def check_mesh(case: Path) -> None:
    """CaseError for a mesh with a patch that is not periodic."""
    for name, patch in _patches(case).items():
        kind, faces = str(patch.get("type")), str(patch.get("nFaces", "0"))
        if faces != "0" and not kind.startswith("cyclic"):
            raise CaseError(
                f"{case}/constant/polyMesh/boundary: patch '{name}' is of type {kind} with {faces} faces: fibers need "
                "a box that is periodic (cyclic) in all three directions"
            )


def _patches(case: Path) -> dict[str, dict]:
    file = case / "constant/polyMesh/boundary"
    if not file.is_file():
        file = file.with_name("boundary.gz")
    if not file.is_file():
        return {}
    data = file.read_bytes()
    text = (gzip.decompress(data) if file.suffix == ".gz" else data).decode(errors="replace")
    try:
        head = tokens(text)
        begin = next((n for n, t in enumerate(head) if t.text == "}"), -1) + 1  # behind the header
        key, end = head[0]._replace(kind="word", text="boundary"), head[0]._replace(kind="mark", text=";")
        value = parse([key, *head[begin:], end])["boundary"]
        items = value[-1]
        return dict(zip(items[::2], items[1::2], strict=True))
    except (SyntaxFault, IndexError, KeyError, TypeError, ValueError):
        return {}  # OpenFOAM names what is wrong with it


def check_forcing(scene: Scene, time: str) -> None:
    """CaseError for a forcing of fluctuations in a flow that has none."""
    if scene.forcing is None or scene.forcing.type != "linearForcing":
        return
    folders = [scene.case, *processors(scene.case)[:1]]
    file = next((f for folder in folders if (f := velocity_file(folder / time))), None)
    if file is None or file.suffix == ".gz":
        return
    with file.open("rb") as content:
        head = content.read(8192).partition(b"internalField")[2].split(b";")[0]
    if head.split()[:1] == [b"uniform"]:
        raise CaseError(
            f"{file} is uniform: the forcing {scene.forcing.name} has nothing to force, k = 0 (system/initialFieldDict "
            "makes a velocity)"
        )


def notes(scene: Scene, judged: bool = True) -> list[str]:
    """What a user should know of a case that runs. judged: with what is wrong of the numbers that `gbm info` judges."""
    found = []
    flow = expected(scene)
    numbers = {v.name: v for v in verdicts(scene, flow)}
    if scene.box:
        half = min(scene.box) / 2
        found += [
            f"fibers of family {f.name} are {f.length:g} long, more than half of the box ({half:g}): they meet the "
            "flow of their own other end"
            for f in scene.families
            if f.length > half
        ]
    ratio = numbers["dx/eta"].value if "dx/eta" in numbers else 0.0
    if ratio > RESOLVED:
        found.append(
            f"cells are {ratio:.2g} Kolmogorov lengths wide, more than {RESOLVED:g}: small eddies are not resolved"
        )
    found += [
        f"{v.name} is {v.value:.3g}, wrong ({v.asked}): change to {v.change}"
        for v in numbers.values()
        if judged and v.grade == WRONG and v.name not in ("dx/eta", "L/box")
    ]
    writes = (scene.end_time - scene.start_time) / scene.write_interval
    if (
        scene.application != SPECTRAL and abs(writes - round(writes)) > 1e-3
    ):  # also with an interval beyond the end
        found.append(
            f"OpenFOAM writes every {scene.write_interval:g} s and not at endTime {scene.end_time:g}: the same command "
            "will repeat what follows the last time that is written"
        )
    if scene.statistics is not None and scene.statistics.since > scene.end_time:
        found.append(
            f"statistics begin at {scene.statistics.since:g} s, after endTime {scene.end_time:g}: none are gathered"
        )
    model = None if scene.application == SPECTRAL else _turbulence_model(scene.case)
    if model not in ("laminar", None):
        found.append(
            f"constant/turbulenceProperties: simulationType {model}: fibers feel the resolved flow alone, and its "
            "dissipation is not that of the tables"
        )
    return found


def _turbulence_model(case: Path) -> str | None:
    try:
        return Dictionary.read(case, "constant/turbulenceProperties").word("simulationType", default=None)
    except CaseError:
        return None
