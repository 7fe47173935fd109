"""Transforms of columns against the sum that defines them."""

import numpy as np
import pytest

from gbm_plugin.simd import blank
from gbm_plugin.spectral.transform import plan, repeat


@pytest.mark.parametrize("n", [2, 4, 6, 8, 10, 12, 22, 48, 70, 96, 98, 128])
@pytest.mark.parametrize("kind, bound", [(np.float64, 1e-15), (np.float32, 5e-7)])
@pytest.mark.parametrize("sign", [-1, 1])
def test_transform_is_the_sum(n, kind, bound, sign):
    x, y = blank(n + 3, 2, kind=kind), blank(n + 3, 2, kind=kind)
    x[:n] = np.random.default_rng(n).standard_normal(x[:n].shape)
    given = x[:n, 0].astype(complex) + 1j * x[:n, 1]
    repeat(x, y, plan(n, sign, np.dtype(kind)), 1)
    k = np.arange(n)
    expected = np.exp(sign * 2j * np.pi * (k[:, None] * k % n) / n) @ given
    assert np.abs(y[:n, 0] + 1j * y[:n, 1] - expected).max() < bound * np.sqrt(n) * np.abs(
        given
    ).max() * np.log2(2 * n)
    assert not y[n:].any() and not x[n:].any()  # rows beyond are left alone
