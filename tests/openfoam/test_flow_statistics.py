"""The statistics of linearForcing and its removal of the mean, against the written fields."""

from __future__ import annotations

import re
import shutil

import numpy as np
import pytest

from gbm_plugin.case.initial import write_velocity
from gbm_plugin.case.openfoam import utility
from gbm_plugin.output.field import read_velocity
from gbm_plugin.output.tables import read_dat

from conftest import divide, make_case, start_solver

pytestmark = pytest.mark.openfoam

NU, CELLS, STEPS, TIME = 0.01, 12, 2, "0.04"
POWER = "linearForcing { type linearForcing; mode constantPower; power 0.05; }"
FACE_SUMS = ("Gauss linear", "orthogonal")
SCHEMES = {
    "face sums": FACE_SUMS,
    "face sums, uncorrected": ("Gauss linear", "uncorrected"),
    "OpenFOAM's operators": ("leastSquares", "corrected"),  # on a uniform mesh the same derivatives
}


def prepare(path, schemes=FACE_SUMS, ranks: int = 1, **options):
    """A case without fibers."""
    options = {"application": "pimpleFoam"} | options
    make_case(path, **{"cells": CELLS, "steps": STEPS, "write_every": STEPS, "fv_options": POWER} | options)
    control = path / "system/controlDict"
    control.write_text(control.read_text().split("functions")[0])
    gradient, face_gradient = schemes
    file = path / "system/fvSchemes"
    text = file.read_text()
    for name, words in (
        ("gradSchemes", f"default Gauss linear; grad(U) {gradient};"),
        ("laplacianSchemes", f"default Gauss linear {face_gradient};"),
        ("snGradSchemes", f"default {face_gradient};"),
    ):
        start = text.index(name)
        text = text[:start] + f"{name} {{ {words} }}" + text[text.index("}", start) + 1 :]
    file.write_text(text)
    if ranks > 1:
        divide(path, ranks, (1, 1, ranks))
    return path


def solve(path, ranks: int = 1):
    assert start_solver(path, ranks).wait() == 0, (path / "log.pimpleFoam").read_text()[-2000:]
    if ranks > 1:
        utility(path, "reconstructPar", "-latestTime")
    return read_dat(path / "postProcessing/linearForcing", "linearForcing.dat")


def dissipation(u: np.ndarray) -> dict[str, float]:
    """Of a field (3, n, n, n) on the periodic box, with central and with one-sided differences."""
    h = 2 * np.pi / u.shape[-1]
    central = [(np.roll(u, -1, axis) - np.roll(u, 1, axis)) / (2 * h) for axis in (1, 2, 3)]
    faces = [(np.roll(u, -1, axis) - u) / h for axis in (1, 2, 3)]
    return {
        name: NU * sum(np.mean(np.sum(d**2, axis=0)) for d in differences)
        for name, differences in (("epsilonGradient", central), ("epsilonLaplacian", faces))
    }


@pytest.mark.parametrize("ranks", [1, 2])
@pytest.mark.parametrize("schemes", SCHEMES.values(), ids=SCHEMES.keys())
def test_dissipation_of_a_turbulent_field(tmp_path, schemes, ranks):
    path = prepare(tmp_path / "case", schemes, ranks)
    rows = solve(path, ranks)
    u = read_velocity(path, TIME, (CELLS,) * 3)
    for column, value in dissipation(u).items():
        assert rows[column][-1] == pytest.approx(value, rel=1e-10)
    assert rows["k"][-1] == pytest.approx(0.5 * np.mean(np.sum(u**2, axis=0)), rel=1e-10)
    assert rows["epsilonLaplacian"][-1] > 1.05 * rows["epsilonGradient"][-1]


@pytest.mark.parametrize("ranks", [1, 2])
def test_dissipation_on_a_skewed_mesh(tmp_path, ranks):
    """Sums over faces, and OpenFOAM's operators, which other words for the same schemes call."""
    rows = {}
    for name, schemes in {
        "sums": ("Gauss linear", "uncorrected"),
        "operators": ("cellLimited Gauss linear 0", "limited corrected 0"),
    }.items():
        path = prepare(tmp_path / name, schemes, prepared=False)
        block = path / "system/blockMeshDict"
        corners = {"$width $width ": "7.5 $width ", "0      $width ": "1.216814692820414 $width "}
        words = block.read_text()
        for straight, skewed in corners.items():
            assert words.count(f"({straight}") == 2
            words = words.replace(f"({straight}", f"({skewed}")
        block.write_text(words)
        utility(path, "blockMesh")
        shutil.copytree(path / "0.orig", path / "0")
        write_velocity(path / "0.orig/U", path / "0/U", waves())
        if ranks > 1:
            divide(path, ranks, (1, 1, ranks))
        rows[name] = solve(path, ranks)
    for column in ("epsilonGradient", "epsilonLaplacian"):
        np.testing.assert_allclose(rows["sums"][column], rows["operators"][column], rtol=1e-8)
    # the words do reach the schemes: at a right angle the same waves have another dissipation
    right = dissipation(waves())
    assert abs(rows["sums"]["epsilonGradient"][0] / right["epsilonGradient"] - 1) > 0.01


def waves() -> np.ndarray:
    x, y, z = np.meshgrid(*3 * [2 * np.pi * (np.arange(CELLS) + 0.5) / CELLS], indexing="ij")
    return 0.2 * np.stack([np.sin(x + y) + np.cos(z), np.cos(x) * np.sin(y), np.sin(2 * x) * np.cos(y)])


@pytest.mark.parametrize("ranks", [1, 2])
def test_the_mean_leaves_velocity_and_flux(tmp_path, ranks):
    """After one step from a field whose mean is not zero: no net flux through any plane of faces."""
    mean = "((0 0 0) (0.3 -0.2 0.1) (0 0 0))"
    wave = "((0 2 0) (0 0 0) (-1 0 0))"
    initial = f"field modes; modes ({wave} {mean});"
    path = prepare(tmp_path / "case", ranks=ranks, steps=1, write_every=1, initial=initial)
    solve(path, ranks)
    u = read_velocity(path, "0.02", (CELLS,) * 3)
    assert np.abs(u.mean(axis=(1, 2, 3))).max() < 1e-12
    phi = faces(path / "0.02/phi")
    area = (2 * np.pi / CELLS) ** 2
    # the faces inside a block: of each cell those to x, y and z, but for the last in a direction
    face = 0
    planes = [np.zeros(CELLS - 1) for _ in range(3)]
    for k in range(CELLS):
        for j in range(CELLS):
            for i in range(CELLS):
                for axis, index in enumerate((i, j, k)):
                    if index < CELLS - 1:
                        planes[axis][index] += phi[face] / area / CELLS**2
                        face += 1
    assert face == len(phi)
    assert np.abs(phi).max() > 0.5 * area  # of the wave
    assert max(np.abs(p).max() for p in planes) < 1e-11


def faces(file) -> np.ndarray:
    """Internal values of a binary surfaceScalarField."""
    data = file.read_bytes()
    start = re.search(rb"internalField\s+nonuniform List<scalar>\s*\n(\d+)\n\(", data)
    return np.frombuffer(data, "<f8", int(start.group(1)), start.end())
