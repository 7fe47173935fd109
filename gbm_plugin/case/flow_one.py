"""Presets of the paper's Flow I: nu 1e-3, epsilon 0.0015, Re_lambda 52, eta 0.029, tau_eta 0.83, L/u' 7.6."""

from __future__ import annotations

from .preset import Preset

_HEAD = """rho             1;

mobility        freeDrain;
integrator      auto;
interpolation   cubic;
recordInterval  {record};

"""
_PAPER = """families    // d = 0.1 (3.5 eta), K^b from flexible to stiff, as in section 4 of the paper
{
    K1e-6   { count 100; beads 20; length 2; bendingStiffness 1e-6; seed 1; }
    K1e-5   { count 100; beads 20; length 2; bendingStiffness 1e-5; seed 2; }
    K1e-4   { count 100; beads 20; length 2; bendingStiffness 1e-4; seed 3; }
    K1e-3   { count 100; beads 20; length 2; bendingStiffness 1e-3; seed 4; }
}
"""
_STATISTICS = """statistics
{
    from        40;             // [s]; a turnover is 7.6
    interval    10;             // steps between samples
}

families
{
    // lengths of 20 to 150 eta, K^b from stiff to flexible
"""
_STIFFNESSES, _LENGTHS = ("1e-3", "1e-4", "1e-5", "1e-6"), (0.6, 1, 2, 3, 4.5)
_RODS = {0.06: "1e-6", 0.15: "1e-5", 0.3: "1e-4", 0.6: "1e-2", 1.2: "0.1", 2.4: "1"}  # length: K^b
_FORCE = """eswaranPope
{
    type        eswaranPope;
    variance    5.53e-7;    // of an amplitude [m2/s4]
    timeScale   7.65;       // [s]
    cutoff      3.4641;     // waves per box
    seed        1;
}
"""


def _all_fibers() -> str:
    lines, seed = [], 0

    def family(name: str, count: int, beads: int, length: float, stiffness: str, more: str = "") -> None:
        nonlocal seed
        seed += 1
        lines.append(
            f"    {name:<18}{{ count {count}; beads {beads}; length {length:g}; bendingStiffness {stiffness}; "
            f"seed {seed}; {more}}}\n"
        )

    for stiffness in _STIFFNESSES:
        for length in _LENGTHS:
            family(f"K{stiffness}_L{length:g}_N20", 100, 20, length, stiffness)
    lines.append("    // one fiber of other beads, and by the paper's integrator\n")
    for beads, count in ((10, 100), (40, 100), (80, 60)):
        family(f"K1e-6_L2_N{beads}", count, beads, 2, "1e-6")
    family("K1e-6_L2_N20_ab3", 100, 20, 2, "1e-6", "integrator ab3; ")
    lines.append("    // without stiffness; stiff rods of 2 to 80 eta; what the fluid does\n")
    family("coil_L1.8_N20", 200, 20, 1.8, "4e-16")
    for length, stiffness in _RODS.items():
        family(f"rod_L{length:g}_N10", 200, 10, length, stiffness)
    family("tracer", 300, 2, 0.004, "0")
    return _HEAD.format(record=10) + _STATISTICS + "".join(lines) + "}\n"


def _preset(title: str, control: dict, fibers: str, cycles: int) -> Preset:
    cycled = f"\nspectral\n{{\n    nSubCycles  {cycles};      // steps of the spectral flow in a deltaT\n}}\n"
    return Preset(
        title,
        {
            "system/blockMeshDict": {"n": 128},
            "constant/transportProperties": {"nu": 1e-3},
            "system/controlDict": control,
            "system/initialFieldDict": {"kineticEnergy": 0.025},
        },
        {"constant/fvOptions": _FORCE, "constant/fiberProperties": fibers},
        {"system/fvSolution": cycled} if cycles > 1 else {},
    )


FLOW_ONE = {
    "flow-I": _preset(
        "Flow I of the paper: 128^3, Eswaran-Pope forcing, epsilon 0.0015, Re_lambda 52; hours",
        {"deltaT": 0.01, "endTime": 500, "writeInterval": 2000},
        _HEAD.format(record=20) + _PAPER,
        1,
    ),
    "flow-I-families": _preset(
        "the same with the 32 families of docs/results/turbulence, in either engine; hours",
        {"deltaT": 0.02, "endTime": 540, "writeInterval": 300},
        _all_fibers(),
        2,
    ),
}
