"""Thresholds of buckling: the dense eigenvalue problem of a straight chain in compression, apart from the kernels.

The chain lies along the compression axis of u = S(x, −y) with its centre at the stagnation point, or in the same
place of the cellular flow. Links tilted by φ (N−1) turn at dφ/dt = Aφ. A has the symmetry of the chain: odd φ are
even shapes, of which the first to grow is the U of the first threshold, even φ odd shapes, the S of the second;
the slowest of the even φ is the rotation of the whole chain, which grows at any Sp. A threshold is the Sp at which
one more eigenvalue passes zero. Everything is written down from the equations (rolling contact as constraints on
a 6N × 6N mobility), with A by central differences.
"""

from __future__ import annotations

import argparse
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from ...flow import LinearFlow, TaylorGreen
from ..study import option, steps

LENGTH = 0.4  # of the chain over W
FLOWS = ("linear", "cellular")
TILT = 1e-5  # of a link, for differences


def mobility_matrix(positions: NDArray, radius: float, kind: str) -> NDArray:
    """(6N, 6N) velocities and spins from forces and torques for μ = 1: "freeDrain", or "rpy" of Wajnryb et al.
    (2013), for beads (N, 3) that do not overlap."""
    count = len(positions)
    matrix = np.zeros((6 * count, 6 * count))
    levi = np.zeros((3, 3, 3))
    levi[[0, 1, 2], [1, 2, 0], [2, 0, 1]], levi[[0, 1, 2], [2, 0, 1], [1, 2, 0]] = 1, -1
    for i in range(count):
        for j in range(count):
            v, w = slice(3 * i, 3 * i + 3), slice(3 * (count + i), 3 * (count + i) + 3)
            f, t = slice(3 * j, 3 * j + 3), slice(3 * (count + j), 3 * (count + j) + 3)
            if i == j:
                matrix[v, f] = np.eye(3) / (6 * np.pi * radius)
                matrix[w, t] = np.eye(3) / (8 * np.pi * radius**3)
            elif kind == "rpy":
                apart = positions[i] - positions[j]
                r = np.linalg.norm(apart)
                n = apart / r
                outer, ratio = np.outer(n, n), (radius / r) ** 2
                near, along = 1 + 2 / 3 * ratio, 1 - 2 * ratio
                matrix[v, f] = (near * np.eye(3) + along * outer) / (8 * np.pi * r)
                matrix[w, t] = (3 * outer - np.eye(3)) / (16 * np.pi * r**3)
                turn = np.einsum("abc,c->ab", levi, n) / (8 * np.pi * r**2)  # T × n and F × n
                matrix[v, t] = matrix[w, f] = turn
    return matrix


def link_spins(links: NDArray, radius: float, stiffness: float, flow, kind: str) -> NDArray:
    """(N−1,) spins about z of links (N−1, 3) of a planar chain with its centre at the origin."""
    count = len(links) + 1
    beads = np.concatenate([np.zeros((1, 3)), np.cumsum(2 * radius * links, axis=0)])
    beads -= beads.mean(axis=0)
    velocity, spin = flow.sample(beads, 0.0, "rotation")
    moments = np.zeros((count + 2, 3))  # one more before and behind
    moments[2:-2] = stiffness / (2 * radius) * np.cross(links[:-1], links[1:])
    torques = 0.5 * (moments[2:] - moments[:-2])
    constraints = np.zeros((3 * (count - 1), 6 * count))
    for k, e in enumerate(links):
        row = slice(3 * k, 3 * k + 3)
        arm = radius * np.array([[0, -e[2], e[1]], [e[2], 0, -e[0]], [-e[1], e[0], 0]])
        for bead, sign in ((k, 1), (k + 1, -1)):
            constraints[row, 3 * bead : 3 * bead + 3] = sign * np.eye(3)
            constraints[row, 3 * (count + bead) : 3 * (count + bead) + 3] = -arm
    matrix = mobility_matrix(beads, radius, kind)
    free = np.concatenate([velocity.ravel(), spin.ravel()])
    free += matrix @ np.concatenate([np.zeros(3 * count), torques.ravel()])
    multipliers = np.linalg.solve(constraints @ matrix @ constraints.T, -constraints @ free)
    motion = free + matrix @ constraints.T @ multipliers
    spins = motion[3 * count :].reshape(count, 3)[:, 2]
    return 0.5 * (spins[1:] + spins[:-1])


def link_matrices(beads: int, kind: str, flow: str = "linear") -> tuple[NDArray, NDArray]:
    """B, C (N−1, N−1) of A/S = B + C/Sp, for a chain of length 2aN = LENGTH × W."""
    carrier = TaylorGreen(1.0, 1.0) if flow == "cellular" else LinearFlow(np.diag([np.pi, -np.pi, 0.0]))
    rigid, soft = (_differences(beads, kind, carrier, stiffness) for stiffness in (1.0, 0.0))
    return soft / np.pi, (rigid - soft) * LENGTH**4


def _differences(beads: int, kind: str, carrier, stiffness: float) -> NDArray:
    """A by central differences."""
    count = beads - 1
    matrix = np.zeros((count, count))
    for k in range(count):
        for sign in (1, -1):
            angle = np.full(count, np.pi / 2)
            angle[k] += sign * TILT
            links = np.stack([np.cos(angle), np.sin(angle), np.zeros(count)], axis=-1)
            matrix[:, k] += (
                sign * link_spins(links, LENGTH / beads / 2, stiffness, carrier, kind) / (2 * TILT)
            )
    return matrix


def growth(matrices: tuple[NDArray, NDArray], sperm_number: float) -> tuple[NDArray, NDArray]:
    """Growth rates over S, of even shapes and of odd ones, each falling."""
    matrix = matrices[0] + matrices[1] / sperm_number
    half = len(matrix) // 2
    flipped, middle = matrix[:, ::-1], half + len(matrix) % 2
    odd = (matrix - flipped)[:half, :half]  # of link angles that change their sign at the middle
    even = (matrix + flipped)[:middle, :middle]
    even[:, half:] /= 2  # a middle link is its own mirror image
    return _falling(odd), _falling(even)


def _falling(matrix: NDArray) -> NDArray:
    return np.sort(np.linalg.eigvals(matrix).real)[::-1]


def threshold(matrices: tuple[NDArray, NDArray], number: int) -> float:
    """Sp at which the first shape (1), or the second (2), begins to grow: the first even rate vanishes, or the
    second odd one."""
    low, high = 1.0, 1e4
    for _ in range(60):
        middle = np.sqrt(low * high)
        even, odd = growth(matrices, middle)
        low, high = (low, middle) if (even[0] if number == 1 else odd[1]) > 0 else (middle, high)
    return float(np.sqrt(low * high))


def add_arguments(parser: argparse.ArgumentParser) -> None:
    option(parser, run, "beads", "of the chains, each of length 2aN")


def run(beads: Sequence[int] = (6, 12, 20)) -> dict:
    """The first two thresholds of each chain, mobility and flow, and the rate of the U far above them."""
    cases = [(n, kind, flow) for n in beads for kind in ("freeDrain", "rpy") for flow in FLOWS]
    found = []
    for n, kind, flow in steps(cases, len(cases), "thresholds"):
        matrices = link_matrices(n, kind, flow)
        row = {"beads": n, "mobility": kind, "flow": flow}
        row |= {f"threshold_{k}": threshold(matrices, k) for k in (1, 2)}
        found.append(row | {"growth_at_450": float(growth(matrices, 450.0)[0][0])})
    return {"rows": found}


def rows(result: dict) -> list[dict]:
    """The lines of a CSV file."""
    return result["rows"]


def table(result: dict) -> str:
    """The thresholds as text."""
    lines = ["beads  mobility    flow       first Sp  second Sp  growth of the U at Sp = 450, over S"]
    for r in result["rows"]:
        lines.append(
            f"{r['beads']:5d}  {r['mobility']:10}  {r['flow']:8} {r['threshold_1']:10.3f} {r['threshold_2']:10.3f}"
            f" {r['growth_at_450']:10.3f}"
        )
    return "\n".join(lines)
