"""Flows that carry fibers: anything with sample(positions, time, need) -> velocity, extra."""

from .analytic import ABC, LinearFlow, TaylorGreen
from .hdf5 import hdf5_flow
from .stored import StoredFlow

__all__ = ["ABC", "LinearFlow", "StoredFlow", "TaylorGreen", "hdf5_flow"]
