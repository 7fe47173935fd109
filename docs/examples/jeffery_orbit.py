"""A rigid fiber tumbles in simple shear with the period of a spheroid (Jeffery 1922): T = 2π (r + 1/r)/γ̇.

In free drain the chain of N beads has the aspect ratio r = sqrt((N² + 1)/2) for even N (rolling links, rigid limit).
"""

import numpy as np

from gbm_plugin import Fibers, simulate
from gbm_plugin.flow import LinearFlow

BEADS, SHEAR = 10, 1.0


def main() -> float:
    """The measured period over the theory's."""
    line = 0.1 * (np.arange(BEADS) - (BEADS - 1) / 2)
    positions = np.zeros((1, BEADS, 3))
    positions[0, :, 1] = line  # across the flow, where it turns fastest
    fiber = Fibers(positions, bending_stiffness=10.0, viscosity=1e-3)
    shear = LinearFlow(np.array([[0, SHEAR, 0], [0, 0, 0], [0, 0, 0]]))  # u = (γ̇ y, 0, 0)

    aspect = np.sqrt((BEADS**2 + 1) / 2)
    period = 2 * np.pi * (aspect + 1 / aspect) / SHEAR
    path = simulate(fiber, shear, 0.05, 0.6 * period, integrator="implicit", tolerance=1e-5, record_every=1)

    ends = path.positions[:, 0, -1] - path.positions[:, 0, 0]
    angle = np.unwrap(np.arctan2(ends[:, 0], ends[:, 1]))  # from the y axis; half a turn is half a period
    return 2 * np.interp(np.pi, angle, path.times) / period


if __name__ == "__main__":
    print(f"period over Jeffery's: {main():.4f}")
