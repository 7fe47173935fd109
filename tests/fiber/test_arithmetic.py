"""The arithmetic of lanes by itself: against NumPy, as plain functions and as kernels compile them."""

import numpy as np
import pytest
from numba import njit

from gbm_plugin import simd
from gbm_plugin.fiber import matrix3
from gbm_plugin.fiber.layout import rotated
from gbm_plugin.simd import LANES, load3, load6, load9, store, store3, store6, store9

RNG = np.random.default_rng(5)
V, W = RNG.standard_normal((2, 3, LANES))
M, N = RNG.standard_normal((2, 9, LANES))
S = np.einsum("ijl,kjl->ikl", M.reshape(3, 3, LANES), M.reshape(3, 3, LANES))  # symmetric, positive definite
UPPER = S[np.triu_indices(3)]


def full(s):
    """(3, 3, LANES) of a symmetric matrix of six."""
    m = np.empty((3, 3, LANES))
    m[np.triu_indices(3)] = s
    return np.where(np.triu(np.ones((3, 3)))[..., None] > 0, m, m.transpose(1, 0, 2))


def square(m):
    return np.reshape(m, (3, 3, LANES))


VECTORS = {
    simd.add: ((V, W), V + W),
    simd.subtract: ((V, W), V - W),
    simd.scale: ((2.5, V), 2.5 * V),
    simd.add_scaled: ((V, -1.5, W), V - 1.5 * W),
    simd.dot: ((V, W), (V * W).sum(axis=0)),
    simd.cross: ((V, W), np.cross(V, W, axis=0)),
    simd.larger: ((V[0], W[0]), np.maximum(V[0], W[0])),
    simd.smaller: ((V[0], W[0]), np.minimum(V[0], W[0])),
    simd.sqrt: ((V[0] ** 2,), np.abs(V[0])),
    simd.select_less: ((V[0], W[0], V[1], W[1]), np.where(V[0] < W[0], V[1], W[1])),
}
MATRICES = {
    matrix3.identity_plus: ((V[0], V, W), np.eye(3)[..., None] * V[0] + V[:, None] * W),
    matrix3.plus_outer: ((M, V, W), square(M) + V[:, None] * W),
    matrix3.product: ((M, N), np.einsum("ijl,jkl->ikl", square(M), square(N))),
    matrix3.minus_product: ((S.reshape(9, -1), M, N), S - np.einsum("ijl,jkl->ikl", square(M), square(N))),
    matrix3.minus_apply: ((V, M, W), V - np.einsum("ijl,jl->il", square(M), W)),
    matrix3.apply: ((M, V), np.einsum("ijl,jl->il", square(M), V)),
    matrix3.inverse: ((M,), np.linalg.inv(square(M).transpose(2, 0, 1)).transpose(1, 2, 0)),
    matrix3.inverse_symmetric: ((UPPER,), np.linalg.inv(S.transpose(2, 0, 1)).transpose(1, 2, 0)),
    matrix3.apply_symmetric: ((UPPER, V), np.einsum("ijl,jl->il", S, V)),
}


def as_arrays(function, result):
    if function is matrix3.inverse_symmetric:
        return full(np.array(result))
    return np.array(result)


@pytest.mark.parametrize("function", [*VECTORS, *MATRICES], ids=lambda f: f.__name__)
def test_as_plain_functions(function):
    """Each is Python on any numbers: here on one array for every component."""
    arguments, expected = (VECTORS | MATRICES)[function]
    result = as_arrays(function, function(*(tuple(a) if np.ndim(a) == 2 else a for a in arguments)))
    np.testing.assert_allclose(result.reshape(np.shape(expected)), expected, rtol=1e-9, atol=1e-13)


@njit
def compiled_vectors(v, w, out):
    """Every function of VECTORS, in that order, into rows of out."""
    a, b = load3(v, 0), load3(w, 0)
    store3(out, 0, simd.add(a, b))
    store3(out, 1, simd.subtract(a, b))
    store3(out, 2, simd.scale(2.5, a))
    store3(out, 3, simd.add_scaled(a, -1.5, b))
    store(out, 12, simd.dot(a, b))
    store3(out[13:], 0, simd.cross(a, b))
    store(out, 16, simd.larger(a[0], b[0]))
    store(out, 17, simd.smaller(a[0], b[0]))
    store(out, 18, simd.sqrt(a[0] * a[0]))
    store(out, 19, simd.select_less(a[0], b[0], a[1], b[1]))
    # operators, between lanes and with numbers, and the rest
    store(out, 20, -(2.0 / (1.0 + a[0]) - b[0] * 3.0) / b[1] - 1.0 + simd.splat(0.5))
    store3(out[21:], 0, simd.zero3())


@njit
def compiled_matrices(v, w, m, n, s, upper, out):
    a, b, p, q = load3(v, 0), load3(w, 0), load9(m, 0), load9(n, 0)
    store9(out, 0, matrix3.identity_plus(a[0], a, b))
    store9(out, 1, matrix3.plus_outer(p, a, b))
    store9(out, 2, matrix3.product(p, q))
    store9(out, 3, matrix3.minus_product(load9(s, 0), p, q))
    store3(out[36:], 0, matrix3.minus_apply(a, p, b))
    store3(out[39:], 0, matrix3.apply(p, a))
    store9(out[42:], 0, matrix3.inverse(p))
    store6(out[51:], 0, matrix3.inverse_symmetric(load6(upper, 0)))
    store3(out[57:], 0, matrix3.apply_symmetric(load6(upper, 0), a))


def test_as_kernels_compile_them():
    """The same numbers, but for products that were fused with sums."""
    out = np.full((24, LANES), np.nan)
    compiled_vectors(V, W, out)
    mixed = -(2.0 / (1.0 + V[0]) - W[0] * 3.0) / W[1] - 1.0 + 0.5
    expected = [np.reshape(e, (-1, LANES)) for _, e in VECTORS.values()]
    expected = np.concatenate([*expected, mixed[None], np.zeros((3, LANES))])
    np.testing.assert_allclose(out, expected, rtol=1e-13, atol=1e-15)
    out = np.full((60, LANES), np.nan)
    compiled_matrices(V, W, M, N, S.reshape(9, LANES), UPPER, out)
    expected = [np.reshape(e, (-1, LANES)) for _, e in MATRICES.values()]
    expected[7] = expected[7].reshape(3, 3, LANES)[np.triu_indices(3)]
    np.testing.assert_allclose(out, np.concatenate(expected), rtol=1e-9, atol=1e-13)


def test_comparisons_keep_the_right_one_beside_a_nan():
    nothing = np.full(LANES, np.nan)
    for function in (simd.larger, simd.smaller):
        assert np.isnan(function(V[0], nothing)).all()
        assert (function(nothing, V[0]) == V[0]).all()


def test_lanes_lie_in_one_line_of_the_cache():
    array = simd.blank(3, 5)
    assert array.shape == (3, 5, LANES)
    assert array.flags.c_contiguous
    assert array.ctypes.data % 64 == 0
    assert not array.any()


@pytest.mark.parametrize("precision", [float, np.float32])
def test_a_part_of_the_lanes_is_read(precision):
    @njit
    def part_of_a_row(array, at, first, last, out):
        store(out, 0, simd.load_part(array, at, first, last))

    array, out = np.arange(1, 25, dtype=precision).reshape(2, 3, 4), np.empty((1, LANES))
    for at, first, last in ((0, 0, 8), (20, -2, 4), (-3, 3, 99), (10**15, 5, 2)):
        part_of_a_row(array, at, first, last, out)
        places = at + np.arange(LANES)
        read = (np.arange(LANES) >= first) & (np.arange(LANES) < last)
        assert (out[0] == np.where(read, places + 1, 0)).all()


def test_links_turn_as_rotations_do():
    """Rodrigues' formula: the angle to O(|φ|⁷), the length exactly."""
    link = V / np.linalg.norm(V, axis=0)
    for size, bound in ((0.1, 1e-10), (0.2, 1e-8)):
        angle = size * W / np.linalg.norm(W, axis=0)
        axis = angle / size
        along = (axis * link).sum(axis=0) * axis
        turned = along + np.cos(size) * (link - along) + np.sin(size) * np.cross(axis, link, axis=0)
        new = np.array(rotated(tuple(link), tuple(angle)))
        assert np.abs(new - turned).max() < bound
        assert np.abs(np.linalg.norm(new, axis=0) - 1).max() < 1e-14


def test_arithmetic_of_other_things_is_refused():
    @njit
    def wrong(v):
        return simd.add(v, v)

    with pytest.raises(Exception, match="arithmetic of lanes takes lanes and floats"):
        wrong(V)
