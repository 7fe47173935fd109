"""Flows that carry fibers: anything with sample(positions, time, need) -> velocity, extra."""

from .analytic import ABC, NEEDS, LinearFlow, TaylorGreen

__all__ = ["ABC", "NEEDS", "LinearFlow", "TaylorGreen"]
