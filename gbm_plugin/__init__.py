"""Long flexible fibers (Gears Bead Model) in OpenFOAM turbulence."""

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from .fiber import Fibers, simulate
    from .output.recording import open_recording

__all__ = ["Fibers", "open_recording", "simulate"]
__version__ = "0.1.0"

_HOMES = {"Fibers": ".fiber", "simulate": ".fiber", "open_recording": ".output.recording"}


def __getattr__(name: str) -> Any:
    """Names from below, when they are first used: a command that moves no fibers needs no compiler of kernels."""
    if name not in _HOMES:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return getattr(import_module(_HOMES[name], __name__), name)
