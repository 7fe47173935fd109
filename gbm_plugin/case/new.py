"""`gbm new`: a case of one's own, from the shipped one, with the numbers of a preset."""

from __future__ import annotations

import shutil
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path

from ..errors import CaseError, InstallationError
from .edit import set_entries

SHIPPED = Path(__file__).resolve().parents[2] / "openfoam_case"
PARTS = ("0.orig", "constant", "system")

_HEAD = """FoamFile
{{
    version     2.0;
    format      ascii;
    class       dictionary;
    location    "{folder}";
    object      {name};
}}

"""


@dataclass(frozen=True)
class Preset:
    """What differs from the shipped case: entries by dictionary, and dictionaries with another text."""

    title: str
    entries: Mapping[str, Mapping[str, object]] = field(default_factory=dict)
    texts: Mapping[str, str] = field(default_factory=dict)
    without: tuple[str, ...] = ()


_FLOW_ONE_FIBERS = """rho             1;

mobility        freeDrain;
integrator      auto;
tolerance       1e-4;
interpolation   cubic;
recordInterval  20;

families    // d = 0.1 (3.5 eta), K^b from flexible to stiff, as in section 4 of the paper
{
    K1e-6   { count 100; beads 20; length 2; bendingStiffness 1e-6; seed 1; }
    K1e-5   { count 100; beads 20; length 2; bendingStiffness 1e-5; seed 2; }
    K1e-4   { count 100; beads 20; length 2; bendingStiffness 1e-4; seed 3; }
    K1e-3   { count 100; beads 20; length 2; bendingStiffness 1e-3; seed 4; }
}
"""

# Flow II (epsilon 0.34, eta 0.0074) in a box of 4.1: lengths from 2 eta to half of the box, L/l_p from 0.5 to 37
_FLOW_TWO_FIBERS = """rho             1;

mobility        freeDrain;
integrator      auto;
tolerance       1e-4;
interpolation   cubic;
recordInterval  9;              // half a Kolmogorov time

statistics
{
    from        3;              // [s]; a turnover is 0.83
    interval    9;              // steps between samples
    lags        150;            // samples that correlations reach
}

families
{
    // as long as half of the box and shorter, K^b from stiff to flexible
FAMILIES
    // stiff rods of 2 to 60 eta
RODS
    // what the fluid does
    tracers     { count 500; beads 2; length 0.004; bendingStiffness 0; seed 90; }
}
"""


def _flow_two_fibers() -> str:
    grid = {
        (2.0, 20): ("1e-2", "1e-3", "1e-4", "1e-5"),
        (2.0, 40): ("1e-4", "1e-6"),
        (1.0, 20): ("1e-3", "1e-4", "1e-5", "1e-6", "1.5e-7"),
        (1.0, 40): ("1e-8",),
        (0.5, 20): ("1e-3", "1e-4", "1e-5", "1e-6", "1e-7", "1e-8"),
        (0.25, 20): ("1e-5", "1e-6", "1e-7", "1e-8", "1e-9"),
        (0.12, 20): ("1e-7", "1e-9"),
        (0.06, 20): ("1e-9",),
    }
    seed, families = 0, []
    for (length, beads), stiffnesses in grid.items():
        for stiffness in stiffnesses:
            seed += 1
            name = f"L{length:g}K{stiffness}" + ("" if beads == 20 else f"N{beads}")
            families.append(_family(name, 60, beads, f"{length:g}", stiffness, seed))
    rods = {2: "1e-8", 4: "2e-7", 8: "3e-6", 15: "3e-5", 30: "5e-4", 60: "8e-3"}
    lines = [
        _family(f"rod{n}", 100, 10, f"{n * 0.0074:.4g}", stiffness, 70 + n) for n, stiffness in rods.items()
    ]
    text = _FLOW_TWO_FIBERS.replace("FAMILIES", "\n".join(families))
    return text.replace("RODS", "\n".join(lines))


def _family(name: str, count: int, beads: int, length: str, stiffness: str, seed: int) -> str:
    return (
        f"    {name:<12}{{ count {count}; beads {beads}; length {length}; bendingStiffness {stiffness}; "
        f"seed {seed}; }}"
    )


_FLOW_TWO = {
    "system/blockMeshDict": {"width": 4.1, "n": 192},
    "constant/transportProperties": {"nu": 1e-3},
    "system/controlDict": {"application": "boxFoam", "deltaT": 0.003, "endTime": 17.01, "writeInterval": 135},
}
_FLOW_TWO_FORCE = (
    "eswaranPope\n{\n    type        eswaranPope;\n    variance    1.015e-3;   // of an amplitude [m2/s4]\n"
    "    timeScale   0.944;      // [s]\n    cutoff      3.4641;     // waves per box\n    seed        1;\n}\n"
)
_FLOW_TWO_SOLUTION = """spectral
{
    nSubCycles  3;      // steps of the flow in a deltaT: 1 for 64^3, 2 for 128^3, 4 for 256^3
}
"""

PRESETS = {
    "default": Preset("the shipped case: forced turbulence, a stiff and a flexible family"),
    "quick": Preset(
        "the same in seconds: fewer cells, a short time",
        {
            "system/blockMeshDict": {"n": 24},
            "constant/transportProperties": {"nu": 0.02},
            "constant/fiberProperties": {"recordInterval": 5},
            "system/controlDict": {"deltaT": 0.04, "endTime": 4, "writeInterval": 25},
        },
    ),
    "pimpleFoam": Preset(
        "the same by pimpleFoam, which takes any mesh of a periodic box: 40^3, viscosity 0.01",
        {
            "system/blockMeshDict": {"n": 40},
            "constant/transportProperties": {"nu": 0.01},
            "constant/fiberProperties": {"interpolation": "cubic", "recordInterval": 5},
            "system/controlDict": {"application": "pimpleFoam", "deltaT": 0.04, "writeInterval": 75},
        },
    ),
    "flow-I": Preset(
        "Flow I of the paper: 128^3, Eswaran-Pope forcing, epsilon 0.0015, Re_lambda 52; hours",
        {
            "system/blockMeshDict": {"n": 128},
            "constant/transportProperties": {"nu": 1e-3},
            "system/controlDict": {
                "deltaT": 0.01,
                "endTime": 500,
                "writeInterval": 2000,
            },
            "system/initialFieldDict": {"kineticEnergy": 0.025},
        },
        {
            "constant/fvOptions": "eswaranPope\n{\n    type        eswaranPope;\n    variance    5.53e-7;    // of an "
            "amplitude [m2/s4]\n    timeScale   7.65;       // [s]\n    cutoff      3.4641;     // waves per box\n"
            "    seed        1;\n}\n",
            "constant/fiberProperties": _FLOW_ONE_FIBERS,
        },
    ),
    "flow-II-start": Preset(
        "the large scales of Flow II at 64^3, with tracers: what flow-II begins from; a minute by --flow spectral",
        {
            **_FLOW_TWO,
            "system/blockMeshDict": {"width": 4.1, "n": 64},
            "system/controlDict": {
                "application": "boxFoam",
                "deltaT": 0.003,
                "endTime": 9,
                "writeInterval": 1000,
            },
            "system/initialFieldDict": {"kineticEnergy": 0.7},
        },
        {
            "constant/fvOptions": _FLOW_TWO_FORCE,
            "constant/fiberProperties": "interpolation   cubic;\nrecordInterval  9;\n\nfamilies\n{\n"
            + _family("tracers", 500, 2, "0.004", "0", 90)
            + "\n}\n",
        },
    ),
    "flow-II": Preset(
        "Flow II: epsilon 0.34, Re_lambda 97, box 4.1, 192^3, from ../flow-II-start; hours by --flow spectral",
        _FLOW_TWO,
        {
            "constant/fvOptions": _FLOW_TWO_FORCE,
            "constant/fiberProperties": _flow_two_fibers(),
            "system/fvSolution": _FLOW_TWO_SOLUTION,
            "system/initialFieldDict": 'field           run;\nfrom            "../flow-II-start";     // its case\n',
        },
    ),
    "taylor-green": Preset(
        "the decaying three-dimensional Taylor-Green vortex, without forcing",
        {
            "constant/transportProperties": {"nu": 0.01},
            "system/controlDict": {"deltaT": 0.02, "endTime": 10},
        },
        {
            "system/initialFieldDict": "field           taylorGreenVortex;\nvelocity        1;              // [m/s]\n"
        },
        ("constant/fvOptions",),
    ),
}


def new_case(target: Path | str, preset: str = "default") -> Path:
    """Make the case `target` from the shipped one. Raises CaseError where it is there already or the preset is not
    known, InstallationError where the shipped case is not beside the package."""
    target = Path(target)
    if preset not in PRESETS:
        raise CaseError(f"there is no preset '{preset}'; allowed: {' '.join(PRESETS)}")
    if target.exists():
        raise CaseError(f"{target} is there already: give a folder that is not")
    if not SHIPPED.is_dir():
        raise InstallationError(f"the shipped case is not at {SHIPPED}: install the package from its clone")
    changes = PRESETS[preset]
    target.mkdir(parents=True)
    for part in PARTS:
        shutil.copytree(SHIPPED / part, target / part, ignore=shutil.ignore_patterns("polyMesh"))
    for name in changes.without:
        (target / name).unlink()
    for name, text in changes.texts.items():
        folder, file = name.split("/")
        (target / name).write_text(_HEAD.format(folder=folder, name=file) + text)
    for name, entries in changes.entries.items():
        set_entries(target / name, entries)
    return target


def listing() -> str:
    """The presets, a line each."""
    width = max(map(len, PRESETS))
    return "\n".join(f"    {name:<{width}}  {preset.title}" for name, preset in PRESETS.items())
