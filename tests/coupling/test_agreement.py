"""The same fibers whatever carries the messages and however the mesh is divided."""

from __future__ import annotations

import numpy as np
import pytest

from gbm_plugin.output.recording import open_recording

from conftest import divide, make_case, run_case

pytestmark = pytest.mark.openfoam

STEPS = 20
BOX = 2 * np.pi


def fibers_on_faces() -> np.ndarray:
    """Straight fibers whose beads lie on faces, edges and corners of cells, ranks and box, and one that
    crosses the corner of the box."""
    h, beads = BOX / 16, 6
    along = h * np.arange(beads)
    start = np.array([(0, 0, 0), (BOX - 2 * h, BOX, BOX / 2), (BOX / 2, BOX / 2, BOX / 2), (h, -h, BOX / 4)])
    direction = np.array([(1, 0, 0), (0, 1, 0), (0, 0, 1), (0, 0, -1.0)])
    fibers = start[:, None] + along[None, :, None] * direction[:, None]
    corner = BOX + (along - along.mean())[:, None] * np.ones(3) / np.sqrt(3)
    return np.concatenate([fibers, corner[None]])


FAMILIES = """
    seeded { count 12; beads 6; length 1.2; bendingStiffness 1e-4; seed 3; }
    placed { shape file; positions "constant/placed.npy"; bendingStiffness 1e-3; }
"""


def run(path, ranks: int = 1, division=None, **options):
    """Positions (S, B, 3) of all beads at every step."""
    options = {"steps": STEPS} | options
    make_case(path, families=FAMILIES, prepared=False, time_step=0.04, **options)
    np.save(path / "constant/placed.npy", fibers_on_faces())
    if ranks > 1:
        divide(path, ranks, division)
    run_case(path, *(["--parallel"] if ranks > 1 else []))
    with open_recording(path / "postProcessing/fibers") as recording:
        times = len(recording.steps)
        assert list(recording.steps) == list(range(options["steps"] + 1))
        families = [f.positions[:].reshape(times, -1, 3) for f in recording.families.values()]
    return np.concatenate(families, axis=1)


@pytest.fixture(scope="module")
def reference(tmp_path_factory):
    return run(tmp_path_factory.mktemp("reference") / "case")


def test_beads_cross_faces(reference):
    """Or the comparisons would say little: beads leave the box, and change halves and quarters of it."""
    cells = np.floor(reference / (BOX / 2)).astype(int)
    crossed = np.any(cells != cells[0], axis=0).any(axis=0)
    assert crossed.all()
    assert (reference.max() > BOX) and (reference.min() < 0)


@pytest.mark.parametrize("transport", ["tcp", "file"])
def test_transports_give_identical_fibers(tmp_path, reference, transport):
    np.testing.assert_array_equal(run(tmp_path / "case", transport=transport), reference)


@pytest.mark.parametrize("ranks", [2, 4])
def test_slabs_agree(tmp_path, reference, ranks):
    found = run(tmp_path / "case", ranks, (1, 1, ranks))
    assert np.abs(found - reference).max() < 1e-8


def test_blocks_agree(tmp_path):
    """Edges between ranks, in the solver that can be divided so."""
    options = {"application": "pimpleFoam", "steps": 2}
    whole, divided = run(tmp_path / "whole", **options), run(tmp_path / "divided", 4, (2, 2, 1), **options)
    assert np.abs(divided - whole).max() < 1e-8


def test_a_rank_without_beads(tmp_path):
    """One fiber in the lowest of four slabs."""
    family = 'one { shape file; positions "constant/one.npy"; bendingStiffness 1e-3; }'
    fiber = np.zeros((1, 4, 3)) + 0.3
    fiber[0, :, 0] += 0.2 * np.arange(4)
    results = []
    for name, ranks in (("serial", 1), ("parallel", 4)):
        path = make_case(tmp_path / name, steps=5, families=family, prepared=False)
        np.save(path / "constant/one.npy", fiber)
        if ranks > 1:
            divide(path, ranks, (1, 1, 4))
        run_case(path, *(["--parallel"] if ranks > 1 else []))
        with open_recording(path / "postProcessing/fibers") as recording:
            results.append(recording.families["one"].positions[:])
    assert np.ptp(results[0][-1, 0, :, 2]) > 0
    assert results[0][..., 2].max() < BOX / 4  # it stays in the first slab
    assert np.abs(results[1] - results[0]).max() < 1e-8
