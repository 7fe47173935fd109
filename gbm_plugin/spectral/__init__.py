"""Pseudo-spectral reference solver of the periodic box, its forcing, and presets."""

from gbm_plugin.spectral.forcing import EswaranPope, LinearForcing
from gbm_plugin.spectral.solver import SpectralSolver

__all__ = ["EswaranPope", "LinearForcing", "SpectralSolver"]
