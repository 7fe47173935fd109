"""periodicFFT as the preconditioner of PCG: solutions beside a stock solver's, iterations, refusals."""

from __future__ import annotations

import os
import re
import shutil
from pathlib import Path

import fluidfoam
import numpy as np
import pytest

from gbm_plugin.case.initial import write_velocity
from gbm_plugin.case.openfoam import fatal_message, utility

from conftest import HEADER, make_case, set_entry, start_solver

pytestmark = pytest.mark.openfoam

STEPS = 3
TIME = "0.06"
FFT = "solver PCG; preconditioner periodicFFT; tolerance 1e-12; relTol 0;"
STOCK = "solver PCG; preconditioner DIC; tolerance 1e-12; relTol 0; maxIter 5000;"
SOLUTION = """solvers
{{
    "p|pFinal" {{ {pressure} }}
    "U|UFinal" {{ solver PBiCGStab; preconditioner DILU; tolerance 1e-13; relTol 0; }}
}}
PIMPLE {{ nOuterCorrectors 1; nCorrectors 2; pRefCell {cell}; pRefValue {value}; }}
"""
BOX = """scale 1;
vertices ((0 0 0) ({x} 0 0) ({x} {y} 0) (0 {y} 0) (0 0 {z}) ({x} 0 {z}) ({x} {y} {z}) (0 {y} {z}));
blocks (hex (0 1 2 3 4 5 6 7) ({cells[0]} {cells[1]} {cells[2]}) simpleGrading (1 1 {grading}));
edges ();
boundary
(
    xLow  {{ type cyclic; neighbourPatch xHigh; faces ((0 4 7 3)); }}
    xHigh {{ type cyclic; neighbourPatch xLow;  faces ((1 2 6 5)); }}
    yLow  {{ type cyclic; neighbourPatch yHigh; faces ((0 1 5 4)); }}
    yHigh {{ type cyclic; neighbourPatch yLow;  faces ((3 7 6 2)); }}
    zLow  {{ type {z_type} faces ((0 3 2 1)); }}
    zHigh {{ type {z_type} faces ((4 5 6 7)); }}
);
mergePatchPairs ();
"""


def smooth_velocity(cells: tuple[int, int, int]) -> np.ndarray:
    """Waves (3, nx, ny, nz) that are not free of divergence: the pressure has work to do in every direction.

    They are even in z: decomposePar puts a cell's own value beyond the periodic faces that it makes faces
    between ranks, and the first flux is taken from that.
    """
    angle = [2 * np.pi * (np.arange(n) + 0.5) / n for n in cells]
    x, y, z = np.meshgrid(*angle, indexing="ij")
    return np.stack(
        [np.sin(x + y) + np.cos(z), np.cos(x) + np.sin(y) * np.cos(z), np.sin(2 * x) * np.cos(y) + np.cos(z)]
    )


@pytest.fixture
def box(tmp_path):
    """A case without fibers and forcing in a box of any cells and size, with waves in it."""

    def make(
        name: str = "case",
        cells: tuple[int, int, int] = (8, 8, 8),
        size: tuple[float, float, float] = (1.0, 1.0, 1.0),
        grading: float = 1,
        walls: bool = False,
        pressure: str = FFT,
        cell: int = 0,
        value: float = 0,
        steps: int = STEPS,
        renumber: bool = False,
    ) -> Path:
        path = make_case(
            tmp_path / name,
            steps=steps,
            write_every=STEPS,
            tight=False,
            prepared=False,
            fv_options="",
            application="pimpleFoam",
        )
        control = path / "system/controlDict"
        text = control.read_text()
        control.write_text(text[: text.index("functions")])
        set_entry(control, "deltaT", "0.02")
        x, y, z = size
        z_type = "wall;" if walls else "cyclic; neighbourPatch {};"
        words = BOX.format(x=x, y=y, z=z, cells=cells, grading=grading, z_type=z_type)
        if not walls:
            words = words.replace("{}", "zHigh", 1).replace("{}", "zLow", 1)
        (path / "system/blockMeshDict").write_text(HEADER + words)
        (path / "system/fvSolution").write_text(
            HEADER + SOLUTION.format(pressure=pressure, cell=cell, value=value)
        )
        utility(path, "blockMesh")
        shutil.copytree(path / "0.orig", path / "0")
        write_velocity(path / "0.orig/U", path / "0/U", 0.1 * smooth_velocity(cells))
        if walls:
            for field, kind in (("U", "noSlip"), ("p", "zeroGradient")):
                file = path / "0" / field
                patches = f'"z(Low|High)" {{ type {kind}; }} "(x|y)(Low|High)" {{ type cyclic; }}'
                head = file.read_bytes().partition(b"boundaryField")[0]
                file.write_bytes(head + f"boundaryField {{ {patches} }}\n".encode())
        if renumber:
            utility(path, "renumberMesh", "-overwrite")
        return path

    return make


def solve(path: Path, ranks: int = 1) -> str:
    """Run to the end; the log."""
    if ranks > 1:
        utility(path, "decomposePar")
    assert start_solver(path, ranks).wait() == 0, fatal_message(path / "log.pimpleFoam")
    if ranks > 1:
        utility(path, "reconstructPar", "-latestTime")
    return (path / "log.pimpleFoam").read_text()


def fields(path: Path) -> tuple[np.ndarray, np.ndarray]:
    """p (n) and U (3, n) at the end."""
    p, u = (fluidfoam.readfield(str(path), TIME, name, verbose=False) for name in ("p", "U"))
    return p, u


def iterations(log: str) -> list[int]:
    """Of each pressure solve, of which some must have been periodicFFT's."""
    return [int(n) for n in re.findall(r"periodicFFTPCG:  Solving for p, .*No Iterations (\d+)", log)]


def continuity(log: str) -> float:
    return max(float(e) for e in re.findall(r"sum local = (\S+),", log))


def assert_equal(path: Path, other: Path, relative: float = 1e-9) -> None:
    for ours, theirs in zip(fields(path), fields(other), strict=True):
        scale = np.abs(theirs).max()
        assert scale > 1e-3
        np.testing.assert_allclose(ours, theirs, rtol=0, atol=relative * scale)


def set_ranks(path: Path, words: str) -> None:
    (path / "system/decomposeParDict").write_text(HEADER + words)


@pytest.mark.parametrize(
    ("cells", "size"),
    [
        ((8, 8, 8), (1.0, 1.0, 1.0)),
        ((12, 10, 16), (1.0, 3.0, 0.5)),
        ((7, 11, 13), (2.0, 1.0, 1.5)),
        ((9, 2, 5), (1.0, 1.0, 1.0)),
        ((10, 6, 1), (1.0, 0.7, 0.3)),
    ],
    ids=lambda v: "x".join(map(str, v)),
)
def test_solution_is_that_of_a_stock_solver_in_one_iteration(box, cells, size):
    ours, stock = box("ours", cells, size), box("stock", cells, size, pressure=STOCK)
    log = solve(ours)
    solve(stock)
    assert_equal(ours, stock)
    assert len(iterations(log)) == 2 * STEPS  # p and pFinal of every step
    # the first step's velocity is not free of divergence, nor are its coefficients equal
    assert max(iterations(log)[2:]) == 1
    assert max(iterations(log)) <= 12
    assert continuity(log) < 1e-12


def test_pressure_reference_anywhere(box):
    ours = box("ours", (6, 5, 7), cell=100, value=3.25)
    stock = box("stock", (6, 5, 7), cell=100, value=3.25, pressure=STOCK)
    assert max(iterations(solve(ours))[2:]) == 1
    solve(stock)
    assert fields(ours)[0][100] == pytest.approx(3.25, abs=1e-10)
    assert_equal(ours, stock)


def test_any_numbering_of_the_cells(box):
    ours = box("ours", (7, 6, 8), renumber=True)
    stock = box("stock", (7, 6, 8), renumber=True, pressure=STOCK)
    owner = (ours / "constant/polyMesh/owner").read_bytes()
    assert owner != (box("plain", (7, 6, 8)) / "constant/polyMesh/owner").read_bytes()
    assert max(iterations(solve(ours))[2:]) == 1
    solve(stock)
    assert_equal(ours, stock)


def test_unequal_coefficients_take_a_few_iterations(box):
    """Upwinding puts the flow into the diagonal, and so into 1/A of each cell."""
    ours, stock = box("ours", (12, 12, 12)), box("stock", (12, 12, 12), pressure=STOCK)
    for path in (ours, stock):
        set_entry(path / "system/fvSchemes", "div(phi,U)", "Gauss upwind")
    counts = iterations(solve(ours))
    stock_counts = [int(n) for n in re.findall(r"DICPCG:  Solving for p, .*Iterations (\d+)", solve(stock))]
    assert_equal(ours, stock)
    assert 1 < max(counts) <= 12
    assert 2 * max(counts) < max(stock_counts)


@pytest.mark.parametrize("cells", [(8, 6, 8), (7, 5, 9), (6, 3, 2)], ids=lambda v: "x".join(map(str, v)))
def test_two_ranks_equal_one(box, cells):
    one, two = box("one", cells), box("two", cells)
    nx, ny, nz = cells
    layers = np.repeat(np.arange(nz) >= (nz + 1) // 2, nx * ny).astype(int)
    (two / "constant/decomposition").write_text(
        HEADER.replace("dictionary; object", "labelList; object")
        + f"{layers.size}\n(\n"
        + "\n".join(map(str, layers))
        + "\n)\n"
    )
    if nz % 2:
        set_ranks(two, 'numberOfSubdomains 2; method manual; manualCoeffs { dataFile "decomposition"; }\n')
    else:
        set_ranks(two, "numberOfSubdomains 2; method simple; simpleCoeffs { n (1 1 2); }\n")
    solve(one)
    assert max(iterations(solve(two, ranks=2))[2:]) == 1
    assert_equal(two, one)


def refusal(path: Path, ranks: int = 1) -> str:
    assert start_solver(path, ranks).wait() != 0
    message = fatal_message(path / "log.pimpleFoam")
    assert message is not None, (path / "log.pimpleFoam").read_text()[-2000:]
    return message


@pytest.mark.parametrize("cuts", ["(2 1 1)", "(1 2 1)"])
def test_another_decomposition_is_refused_with_the_one_to_use(box, cuts):
    path = box()
    set_ranks(path, f"numberOfSubdomains 2; method simple; simpleCoeffs {{ n {cuts}; }}\n")
    utility(path, "decomposePar")
    message = refusal(path, ranks=2)
    assert "method simple; simpleCoeffs { n (1 1 2); }" in message


def test_unequal_slabs_are_refused(box):
    path = box(cells=(4, 4, 7))
    set_ranks(path, "numberOfSubdomains 2; method simple; simpleCoeffs { n (1 1 2); }\n")
    utility(path, "decomposePar")  # cuts the middle layer in two
    assert "divides 7 layers" in refusal(path, ranks=2)


def test_walls_are_refused(box):
    message = refusal(box(walls=True))
    assert "patch 'zLow' is of type wall" in message
    assert "cyclic" in message


def test_graded_cells_are_refused(box):
    assert "its cells are not all of one size" in refusal(box(grading=2))


def test_coarse_levels_are_refused(box):
    path = box(
        pressure="solver GAMG; smoother GaussSeidel; tolerance 1e-10; relTol 0;"
        f" coarsestLevelCorr {{ {FFT} }}"
    )
    assert "not within GAMG" in refusal(path)


def test_many_solves_need_no_more_memory(box):
    """A plan per solve would cost 9 kB of arrays each time, 14 MB in the longer run's further solves."""

    def peak(path: Path) -> int:
        process = start_solver(path)
        _, status, used = os.wait4(process.pid, 0)
        process.returncode = status
        assert status == 0, fatal_message(path / "log.pimpleFoam")
        return used.ru_maxrss  # kB

    short, long = (peak(box(f"{steps}", (10, 10, 10), steps=steps)) for steps in (50, 850))
    assert long - short < 3000
