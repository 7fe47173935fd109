"""Every call of the plugin that all ranks must make together, with what makes them all come to it.

A rank that does not come leaves the others waiting for ever. So none of these may depend on what one rank alone
sees: the number of its patches (those between ranks are other ones on each), its cells, its beads, a file. Whoever
adds one finds what all ranks share, and says it here. tests/openfoam/test_ranks.py runs them.
"""

from __future__ import annotations

import re
from pathlib import Path

import gbm_plugin

SOURCE = Path(gbm_plugin.__file__).parent / "openfoam"

COLLECTIVE = re.compile(
    r"\b(U?Pstream::(?!parRun|master\b|nProcs|myProcNo)\w+|reduce|returnReduce\w*|gSum\w*|gMax\w*|gMin\w*|gAverage"
    r"|finishedSends|distribute|globalIndex \w+|mapDistribute \w+|fftw_execute|MPI_\w+)\s*\("
)

# file: how many, and who makes all ranks come
CALLS = {
    "lattice/periodicBox.C": (3, "made for each mesh; lists by patch hold those that all ranks have"),
    "lattice/uniformBox.C": (3, "made for each mesh, with the answer of periodicBox, which is one for all"),
    "lattice/latticeNeighbours.C": (8, "lattice is made for each mesh, where uniformBox has no problem"),
    "lattice/lattice.C": (1, "addBack by spread, of every rank, with cells and beads or without"),
    "lattice/lattice.H": (1, "gather by correction and look, of every rank, with cells and beads or without"),
    "lattice/cellSearch.C": (
        6,
        "candidates: every rank looks at the points of all; owners are one list for all",
    ),
    "common/consistentStart.C": (
        1,
        "made at a start; whether U and phi are registered is the solver's doing",
    ),
    "forcing/flowStatistics.C": (
        8,
        "schemes are of the case; called in addSup and correct of every rank",
    ),
    "forcing/turbulenceForcing.C": (1, "made for each run"),
    "eswaranPope/eswaranPope.C": (
        4,
        "made for each run; called in addSup, endRate and correct of every rank",
    ),
    "fiberCoupling/fiberCoupling.C": (
        10,
        "once a step, provisional or not as all daemons together say; two at a start and two in a step where the "
        "dictionary asks for feedback",
    ),
    "fiberCoupling/sampling/beadExchange.C": (
        4,
        "locate, collect and distribute of every rank, with beads or without",
    ),
    "fiberCoupling/sampling/beadExchange.H": (1, "the declaration of distribute"),
    "transform/slab.C": (2, "made for each mesh"),
    "transform/nodeMemory.C": (18, "made and met for transforms; ranks of a node agree whether they share"),
    "transform/slabPlanes.C": (6, "every rank sweeps, with layers and rows or without"),
    "boxFoam/boxFlow.C": (6, "once a sweep of every rank"),
    "boxFoam/boxVelocity.C": (
        3,
        "ranks with layers, which follow from n and the block alone, go round in a ring",
    ),
    "boxFoam/flowState.C": (3, "at a start; what the ranks found is one answer for all before it is used"),
    "boxFoam/momentumSources.C": (1, "the options of a case are those of every rank"),
    "pressure/periodicLaplacian.C": (2, "PCG, whose residual is one for all, asks; every rank has a plan"),
    "pressure/periodicFFTPreconditioner.C": (3, "PCG again; sum_ is one for all"),
}


def calls(path: Path) -> list[str]:
    text = re.sub(r"//[^\n]*|/\*.*?\*/", "", path.read_text(), flags=re.S)
    return COLLECTIVE.findall(text)


def test_every_collective_call_is_accounted_for():
    found = {}
    for path in sorted(SOURCE.rglob("*.[CH]")):
        if "lnInclude" not in path.parts and (n := len(calls(path))):
            found[path.relative_to(SOURCE).as_posix()] = n
    assert found == {name: n for name, (n, _) in CALLS.items()}
