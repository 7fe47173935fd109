"""What a flow gives at points, in the words that all flows and all who ask share."""

from __future__ import annotations

import math
from collections.abc import Iterable
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

# of a sample: the velocity, and what is needed beside it
NUMBERS = {"velocity": 3, "rotation": 6, "gradient": 12}
NEEDS = tuple(NUMBERS)  # each costs more than the one before


class FlowEnded(ValueError):
    """The flow is not known at a time; until: the last at which it is."""

    def __init__(self, message: str, until: float | None = None):
        super().__init__(message)
        self.until = until


class Flow(Protocol):
    """Anything that carries fibers.

    A flow that is known at times of its own only, and cannot go back, has `sample_interval`, the time between them;
    one that is known in a part of space only has `inside(positions) -> (...,)`.
    """

    def sample(self, positions: NDArray, time: float, need: str) -> tuple[NDArray, NDArray | None]:
        """Velocity (..., 3) at positions (..., 3), and beside it what need asks for: "velocity" (None), "rotation"
        (½∇×u, (..., 3)) or "gradient" ((..., 3, 3), [..., i, j] = du_i/dx_j)."""


def one_of(name: str, word: str, allowed: Iterable[str]) -> str:
    """word, if it is allowed; else ValueError."""
    if word not in allowed:
        raise ValueError(f"{name} is {word!r}; allowed are {', '.join(allowed)}")
    return word


def rotation_of(gradient: NDArray) -> NDArray:
    """½∇×u (..., 3) of a gradient (..., 3, 3), [..., i, j] = du_i/dx_j."""
    g = gradient
    curl = (
        g[..., 2, 1] - g[..., 1, 2],
        g[..., 0, 2] - g[..., 2, 0],
        g[..., 1, 0] - g[..., 0, 1],
    )
    return 0.5 * np.stack(curl, axis=-1)


def gradient_of(rotation: NDArray) -> NDArray:
    """The gradient (..., 3, 3) of a solid that turns at (..., 3): what `rotation_of` takes it from."""
    x, y, z = np.moveaxis(rotation, -1, 0)
    none = np.zeros_like(x)
    return np.stack([none, -z, y, z, none, -x, -y, x, none], axis=-1).reshape(*x.shape, 3, 3)


def lagrange_weights(times: Iterable[float], time: float) -> NDArray:
    """Weights of values at the given times in their interpolating polynomial at one time."""
    nodes = [float(own) for own in times]
    others = [nodes[:j] + nodes[j + 1 :] for j in range(len(nodes))]
    return np.array(
        [math.prod((time - t) / (own - t) for t in rest) for own, rest in zip(nodes, others, strict=True)]
    )
