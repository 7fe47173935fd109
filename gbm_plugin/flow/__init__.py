"""Flows that carry fibers: anything with sample(positions, time, need) -> velocity, extra."""

from .analytic import ABC, NEEDS, LinearFlow, TaylorGreen
from .hdf5 import hdf5_flow
from .stored import StoredFlow

__all__ = ["ABC", "NEEDS", "LinearFlow", "StoredFlow", "TaylorGreen", "hdf5_flow"]
