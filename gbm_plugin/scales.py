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


EXTRAPOLATION = 0.05  # largest found by `gbm study accuracy --only step`, whatever the stiffness


def coupling_error(time_step: float, kolmogorov_time: float) -> float:
    """What one sample of the flow a step adds, in one Kolmogorov time, to the error of fibers, over their length.

    Between samples the flow is extrapolated by a quadratic in time: 0.05 (Δt/τ)³ (docs/accuracy.md). A run adds it up,
    until neighbouring paths part by themselves; for small Δt/τ only.
    """
    return EXTRAPOLATION * (time_step / kolmogorov_time) ** 3


def coupling_step(error: float, kolmogorov_time: float) -> float:
    """The longest time step [s] of a `coupling_error` of so much; 1e-3 is 0.27 τ."""
    return (error / EXTRAPOLATION) ** (1 / 3) * kolmogorov_time
