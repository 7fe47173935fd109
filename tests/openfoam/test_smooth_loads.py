"""Loads spread over several cells, whatever the mesh: what OpenFOAM's flow makes of them, against Stokes' equations.

A point's own disturbance is as large as its cells are small, and different for each interpolation: only for loads of a
fixed width has the exchange a limit, which every mesh must approach with the order of its interpolation.
"""

from __future__ import annotations

import numpy as np
import pytest
from driven import driven, fluid_at_rest

from gbm_plugin.case.solver import face_values
from gbm_plugin.fleet.own import CENTRAL2, CENTRAL6, Mesh, OwnDisturbance, kernels

pytestmark = pytest.mark.openfoam

BOX, NU, STEPS, STEP = 2 * np.pi, 0.5, 10, 0.02
LOAD = 1e-6 * np.array([5.0, 3.0, -2.0])  # so weak that convection is nothing


def cloud(width: float = 0.55) -> tuple[np.ndarray, np.ndarray]:
    """Points of a Gaussian and their weights, on a lattice that every mesh of the test divides: what it lacks of a
    smooth density then has waves as long as cells, which the interpolation does not see."""
    line = np.arange(-8, 9) * 2 * np.pi / 24
    x = np.stack(np.meshgrid(line, line, line, indexing="ij"), axis=-1).reshape(-1, 3)
    weights = np.exp(-(x**2).sum(axis=1) / (2 * width**2))
    some = weights > 1e-4
    return x[some] + (2.9, 3.3, 3.1), weights[some] / weights[some].sum()


def power_of_stokes(places: np.ndarray, weights: np.ndarray, kind: int, time: float) -> float:
    """Of the loads on a fluid at rest at time 0, without what moves it as a whole: the sum over its modes."""
    m = np.arange(-9, 10)
    k = np.stack(np.meshgrid(m, m, m, indexing="ij"), axis=-1).reshape(-1, 3)
    k = k[(k != 0).any(axis=1)]
    waves = [np.exp(-1j * np.outer(m, places[:, c])) for c in range(3)]
    density = np.einsum("ap,bp,cp,p->abc", *waves, weights, optimize=True)[tuple(k.T + 9)]
    k2 = (k**2).sum(axis=1)
    push = np.cross(k, LOAD) / (
        2 if kind else np.sqrt(k2)[:, None]
    )  # a torque has half the curl of its density
    grown = (1 - np.exp(-NU * k2 * time)) / (NU * k2)
    return float((np.abs(density) ** 2 * (push**2).sum(axis=1) * grown).sum() / (2 * np.pi) ** 3)


@pytest.mark.parametrize("kind", [0, 1], ids=["forces", "torques"])
def test_the_exchange_of_smooth_loads_converges(kind, tmp_path):
    """With the order of the cubic interpolation, to that of Stokes' equations."""
    places, weights = cloud()
    loads = np.zeros((2, len(places), 3))
    loads[kind] = weights[:, None] * LOAD
    time, errors = STEPS * STEP, []
    expected = power_of_stokes(places, weights, kind, time)
    for cells in (12, 24):
        options = {
            "cells": cells,
            "steps": STEPS,
            "time_step": STEP,
            "viscosity": NU,
            "interpolation": "cubic",
        }
        case = fluid_at_rest(tmp_path / str(cells), len(places), application="boxFoam", **options)
        motion = driven(case, places, loads)[-1]
        motion[0] -= loads[0].sum(axis=0) * time / (2 * np.pi) ** 3
        errors.append(abs((loads * motion).sum() / expected - 1))
    assert errors[1] < 0.01
    assert errors[0] / errors[1] > 2**3.4


@pytest.mark.parametrize(
    ("application", "word", "speed"),
    [("boxFoam", "trilinear", 0.3), ("boxFoam", "cubic", 3.0), ("pimpleFoam", "cubic", 0.3)],
)
def test_a_dragged_bead_finds_what_is_taken_from_it(application, word, speed, tmp_path):
    """In the mean over eight beads and their places between cells, at a speed of so many ν/Δx: its own disturbance."""
    cells, steps = 16, 60
    cell = BOX / cells
    step = 0.05 * cell**2 / NU
    corners = np.array(
        [[1, 1, 1], [9, 9, 9], [9, 1, 1], [1, 9, 9], [1, 1, 9], [9, 9, 1], [1, 9, 1], [9, 1, 9]]
    )
    start = cell * (corners + np.random.default_rng(1).uniform(0, 1, (8, 3)))
    signs = np.array([1.0, -1, 1, -1, 1, -1, 1, -1])[:, None]  # together they do not move the fluid
    direction = signs * np.array([1.0, 0.3, 0.2]) / np.sqrt(1.13)
    loads = np.stack([1e-6 * direction, np.zeros((8, 3))])
    options = {"cells": cells, "steps": steps, "time_step": step, "viscosity": NU, "interpolation": word}
    case = fluid_at_rest(tmp_path / "case", 8, application=application, **options)
    velocity = speed * NU / cell * direction
    found = driven(case, start, loads, lambda n: start + n * step * velocity)[:, 0]
    mesh = Mesh(word, cell, BOX, 1 - 1 / cells, CENTRAL6)
    if application == "pimpleFoam":
        mesh = Mesh(word, cell, BOX, 1.0, CENTRAL2, face_values(case))
    own = OwnDisturbance(kernels(mesh, NU, 1.0), NU, 1e-6 / (speed * NU / cell), 8)
    taken = []
    for _ in range(steps + 1):
        taken.append(own.motion[:, 0])
        own.advance(*loads, step)
    along = [(np.array(u)[20:] * direction).sum(axis=2).mean() for u in (found, taken)]
    assert along[1] == pytest.approx(along[0], rel=0.06)
