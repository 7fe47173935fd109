"""`gbm new`: a case of one's own, from the shipped one, with the numbers of a preset."""

from __future__ import annotations

import shutil
from pathlib import Path

from ..errors import CaseError, InstallationError
from .edit import set_entries
from .flow_one import FLOW_ONE
from .flow_two import FLOW_TWO
from .preset import Preset

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
    **FLOW_ONE,
    **FLOW_TWO,
    "taylor-green": Preset(
        "the decaying three-dimensional Taylor-Green vortex, without forcing",
        {
            "constant/transportProperties": {"nu": 0.01},
            "system/controlDict": {"deltaT": 0.02, "endTime": 10},
        },
        {
            "system/initialFieldDict": "field           taylorGreenVortex;\nvelocity        1;              // [m/s]\n"
        },
        without=("constant/fvOptions",),
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
    for name, text in changes.added.items():
        (target / name).write_text((target / name).read_text() + text)
    for name, entries in changes.entries.items():
        set_entries(target / name, entries)
    return target


def listing() -> str:
    """The presets, a line each."""
    width = max(map(len, PRESETS))
    return "\n".join(f"    {name:<{width}}  {preset.title}" for name, preset in PRESETS.items())
