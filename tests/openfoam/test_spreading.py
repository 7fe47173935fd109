"""Forces and torques at given places, spread by OpenFOAM: cell by cell, against weights written down here."""

from __future__ import annotations

import numpy as np
import pytest
from driven import driven, fluid_at_rest

from gbm_plugin.output.field import read_velocity

from conftest import divide

pytestmark = pytest.mark.openfoam

CELLS, BOX = 12, 2 * np.pi
CELL = BOX / CELLS


def along(word: str, x: float) -> tuple[np.ndarray, np.ndarray]:
    """Weights of value and slope of all cells in a row at x, in units of cells from the centre of the first."""
    value, slope = np.zeros((2, CELLS))
    lower = int(np.floor(x))
    near = {"trilinear": 1, "cubic": 2, "quintic": 3}[word]
    nodes = np.arange(1 - near, 1 + near)
    for m in nodes:
        others = nodes[nodes != m]
        lagrange = np.poly1d(others, r=True) / np.prod(m - others)
        value[(lower + m) % CELLS] += lagrange(x - lower)
        slope[(lower + m) % CELLS] += lagrange.deriv()(x - lower)
    if word == "trilinear":  # the central difference of cells, interpolated
        slope = (np.roll(value, 1) - np.roll(value, -1)) / 2
    return value, slope


def spread(word: str, places: np.ndarray, loads: np.ndarray) -> np.ndarray:
    """F φ + ½ T × ∇φ over the volume of a cell, (3, n, n, n)."""
    field = np.zeros((3, CELLS, CELLS, CELLS))
    for place, force, torque in zip(places, *loads, strict=True):
        w, s = zip(*(along(word, x / CELL - 0.5) for x in place), strict=True)
        phi = np.einsum("i,j,k->ijk", *w)
        slopes = [np.einsum("i,j,k->ijk", *(s[d] if d == c else w[d] for d in range(3))) for c in range(3)]
        field += force[:, None, None, None] * phi
        field += np.cross(torque, np.array(slopes) / CELL, axisb=0, axisc=0) / 2
    return field / CELL**3


@pytest.mark.parametrize(
    ("word", "application", "ranks"),
    [
        ("trilinear", "boxFoam", 1),
        ("quintic", "boxFoam", 3),
        pytest.param("cubic", "boxFoam", 1, marks=pytest.mark.exhaustive),
        pytest.param("trilinear", "boxFoam", 4, marks=pytest.mark.exhaustive),
        pytest.param("cubic", "pimpleFoam", 3, marks=pytest.mark.exhaustive),
    ],
)
def test_each_cell_gets_what_the_weights_say(word, application, ranks, tmp_path):
    """In all of the box and beyond it, on faces, edges and corners and next to a centre, one bead on another;
    on slabs of ranks, some of which have no bead, and on ragged ones."""
    random = np.random.default_rng(5)
    places = random.uniform(-BOX, 2 * BOX, (40, 3))
    places[:3] = [[0, 0, 0], [BOX, 5 * CELL, 3 * CELL], [BOX / 2, BOX, 0]]
    places[3] = 0.5 * CELL + 1e-9  # at centres themselves the slopes of polynomials jump
    places[4] = places[5]
    if application == "boxFoam" and ranks > 1:
        places[:, 2] = random.uniform(0, 0.6 * CELL, 40)
    loads = 1e-6 * random.standard_normal((2, 40, 3))
    options = {"cells": CELLS, "steps": 2, "write_every": 1, "interpolation": word, "tight": ranks > 1}
    case = fluid_at_rest(tmp_path / "case", 40, application=application, **options)
    if ranks > 1:
        divide(case, ranks, (1, 1, ranks) if application == "boxFoam" else None)
    driven(case, places, loads, ranks=ranks)
    expected = spread(word, places, loads)
    for time in ("0.02", "0.04"):
        found = read_velocity(case, time, (CELLS,) * 3, "fiberForce")
        assert np.abs(found - expected).max() < 1e-11 * np.abs(expected).max()
