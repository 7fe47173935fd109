"""Flows that carry fibers: anything with sample(positions, time, need) -> velocity, extra."""

from .analytic import NEEDS, LinearFlow, TaylorGreen

__all__ = ["NEEDS", "LinearFlow", "TaylorGreen"]
