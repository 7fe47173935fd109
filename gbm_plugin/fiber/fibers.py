"""A family of fibers: what it is made of, where its beads are, and what can be read off its shape."""

from __future__ import annotations

from copy import copy
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from .bending import bending_energy
from .contact import self_contacts
from .model import FiberOptions

TOUCHING = 1e-6  # largest relative difference of a bead spacing from 2a
FASTEST = 1e200  # largest bending rate K/μd⁴ [1/time] that numbers can hold with all that is made of it


def finite_array(name: str, value: ArrayLike, shape_text: str, dimensions: int) -> np.ndarray:
    """value as a float64 array of so many dimensions, the last 3, and finite; else ValueError."""
    array = np.array(value, dtype=float)
    if array.ndim != dimensions or array.shape[-1] != 3:
        raise ValueError(f"{name} has shape {array.shape}; it must be {shape_text}")
    if not np.isfinite(array).all():
        raise ValueError(f"{name} contains NaN or infinite values; all must be finite")
    return array


def positive(name: str, value: float, zero: bool = False) -> float:
    """value as a float, if it is finite and positive (or zero where allowed); else ValueError."""
    number = float(value)
    if not np.isfinite(number) or number < 0 or (number == 0 and not zero):
        raise ValueError(f"{name} is {value}; it must be finite and {'not negative' if zero else 'positive'}")
    return number


class Fibers:
    """Inextensible elastic fibers of equal bead number and radius (Gears Bead Model, section 2.1).

    positions: (F, N, 3) bead centres, unwrapped, neighbours one diameter 2a apart (to 1e-6; the state then
    holds the centre of mass and unit links, so that the length is exact). bending_stiffness: K^b, force ×
    area, one number or (F,); None if young_modulus E is given instead, K^b = E π d⁴/64 (eq. 10). viscosity:
    dynamic, μ. bending_torque: "consistent" (energy-consistent) or "asPrinted" (eq. 6, twice as stiff).
    curvature_law: "sine" (eq. 4), whose torque weakens beyond 90° between links and vanishes at a fold, which it does
    not hold open, or "discreteRod" (tan(θ/2)/a), which resists up to the fold; exactly there neither has a direction.
    Raises ValueError on anything else.
    """

    def __init__(
        self,
        positions: ArrayLike,
        bending_stiffness: ArrayLike | None,
        viscosity: float,
        bending_torque: str = "consistent",
        curvature_law: str = "sine",
        young_modulus: ArrayLike | None = None,
    ):
        beads = finite_array("positions", positions, "(fibers, beads, 3)", 3)
        if beads.shape[0] < 1 or beads.shape[1] < 2:
            raise ValueError(f"positions has shape {beads.shape}; at least one fiber of two beads is needed")
        bonds = np.diff(beads, axis=1)
        spacing = np.linalg.norm(bonds, axis=2)
        diameter = spacing.mean()
        apart = np.abs(spacing / diameter - 1).max() if diameter > 0 else np.inf
        if apart > TOUCHING:
            raise ValueError(
                f"neighbouring beads are between {spacing.min():g} and {spacing.max():g} apart; "
                "they must touch, all spacings equal to one diameter"
            )
        self.radius = diameter / 2
        self.viscosity = positive("viscosity", viscosity)
        material = FiberOptions(bending_torque, curvature_law)
        self.bending_torque, self.curvature_law = material.bending_torque, material.curvature_law
        self.centres = beads.mean(axis=1)
        self.links = bonds / spacing[..., None]
        self.bending_stiffness = self._stiffness(bending_stiffness, young_modulus)

    def _stiffness(self, bending_stiffness: ArrayLike | None, young_modulus: ArrayLike | None) -> NDArray:
        if (bending_stiffness is None) == (young_modulus is None):
            raise ValueError("bending_stiffness and young_modulus: exactly one of them must be given")
        if bending_stiffness is None:
            value = np.asarray(young_modulus, dtype=float) * np.pi * (2 * self.radius) ** 4 / 64
        else:
            value = np.asarray(bending_stiffness, dtype=float)
        if value.shape not in ((), (self.count,)):
            raise ValueError(f"stiffness has shape {value.shape}; it must be one number or ({self.count},)")
        if not np.isfinite(value).all() or (value < 0).any():
            raise ValueError(f"stiffness is {value}; it must be finite and not negative")
        if value.max() > FASTEST * self.viscosity * (2 * self.radius) ** 4:
            raise ValueError(f"stiffness is {value}: more than {FASTEST:g} times μd⁴ cannot be computed with")
        return np.broadcast_to(value, (self.count,)).copy()

    @classmethod
    def straight(
        cls,
        count: int,
        beads: int,
        length: float,
        bending_stiffness: ArrayLike | None,
        viscosity: float,
        box: ArrayLike | None = None,
        seed: int = 0,
        **options: Any,
    ) -> Fibers:
        """Straight fibers of contour length 2aN in random directions, all isotropic.

        Centres are uniform in the box [0, box)³ (box: one number or three), at the origin without one. The
        same seed gives the same fibers. Further options as in the constructor.
        """
        if int(count) != count or count < 1:
            raise ValueError(f"count is {count}; it must be a whole number of at least 1")
        if int(beads) != beads or beads < 2:
            raise ValueError(f"beads is {beads}; it must be a whole number of at least 2")
        diameter = positive("length", length) / beads
        random = np.random.default_rng(seed)
        directions = random.standard_normal((int(count), 3))
        directions /= np.linalg.norm(directions, axis=1, keepdims=True)
        sides = np.zeros(3) if box is None else np.broadcast_to(np.asarray(box, dtype=float), (3,))
        if not np.isfinite(sides).all() or (sides < 0).any():
            raise ValueError(f"box is {sides}; its sides must be finite and not negative")
        centres = random.random((int(count), 3)) * sides
        offsets = diameter * (np.arange(beads) - (beads - 1) / 2)
        positions = centres[:, None] + offsets[:, None] * directions[:, None]
        return cls(positions, bending_stiffness, viscosity, **options)

    def part(self, which: slice) -> Fibers:
        """Some of these fibers, the same to the last bit."""
        part = copy(self)
        part.centres, part.links = self.centres[which], self.links[which]
        part.bending_stiffness = self.bending_stiffness[which]
        return part

    @property
    def count(self) -> int:
        """Number of fibers F."""
        return len(self.centres)

    @property
    def beads(self) -> int:
        """Number of beads N of each fiber."""
        return self.links.shape[1] + 1

    @property
    def contour_length(self) -> float:
        """2aN."""
        return 2 * self.radius * self.beads

    @property
    def positions(self) -> np.ndarray:
        """(F, N, 3) bead centres, unwrapped."""
        beads = np.zeros((self.count, self.beads, 3))
        np.cumsum(2 * self.radius * self.links, axis=1, out=beads[:, 1:])
        return beads + (self.centres - beads.mean(axis=1))[:, None]

    @property
    def end_to_end(self) -> np.ndarray:
        """(F, 3) vector from the first to the last bead (eq. 13); 2a(N−1) long for a straight fiber."""
        return 2 * self.radius * self.links.sum(axis=1)

    @property
    def curvature(self) -> np.ndarray:
        """(F, N−2) |t_i × t_(i+1)|/2a at the inner beads (eq. 5), whatever the law of the torque."""
        return np.linalg.norm(np.cross(self.links[:, :-1], self.links[:, 1:]), axis=2) / (2 * self.radius)

    @property
    def gyration_radius(self) -> np.ndarray:
        """(F,) root-mean-square distance of the beads from the centre of mass (eq. 14)."""
        offsets = self.positions - self.centres[:, None]
        return np.sqrt((offsets**2).sum(axis=2).mean(axis=1))

    @property
    def bending_energy(self) -> np.ndarray:
        """(F,) energy whose derivative the consistent torque is, of the curvature law in use."""
        return bending_energy(self.links, self.bending_stiffness, self.radius, self.curvature_law)

    @property
    def self_contacts(self) -> np.ndarray:
        """(F,) number of overlapping pairs of beads that are not neighbours."""
        return self_contacts(self.positions, 2 * self.radius)
