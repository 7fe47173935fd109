"""Positions from a file: single precision is enough, and what no run could take is refused where it is read."""

from __future__ import annotations

import numpy as np
import pytest

from gbm_plugin.case.positions import read_positions
from gbm_plugin.case.scene import read_scene
from gbm_plugin.errors import CaseError
from gbm_plugin.fiber import Fibers

from conftest import HEADER, make_case


def straight(count: int = 3, beads: int = 10, diameter: float = 0.2, offset: float = 5.0) -> np.ndarray:
    x = np.zeros((count, beads, 3))
    x[:, :, 0] = diameter * np.arange(beads) + offset
    x[:, :, 1] = np.arange(count)[:, None]
    return x


@pytest.mark.parametrize("dtype", ["f8", "f4", ">f8", ">f4"])
@pytest.mark.parametrize("order", ["C", "F"])
def test_precisions_and_orders(tmp_path, dtype, order):
    """Fibers demand spacings equal to 1e-6, which single precision does not have at x = 5, 2a = 0.2."""
    np.save(tmp_path / "p.npy", np.asarray(straight(), dtype=dtype, order=order))
    x = read_positions(tmp_path / "p.npy")
    fibers = Fibers(x, 1.0, 1.0)
    np.testing.assert_allclose(fibers.positions, straight(), atol=2e-6)


def test_double_precision_is_taken_to_the_bit(tmp_path):
    np.save(tmp_path / "p.npy", straight())
    np.testing.assert_array_equal(read_positions(tmp_path / "p.npy"), straight())


def bent(x: np.ndarray) -> np.ndarray:
    x[1, 4:, 0] += 0.01
    return x


REFUSED = {
    "no fiber": (np.zeros((0, 10, 3)), r"shape \(0, 10, 3\)"),
    "one bead": (np.zeros((2, 1, 3)), r"shape \(2, 1, 3\)"),
    "flat": (np.zeros((4, 3)), r"shape \(4, 3\).*\(fibers, beads, 3\)"),
    "one point": (np.zeros((2, 5, 3)), "in one point"),
    "NaN": (straight() * np.array([[[1]], [[np.nan]], [[1]]]), "not finite in fiber 1"),
    "uneven": (bent(straight()), "beads 3, 4 of fiber 1 are 0.21"),
    "uneven in single precision": (bent(straight()).astype("f4"), "beads 3, 4 of fiber 1 are 0.21"),
    "complex": (straight().astype(complex), "real numbers"),
    "objects": (np.array([[[{}]]], dtype=object), "cannot be read"),
    "text": (np.array([["a"]]), "real numbers"),
}


@pytest.mark.parametrize("what", REFUSED)
def test_refused_where_the_case_is_read(what, tmp_path):
    array, expected = REFUSED[what]
    case = make_case(tmp_path / "case", prepared=False)
    np.save(case / "p.npy", array, allow_pickle=True)
    text = "families { a { shape file; positions p.npy; bendingStiffness 1e-5; } }"
    (case / "constant/fiberProperties").write_text(HEADER + text)
    with pytest.raises(CaseError, match=f"'positions'.*p.npy.*{expected}"):
        read_scene(case)


@pytest.mark.parametrize("content", [b"", b"no numpy", None, "npz"])
def test_files_that_hold_no_array(content, tmp_path):
    path = tmp_path / "p.npy"
    if content is None:
        path.mkdir()
    elif content == "npz":
        with path.open("wb") as file:
            np.savez(file, x=straight())
    else:
        path.write_bytes(content)
    with pytest.raises(ValueError, match=r"cannot be read|one array"):
        read_positions(path)
