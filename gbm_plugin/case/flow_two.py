"""Presets of the paper's Flow II: nu 1e-3, epsilon 0.34, Re_lambda 97, eta 0.0074, tau_eta 0.054.

Forced at the largest scales of a box of 4.1 it has L = 0.57, which the paper's own nu, epsilon and Re_lambda ask for.
The box of 2 pi is forced at the same wavenumbers, with the variance for the same epsilon by the estimate of Eswaran &
Pope (1988): the check that the small box is large enough. Either begins with its large scales at a few cells.
"""

from __future__ import annotations

import math

from .preset import Preset

_ETA = 0.0074
# length and beads: K^b [N m2], so that L/l_p goes from 0.5 to 37 and l_p is no shorter than a bead
_STIFFNESS = {
    (2.0, 20): ("1e-2", "1e-3", "1e-4", "1e-5"),
    (2.0, 40): ("1e-4", "1e-6"),
    (1.0, 20): ("1e-3", "1e-4", "1e-5", "1e-6", "1.5e-7"),
    (1.0, 40): ("1e-8",),
    (0.5, 20): ("1e-3", "1e-4", "1e-5", "1e-6", "1e-7", "1e-8"),
    (0.25, 20): ("1e-5", "1e-6", "1e-7", "1e-8", "1e-9"),
    (0.12, 20): ("1e-7", "1e-9"),
    (0.06, 20): ("1e-9",),
}
_RODS = {
    2: "1e-8",
    4: "2e-7",
    8: "3e-6",
    15: "3e-5",
    30: "5e-4",
    60: "8e-3",
}  # L/eta: K^b that keeps them straight
_FIBERS = """rho             1;

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
"""
_FORCE = """eswaranPope
{{
    type        eswaranPope;
    variance    {variance};   // of an amplitude [m2/s4]
    timeScale   0.944;      // [s]
    cutoff      {cutoff};     // waves per box
    seed        1;
}}
"""
_SOLUTION = """
spectral
{{
    nSubCycles  {cycles};      // steps of the flow in a deltaT: 1 for h of 0.064, 2 for 0.032, 4 for 0.021, 5 for 0.016
}}
"""


def _family(name: str, count: int, beads: int, length: float, stiffness: str, seed: int) -> str:
    return (
        f"    {name:<12}{{ count {count}; beads {beads}; length {length:.4g}; bendingStiffness {stiffness}; "
        f"seed {seed}; }}\n"
    )


_TRACERS = "    // what the fluid does\n" + _family("tracers", 500, 2, 0.004, "0", 90)


def _all_fibers() -> str:
    text, seed = _FIBERS + "    // as long as half of the box and shorter, from stiff to flexible\n", 0
    for (length, beads), stiffnesses in _STIFFNESS.items():
        for stiffness in stiffnesses:
            seed += 1
            name = f"L{length:g}K{stiffness}" + ("" if beads == 20 else f"N{beads}")
            text += _family(name, 60, beads, length, stiffness, seed)
    text += "    // rods of 2 to 60 eta\n"
    for n, stiffness in _RODS.items():
        text += _family(f"rod{n}", 100, 10, n * _ETA, stiffness, 70 + n)
    return text + _TRACERS + "}\n"


def _preset(title: str, box: tuple[float, str, str], cells: int, cycles: int, start: str = "") -> Preset:
    """box: its width, and variance and cutoff of its force; start: the case that it begins from."""
    width, variance, cutoff = box
    control = {"deltaT": 0.003, "endTime": 17.01, "writeInterval": 135} if start else {"deltaT": 0.003}
    if not start:
        control |= {"endTime": 9, "writeInterval": 1000}
    entries = {
        "system/blockMeshDict": {"width": width, "n": cells},
        "constant/transportProperties": {"nu": 1e-3},
        "system/controlDict": {"application": "boxFoam"} | control,
    }
    texts = {
        "constant/fvOptions": _FORCE.format(variance=variance, cutoff=cutoff),
        "constant/fiberProperties": _all_fibers()
        if start
        else f"interpolation   cubic;\nrecordInterval  9;\n\nfamilies\n{{\n{_TRACERS}}}\n",
    }
    if start:
        texts["system/initialFieldDict"] = (
            f'field           run;\nfrom            "../{start}";     // its case\n'
        )
    else:
        entries["system/initialFieldDict"] = {"kineticEnergy": 0.7}
    added = {"system/fvSolution": _SOLUTION.format(cycles=cycles)} if start else {}
    return Preset(title, entries, texts, added)


_SMALL, _WIDE = (4.1, "1.015e-3", "3.4641"), (2 * math.pi, "2.54e-4", "5.3087")
FLOW_TWO = {
    "flow-II-start": _preset(
        "the large scales of Flow II at 64^3, with tracers: what flow-II begins from; minutes by --flow spectral",
        _SMALL,
        64,
        1,
    ),
    "flow-II": _preset(
        "Flow II: epsilon 0.34, Re_lambda 97, box 4.1, 192^3, from ../flow-II-start; --flow spectral: hours",
        _SMALL,
        192,
        4,
        "flow-II-start",
    ),
    "flow-II-wide-start": _preset("the same for flow-II-wide, at 96^3", _WIDE, 96, 1),
    "flow-II-wide": _preset(
        "Flow II in the paper's box of 2 pi, 384^3, from ../flow-II-wide-start; --flow spectral: a day",
        _WIDE,
        384,
        5,
        "flow-II-wide-start",
    ),
}
