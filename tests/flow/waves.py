"""A velocity field in closed form that changes with time, periodic in a box whose sides differ."""

import numpy as np

BOX = np.array([2.0, 3.0, 1.5])
ORIGIN = np.array([0.3, -1.0, 2.0])
CELLS = np.array([16, 24, 12])
RATE = 3.0
# waves per box, amplitude, phase
WAVES = [
    ((1, 0, 1), (0.3, -0.5, 0.2), 0.3),
    ((0, 2, 1), (-0.4, 0.1, 0.6), 1.1),
    ((2, -1, 0), (0.2, 0.5, -0.3), 2.0),
]


def exact(positions, time):
    """Velocity (..., 3), rotation (..., 3) and gradient (..., 3, 3), [..., i, j] = du_i/dx_j."""
    x = np.asarray(positions) - ORIGIN
    velocity, gradient = np.zeros(x.shape), np.zeros((*x.shape, 3))
    for number, (m, a, phase) in enumerate(WAVES):
        k, a = 2 * np.pi * np.array(m) / BOX, np.array(a)
        angle = x @ k + phase + RATE * (1 + 0.3 * number) * time
        velocity += np.sin(angle)[..., None] * a
        gradient += np.cos(angle)[..., None, None] * a[:, None] * k
    curl = [
        gradient[..., (c + 2) % 3, (c + 1) % 3] - gradient[..., (c + 1) % 3, (c + 2) % 3] for c in range(3)
    ]
    return velocity, 0.5 * np.stack(curl, -1), gradient


def nodes(cells, offset):
    """Where the values of a grid sit, (nx, ny, nz, 3)."""
    return ORIGIN + (np.moveaxis(np.indices(cells), 0, -1) + offset) * BOX / cells


def field(cells, offset, time):
    """The velocity (3, nx, ny, nz) on a grid."""
    return np.moveaxis(exact(nodes(cells, offset), time)[0], -1, 0)
