"""Ambient strain felt through the neighbours: leading-order stresslets of rigid spheres (with mobility rpy).

A sphere in the strain E disturbs the flow as a stresslet (20/3)πμa³E; the others are carried by its field,
averaged over their surfaces (Faxén; Zuk, Wajnryb, Mizerski & Szymczak 2014). With x from the source,
lengths in a,

    u = α E·x + γ x (x·E·x)/r²,    ω = g (E·x) × x/r²,
    r > 2:  α = −8/3 r⁻⁵,        γ = −5/2 r⁻³ + 20/3 r⁻⁵,    g = −5/2 r⁻³,
    r < 2:  α = −1/2 + 5/24 r,   γ = −5/96 r,                g = −15/32 r + 5/64 r³.
"""

import numpy as np

from ..compiled import kernel, only_read, part_of
from ..sampling import rotation_of
from ..threads import in_shares


@kernel
def _disturb(share, shares, positions, strain, radius, velocity, rotation):
    count, beads = positions.shape[:2]
    begin, end = part_of(share, shares, count)
    for f in range(begin, end):
        for i in range(beads):
            for j in range(beads):
                if i == j:
                    continue
                x = (
                    (positions[f, i, 0] - positions[f, j, 0]) / radius,
                    (positions[f, i, 1] - positions[f, j, 1]) / radius,
                    (positions[f, i, 2] - positions[f, j, 2]) / radius,
                )
                square = x[0] ** 2 + x[1] ** 2 + x[2] ** 2
                r = np.sqrt(square)
                if r > 2.0:
                    alpha = -8 / 3 / r**5
                    gamma = (-2.5 / r**3 + 20 / 3 / r**5) / square
                    turn = -2.5 / r**5
                else:
                    alpha = -0.5 + 5 / 24 * r
                    gamma = -5 / 96 / max(r, 1e-300)
                    turn = -15 / 32 / max(r, 1e-300) + 5 / 64 * r
                e = strain[f, j]
                s0 = e[0, 0] * x[0] + e[0, 1] * x[1] + e[0, 2] * x[2]
                s1 = e[1, 0] * x[0] + e[1, 1] * x[1] + e[1, 2] * x[2]
                s2 = e[2, 0] * x[0] + e[2, 1] * x[1] + e[2, 2] * x[2]
                stretch = gamma * (s0 * x[0] + s1 * x[1] + s2 * x[2])
                velocity[f, i, 0] += radius * (alpha * s0 + stretch * x[0])
                velocity[f, i, 1] += radius * (alpha * s1 + stretch * x[1])
                velocity[f, i, 2] += radius * (alpha * s2 + stretch * x[2])
                rotation[f, i, 0] += turn * (s1 * x[2] - s2 * x[1])
                rotation[f, i, 1] += turn * (s2 * x[0] - s0 * x[2])
                rotation[f, i, 2] += turn * (s0 * x[1] - s1 * x[0])


def with_strain(positions, velocity, gradient, radius):
    """Velocity and rotation (F, N, 3) that carry each bead: the ambient ones plus what the others'
    stresslets add.

    gradient: (F, N, 3, 3), [..., i, j] = du_i/dx_j, at the beads.
    """
    transpose = np.swapaxes(gradient, -1, -2)
    strain = only_read(0.5 * (gradient + transpose))
    velocity, rotation = (
        np.array(field, dtype=float, order="C") for field in (velocity, rotation_of(gradient))
    )
    in_shares(_disturb, velocity.size / 3, only_read(positions), strain, radius, velocity, rotation)
    return velocity, rotation
