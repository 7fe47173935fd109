"""Standard normal numbers of a seed and a step, the same bits here and in the OpenFOAM plugin on any machine.

Philox4x64-10 with the key (seed, 0) and the counters (1, 0, step, 0), (2, 0, step, 0), ... gives words of 64 bits
(Salmon et al. 2011), and each two of them a pair of normals (Box & Muller 1958). Logarithm, sine and cosine are
written out in operations that IEEE 754 rounds correctly, as in gbm_plugin/openfoam/eswaranPope/normals.C: libraries
differ in the last bit of theirs.
"""

import numpy as np
from numpy.typing import NDArray


def normals(seed: int, step: int, count: int) -> NDArray:
    """The first numbers (count,), an even count of them, of a seed and a step, whole numbers of at least 0."""
    words = np.random.Philox(key=seed, counter=[0, 0, step, 0]).random_raw(count) >> np.uint64(11)
    radius = np.sqrt(-2 * logarithm((words[0::2] + np.uint64(1)) * 2.0**-53))  # of (0, 1]
    cosine, sine = turn(words[1::2] * 2.0**-53)  # of [0, 1)
    return np.stack([radius * cosine, radius * sine], axis=-1).ravel()


def logarithm(u: NDArray) -> NDArray:
    """ln u for 0 < u: 2 artanh(s), s = (m - 1)/(m + 1), of the mantissa."""
    m, exponent = np.frexp(u)
    low = m < 0.70710678118654757
    m, exponent = np.where(low, 2 * m, m), np.where(low, exponent - 1, exponent)
    s = (m - 1) / (m + 1)
    q = s * s
    total = np.zeros_like(u)
    for n in range(21, 0, -2):
        total = total * q + 1.0 / n
    return exponent * 0.69314718055994529 + 2 * s * total


def turn(v: NDArray) -> tuple[NDArray, NDArray]:
    """Cosine and sine of 2 pi v, 0 <= v < 1: Taylor's series within pi/4 of the nearest quarter."""
    quarter = np.floor(4 * v + 0.5)
    x = (v - 0.25 * quarter) * 6.2831853071795862
    q = x * x
    c = s = np.ones_like(v)
    for n in range(18, 0, -2):
        c = 1 - q * c / ((n - 1) * n)
        s = 1 - q * s / (n * (n + 1))
    s = x * s
    number = quarter.astype(int) % 4
    return np.choose(number, [c, -s, -c, s]), np.choose(number, [s, c, -s, -c])
