"""What moves numbers between rows of lanes and arrays, in both precisions, against NumPy."""

import numpy as np
import pytest
from numba import njit

from gbm_plugin.simd import blank, load_complex, store_complex, transpose

PRECISIONS = pytest.mark.parametrize("kind", [np.float64, np.float32])


@njit
def swapped(source, target):
    transpose(source, 1, 2, target, 0, 3)


@njit
def copied(source, target, count):
    store_complex(target, 2, count, load_complex(source, 3, count))


@PRECISIONS
def test_rows_become_lanes(kind):
    lanes = blank(0, kind=kind).shape[-1]
    source, target = blank(2 * lanes, kind=kind), blank(3 * lanes, kind=kind)
    source[:] = np.arange(source.size).reshape(source.shape)
    swapped(source, target)
    assert np.array_equal(target[::3], source[1::2].T)
    assert not target[1::3].any() and not target[2::3].any()


@PRECISIONS
@pytest.mark.parametrize("missing", [0, 1, 5])
def test_so_many_complex_numbers_and_no_more(kind, missing):
    count = blank(0, kind=kind).shape[-1] - missing
    source = (np.arange(1, 40) + 1j * np.arange(51, 90)).astype(np.result_type(kind, 1j))
    target = np.zeros_like(source)
    copied(source, target, count)
    assert np.array_equal(target[2 : 2 + count], source[3 : 3 + count])
    assert not target[:2].any() and not target[2 + count :].any()
