"""Velocity fields that the spectral tests share."""

import numpy as np


def nodes(n, box=2 * np.pi):
    x = np.arange(n) * box / n
    return np.stack(np.meshgrid(x, x, x, indexing="ij"))


def taylor_green(n):
    x, y, z = nodes(n)
    return np.array([np.sin(x) * np.cos(y) * np.cos(z), -np.cos(x) * np.sin(y) * np.cos(z), 0 * x])


def abc(n, box=2 * np.pi, waves=1, a=1.0, b=0.7, c=0.4):
    """Arnold-Beltrami-Childress flow, curl u = k u: u x omega = 0, so it decays as exp(-nu k^2 t) exactly."""
    x, y, z = 2 * np.pi * waves / box * nodes(n, box)
    return np.array(
        [a * np.sin(z) + c * np.cos(y), b * np.sin(x) + a * np.cos(z), c * np.sin(y) + b * np.cos(x)]
    )


def noise(n, seed=0):
    return np.random.default_rng(seed).standard_normal((3, n, n, n))
