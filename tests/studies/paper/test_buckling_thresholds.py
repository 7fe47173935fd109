"""The dense eigenvalue problem against the continuum's values and against the kernels."""

import numpy as np
import pytest

from gbm_plugin.fiber import Fibers, instant_rates
from gbm_plugin.flow import TaylorGreen
from gbm_plugin.studies.paper.buckling_thresholds import growth, link_matrices, link_spins, threshold

CONTINUUM = np.array([123.5, 510.14]) / (3 * np.pi)  # of Sp, free drain: compression_buckling_isotropic_drag


def test_long_chains_have_the_thresholds_of_the_continuum():
    errors = []
    for beads in (10, 20):
        matrices = link_matrices(beads, "freeDrain")
        errors.append(np.abs(np.array([threshold(matrices, k) for k in (1, 2)]) / CONTINUUM - 1))
    assert (errors[1] < 6e-3).all() and (errors[1] < errors[0]).all()


def test_a_stiff_chain_turns_as_a_spheroid():
    """At Sp → 0 nothing grows but the turn out of the compression axis, at 2S (r² − 1)/(r² + 1), r² = (N² + 1)/2 in
    free drain (jeffery_free_drain)."""
    even, odd = growth(link_matrices(6, "freeDrain"), 1e-3)
    assert even[0] < 0 and odd[1] < 0
    square = (6**2 + 1) / 2
    assert odd[0] == pytest.approx(2 * (square - 1) / (square + 1), rel=1e-4)


@pytest.mark.parametrize("kind", ["freeDrain", "rpy"])
def test_spins_are_those_of_the_kernels(kind):
    """Two programs of the same equations, for a bent chain anywhere in the cellular flow."""
    random = np.random.default_rng(4)
    angle = np.cumsum(random.uniform(-0.4, 0.4, 5))
    links = np.stack([np.cos(angle), np.sin(angle), np.zeros(5)], axis=-1)
    radius, stiffness, flow = 0.4 / 12, 0.02, TaylorGreen(1.0, 1.0)
    beads = np.concatenate([np.zeros((1, 3)), np.cumsum(2 * radius * links, axis=0)])
    beads -= beads.mean(axis=0)
    fibers = Fibers(beads[None], stiffness, 1.0)
    velocity, spin = flow.sample(fibers.positions, 0.0, "rotation")
    spins = instant_rates(fibers, velocity, spin, kind)[0][0, :, 2]
    np.testing.assert_allclose(link_spins(links, radius, stiffness, flow, kind), spins, rtol=1e-9)
