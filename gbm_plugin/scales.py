"""Scales of isotropic turbulence, from the kinematic viscosity ν [m2/s] and the dissipation rate ε [m2/s3]."""

from __future__ import annotations

import math


def kolmogorov_length(viscosity: float, dissipation: float) -> float:
    """η = (ν³/ε)^(1/4) [m]; infinite in a flow at rest."""
    return (viscosity**3 / dissipation) ** 0.25 if dissipation > 0 else math.inf


def kolmogorov_time(viscosity: float, dissipation: float) -> float:
    """τ = (ν/ε)^(1/2) [s]; infinite in a flow at rest."""
    return math.sqrt(viscosity / dissipation) if dissipation > 0 else math.inf


def taylor_reynolds(velocity: float, viscosity: float, dissipation: float) -> float:
    """Re_λ = u'² (15/(νε))^(1/2), u' the rms of one component [m/s]; 0 in a flow at rest."""
    return velocity**2 * math.sqrt(15 / (viscosity * dissipation)) if dissipation > 0 else 0.0
