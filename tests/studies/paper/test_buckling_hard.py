"""Hard fibers in cellular flow: coincident beads, stagnation points, extreme stiffness. Finite and exact in length."""

import numpy as np
import pytest

from gbm_plugin.fiber import Fibers
from gbm_plugin.studies.taylor_green import Run, Scene


def placed(scene: Scene, positions) -> Run:
    """A run from these positions (F, N, 3) instead of the scene's own."""
    run = Run(scene)
    run.stepper = scene.stepper(np.array(positions), 0.0)
    run._observe(run.stepper.positions)
    return run


def chain(angles, centre, length=0.4):
    """(1, N, 3) a planar chain with links at these angles about its centre."""
    links = np.stack([np.cos(angles), np.sin(angles), np.zeros(len(angles))], axis=-1)
    beads = length / (len(angles) + 1) * np.concatenate([np.zeros((1, 3)), np.cumsum(links, axis=0)])
    return (beads - beads.mean(axis=0) + centre)[None]


def assert_whole(run: Run) -> None:
    """Finite, and no link shorter or longer than 2a."""
    scene, positions = run.scene, run.stepper.positions
    lengths = np.linalg.norm(np.diff(positions, axis=1), axis=-1)
    np.testing.assert_allclose(lengths, scene.length / scene.beads, rtol=1e-12)


@pytest.mark.parametrize("sperm_number", [0.01, 1e10])
def test_extreme_sperm_numbers(sperm_number):
    """Nearly rigid fibers stay straight, to what the tolerance allows; nearly limp ones stay whole."""
    run = Run(Scene(sperm_number, count=16))
    run.advance(3.0)
    assert_whole(run)
    ends = np.linalg.norm(run.stepper.positions[:, -1] - run.stepper.positions[:, 0], axis=-1)
    if sperm_number < 1:
        np.testing.assert_allclose(ends / run.scene.contour("2a(N-1)"), 1, atol=1e-3)
    else:
        assert ends.min() < 0.8 * run.scene.contour("2a(N-1)")


@pytest.mark.parametrize("law", ["sine", "discreteRod"])
@pytest.mark.parametrize("mobility", ["rpy", "freeDrain"])
@pytest.mark.parametrize("integrator", ["ab3", "implicit"])
def test_coincident_beads(law, mobility, integrator):
    """A hairpin folded onto itself: beads 0 and 4, 1 and 3 in one place, where the sine law feels no moment."""
    folded = chain(np.array([0, 0, np.pi, np.pi]), [0.5, 0.5, 0.0])
    assert np.linalg.norm(folded[0, 0] - folded[0, 4]) < 1e-12
    scene = Scene(100.0, count=1, beads=5, mobility=mobility, curvature_law=law, integrator=integrator)
    run = placed(scene, folded)
    try:
        run.advance(0.5)
    except (FloatingPointError, ValueError) as error:
        # a fold of discrete rods has no finite moment, which one line may say
        assert law == "discreteRod" and "\n" not in str(error)
        return
    assert_whole(run)


@pytest.mark.parametrize("sperm_number", [10.0, 1e4])
def test_exactly_on_the_stagnation_point_along_the_compression_axis(sperm_number):
    """An equilibrium that is unstable above the threshold: by symmetry nothing pushes the fiber sideways."""
    run = placed(Scene(sperm_number, count=1), chain(np.full(5, np.pi / 2), [1.0, 1.0, 0.0]))
    run.advance(1.0)
    assert_whole(run)
    assert np.abs(run.stepper.positions.mean(axis=1) - [1, 1, 0]).max() < 1e-9
    if sperm_number < 15:  # only the turn grows, e^(1.8 S t) from rounding
        assert np.linalg.norm(run.stepper.fibers.links[0].sum(axis=0)) == pytest.approx(5)


def test_a_bent_hairpin_of_the_sine_law_is_reported_where_it_overlaps():
    folded = chain(np.array([0, 0, np.pi, np.pi]), [0.5, 0.5, 0.0])
    assert Fibers(folded, 1.0, 1.0).self_contacts[0] >= 2
