"""Shapes, flows and an independent dense solution that the fiber tests share."""

import numpy as np

from gbm_plugin.fiber import Stepper


def positions_of(links, diameter):
    """(F, N, 3) bead centres about the origin from any link directions (F, N−1, 3)."""
    links = links / np.linalg.norm(links, axis=2, keepdims=True)
    start = np.zeros((len(links), 1, 3))
    beads = np.concatenate([start, np.cumsum(diameter * links, axis=1)], axis=1)
    return beads - beads.mean(axis=1, keepdims=True)


def bent(count, beads, diameter, bend=0.3, seed=0):
    """Smoothly bent, out-of-plane random shapes."""
    random = np.random.default_rng(seed)
    steps = bend * random.standard_normal((count, beads - 1, 3))
    return positions_of(np.cumsum(steps, axis=1) + random.standard_normal((count, 1, 3)), diameter)


def crooked(count, beads, diameter, seed=0):
    """Kinked random walks, strongly bent in 3D."""
    random = np.random.default_rng(seed)
    return positions_of(np.cumsum(random.standard_normal((count, beads - 1, 3)), axis=1), diameter)


def straight_chain(beads, diameter, direction=(1, 0, 0)):
    """One straight fiber about the origin."""
    return positions_of(np.broadcast_to(np.asarray(direction, float), (1, beads - 1, 3)), diameter)


class WavyFlow:
    """Unsteady, three-dimensional, divergence-free."""

    def sample(self, x, t, need):
        """Velocity and rotation of u = (sin(y+t) + 0.3 cos(2z−t), cos(z+2t), sin(x−t))."""
        u = np.sin(x[..., 1] + t) + 0.3 * np.cos(2 * x[..., 2] - t)
        velocity = np.stack([u, np.cos(x[..., 2] + 2 * t), np.sin(x[..., 0] - t)], axis=-1)
        curl_y = -0.6 * np.sin(2 * x[..., 2] - t) - np.cos(x[..., 0] - t)
        curl = np.stack([np.sin(x[..., 2] + 2 * t), curl_y, -np.cos(x[..., 1] + t)], axis=-1)
        return velocity, 0.5 * curl


def run_once_per_step(fibers, flow, step, steps, **options):
    """A coupled run: one flow sample per step, the first two steps corrected. The stepper at the end."""
    stepper = Stepper(fibers, **options)

    def sample():
        stepper.observe(stepper.time, *flow.sample(stepper.positions, stepper.time, stepper.need))

    sample()
    for _ in range(steps):
        stepper.advance(step)
        while stepper.provisional:
            sample()
            stepper.correct()
        sample()
    return stepper


def skew(v):
    """Matrix of v ×."""
    return np.array([[0, -v[2], v[1]], [v[2], 0, -v[0]], [-v[1], v[0], 0]])


def rpy_matrix(x, a, viscosity):
    """Dense RPY mobility (6N, 6N): velocities and rotations of beads at x from forces and torques."""
    n = len(x)
    matrix = np.zeros((6 * n, 6 * n))
    for i in range(n):
        for j in range(n):
            d = x[i] - x[j]
            r = np.linalg.norm(d)
            e = d / r if r > 0 else np.array([1.0, 0, 0])
            ee, one = np.outer(e, e), np.eye(3)
            if r > 2 * a:
                tt = ((1 + 2 * a**2 / (3 * r**2)) * one + (1 - 2 * a**2 / r**2) * ee) / (
                    8 * np.pi * viscosity * r
                )
                rr = (3 * ee - one) / (16 * np.pi * viscosity * r**3)
                tr = 1 / (8 * np.pi * viscosity * r**2)
            else:
                tt = ((1 - 9 * r / (32 * a)) * one + 3 * r / (32 * a) * ee) / (6 * np.pi * viscosity * a)
                rr = (1 - 27 * r / (32 * a) + 5 * r**3 / (64 * a**3)) * one
                rr = (rr + (9 * r / (32 * a) - 3 * r**3 / (64 * a**3)) * ee) / (8 * np.pi * viscosity * a**3)
                tr = r * (1 - 3 * r / (8 * a)) / (16 * np.pi * viscosity * a**3)
            rows, columns = slice(3 * i, 3 * i + 3), slice(3 * j, 3 * j + 3)
            spins, torques = slice(3 * (n + i), 3 * (n + i) + 3), slice(3 * (n + j), 3 * (n + j) + 3)
            matrix[rows, columns], matrix[spins, torques] = tt, rr
            matrix[rows, torques] = matrix[spins, columns] = -tr * skew(e)
    return matrix


def dense_solution(fibers, fiber, velocity, rotation, mobility="freeDrain"):
    """Bead velocities, rotations and contact forces of one fiber from the full 6N system."""
    x, e = fibers.positions[fiber], fibers.links[fiber]
    n, a, mu = fibers.beads, fibers.radius, fibers.viscosity
    rolling = np.zeros((3 * (n - 1), 6 * n))
    for i in range(n - 1):
        rows, arm = slice(3 * i, 3 * i + 3), -a * skew(e[i])
        rolling[rows, 3 * i : 3 * i + 6] = np.hstack([np.eye(3), -np.eye(3)])
        rolling[rows, 3 * (n + i) : 3 * (n + i) + 6] = np.hstack([arm, arm])
    moments = np.zeros((n + 2, 3))
    for j in range(1, n - 1):
        t, u = e[j - 1], e[j]
        law = 1.0 if fibers.curvature_law == "sine" else 2 / (1 + t @ u)
        moments[j + 1] = fibers.bending_stiffness[fiber] / (2 * a) * law * np.cross(t, u)
    torque = moments[2:] - moments[:-2]
    torque = torque * (0.5 if fibers.bending_torque == "consistent" else 1.0)
    if mobility == "rpy":
        matrix = rpy_matrix(x, a, mu)
    else:
        drag = np.r_[np.full(3 * n, 6 * np.pi * mu * a), np.full(3 * n, 8 * np.pi * mu * a**3)]
        matrix = np.diag(1 / drag)
    loads = np.r_[np.zeros(3 * n), torque.ravel()]
    motion = np.r_[velocity.ravel(), rotation.ravel()] + matrix @ loads
    forces = np.linalg.solve(rolling @ matrix @ rolling.T, -rolling @ motion)
    motion = motion + matrix @ (rolling.T @ forces)
    return motion[: 3 * n].reshape(n, 3), motion[3 * n :].reshape(n, 3), forces.reshape(-1, 3)
