"""Long flexible fibers (Gears Bead Model) in OpenFOAM turbulence."""

__version__ = "0.1.0"
