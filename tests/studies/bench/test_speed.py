"""The study of speed: its fields at a solver's points, and the cost at equal error of two power laws."""

from __future__ import annotations

import numpy as np
import pytest

from gbm_plugin.studies.bench import speed


def waves(n: int, offset: float) -> np.ndarray:
    x = (np.arange(n) + offset) * 2 * np.pi / n
    x, y, z = np.meshgrid(x, x, x, indexing="ij")
    return np.stack([np.sin(5 * x + y) + 0.3, np.cos(4 * y - z), np.sin(2 * z) * np.cos(x)])


@pytest.mark.parametrize("cells, offset", [(24, 0.0), (18, 0.5), (8, 0.5)])
def test_fields_at_other_points_are_exact(cells, offset):
    """Also where the points are too few for the waves."""
    np.testing.assert_allclose(speed.at_points(waves(16, 0), cells, offset), waves(cells, offset), atol=1e-13)


def test_what_a_mesh_cannot_hold_is_left_out():
    x = waves(16, 0)
    np.testing.assert_allclose(speed.resolved(x, 12), x, atol=1e-13)
    left = speed.resolved(x, 8)  # without the waves 5 and 4
    np.testing.assert_allclose(left[0], 0.3, atol=1e-13)
    np.testing.assert_allclose(left[1], 0, atol=1e-13)
    np.testing.assert_allclose(left[2], x[2], atol=1e-13)


def test_a_run_that_would_take_too_long_is_judged_by_coarser_ones():
    """Errors n^-2 and times n^4: 16 times as long on twice the cells."""
    coarser = [
        {"cells": n, "velocity_error": 9 / n**2, "processor_seconds": 1e-6 * n**4} for n in (30, 40, 50)
    ]
    assert speed.too_long(coarser, 100, 99) and not speed.too_long(coarser, 100, 101)
    assert not speed.too_long(coarser[:1], 100, 1)
    assert speed.on_their_line(coarser, 100) == pytest.approx(9e-4)


def test_cost_at_equal_error():
    """boxFoam: cost error^(-1/2); at the error 1e-2 it is 10."""
    box = [{"solver": "boxFoam", "velocity_error": e, "processor_seconds": e**-0.5} for e in (1e-1, 1e-3)]
    other = {"solver": "other", "velocity_error": 1e-2, "processor_seconds": 500.0}
    assert speed.over_box(other, [*box, other]) == (pytest.approx(50), False)
    coarse = other | {"velocity_error": 0.5}
    assert speed.over_box(coarse, box) == (pytest.approx(500 / 10**0.5), True)
    assert np.isnan(speed.over_box(other | {"velocity_error": 1e-4}, box)[0])
