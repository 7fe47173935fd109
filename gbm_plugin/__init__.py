"""Long flexible fibers (Gears Bead Model) in OpenFOAM turbulence."""

from .fiber import Fibers, simulate

__all__ = ["Fibers", "simulate"]
__version__ = "0.1.0"
