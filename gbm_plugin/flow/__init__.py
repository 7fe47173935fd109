"""Flows that carry fibers: anything with sample(positions, time, need) -> velocity, extra."""

from .analytic import ABC, LinearFlow, TaylorGreen
from .hdf5 import hdf5_flow
from .jhtdb import jhtdb_flow
from .made import from_array, from_function
from .stored import StoredFlow

__all__ = [
    "ABC",
    "LinearFlow",
    "StoredFlow",
    "TaylorGreen",
    "from_array",
    "from_function",
    "hdf5_flow",
    "jhtdb_flow",
]
