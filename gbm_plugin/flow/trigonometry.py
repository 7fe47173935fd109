"""Sine and cosine of many numbers at once: the polynomials of fdlibm (Sun Microsystems, 1993) without a branch, so that
the compiler makes vector instructions of them; four times as fast as a call for each."""

from __future__ import annotations

import numpy as np

from ..compiled import part

# π/2 in two parts, the first of 33 bits: times a whole number below 2²⁰ it is exact
FIRST, SECOND = 1.57079632673412561417, 6.07710050650619224932e-11
S1, S2, S3 = -1.66666666666666324348e-01, 8.33333333332248946124e-03, -1.98412698298579493134e-04
S4, S5, S6 = 2.75573137070700676789e-06, -2.50507602534068634195e-08, 1.58969099521155010221e-10
C1, C2, C3 = 4.16666666666666019037e-02, -1.38888888888741095749e-03, 2.48015872894767294178e-05
C4, C5, C6 = -2.75573143513906633035e-07, 2.08757232129817482790e-09, -1.13596475577881948265e-11


@part
def sine_cosine(x, sine, cosine):
    """Both of x, all three (n,), to 2e-16 below |x| = 10⁶, and to 1e-16 |x| beyond."""
    for i in range(x.shape[0]):
        n = np.floor(x[i] * (2 / np.pi) + 0.5)
        r = (x[i] - n * FIRST) - n * SECOND
        z = r * r
        s = r + r * z * (S1 + z * (S2 + z * (S3 + z * (S4 + z * (S5 + z * S6)))))
        c = 1.0 - (0.5 * z - z * z * (C1 + z * (C2 + z * (C3 + z * (C4 + z * (C5 + z * C6))))))
        odd = n - 2.0 * np.floor(0.5 * n)
        half, next_half = np.floor(0.5 * n), np.floor(0.5 * n + 0.5)
        sine[i] = (1.0 - 2.0 * (half - 2.0 * np.floor(0.5 * half))) * (s * (1.0 - odd) + c * odd)
        sign = 1.0 - 2.0 * (next_half - 2.0 * np.floor(0.5 * next_half))
        cosine[i] = sign * (c * (1.0 - odd) + s * odd)
