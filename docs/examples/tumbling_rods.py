"""Rods that are short against the smallest eddies, with random directions in forced isotropic turbulence.

Before they have aligned with the flow, <ṗ²> ν/ε = 1/6 + Λ²/10, whatever the Reynolds number, with Λ = (r² - 1)/(r² + 1)
and r² = (N² + 1)/2 for a chain of N beads; 4/15 for slender rods.
"""

import numpy as np

from gbm_plugin import Fibers, simulate
from gbm_plugin.spectral import EswaranPope, SpectralSolver

CELLS, VISCOSITY, RODS, BEADS, STEP = 32, 0.01, 20000, 3, 5e-3


def main() -> float:
    """<ṗ²> ν/ε of new rods in a developed flow, over the theory's."""
    forcing = EswaranPope(variance=2e-4, time_scale=2.0, cutoff=2.9, seed=1)
    flow = SpectralSolver(CELLS, VISCOSITY, forcing=forcing, time_step=0.02)
    flow.set_velocity(np.zeros((3, CELLS, CELLS, CELLS)))
    flow.advance(1000)  # from rest

    rods = Fibers.straight(
        RODS, BEADS, 0.01, bending_stiffness=1e-8, viscosity=VISCOSITY, box=2 * np.pi, seed=1
    )
    frozen = SpectralSolver(CELLS, VISCOSITY, time_step=STEP, interpolation="exact")
    frozen.set_velocity(flow.velocity)
    path = simulate(rods, frozen, STEP, STEP, integrator="ab3")

    before, after = rods.end_to_end, path.positions[-1, :, -1] - path.positions[-1, :, 0]
    rate = (after - before) / np.linalg.norm(before, axis=1, keepdims=True) / STEP
    tumbling = np.mean(np.sum(rate**2, axis=1)) * VISCOSITY / flow.statistics()["dissipation"]
    shape = (BEADS**2 - 1) / (BEADS**2 + 3)
    return tumbling / (1 / 6 + shape**2 / 10)


if __name__ == "__main__":
    print(f"<ṗ²> ν/ε over theory: {main():.3f}")
