"""Complex discrete Fourier transforms of even length, of as many columns at once as a vector has lanes.

Stockham's self-sorting scheme: n = r_1 r_2 ..., and in the pass of radix r, with s the product of the radices before it
and n = r s m, for p < m and q < s,

    y[q + s (r p + k)] = w^(p k) sum_j e^(-+2 pi i j k/r) x[q + s (p + m j)],   w = e^(-+2 pi i/(r m)).

Columns are arrays (>= n, 2, lanes): real and imaginary parts of eight columns, or sixteen in single precision, which
share every twiddle factor. They stay in the first-level cache for all passes, up to n = 192. Nothing is planned by
timing: the same input gives the same bits in every run.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..compiled import bare, bare_inlined, kernel
from ..simd import arithmetic, load, store

HALF_ROOT = 0.75**0.5


class Plan(NamedTuple):
    """What a transform of a length and direction needs."""

    radices: NDArray  # one a pass
    factors: NDArray  # (F, 2) twiddle factors, in the order of their use
    backward: bool  # with a positive exponent


def plan(length: int, sign: int, kind: np.dtype) -> Plan:
    """Of sum_j x_j e^(sign 2 pi i j k/length), with twiddle factors of the real type `kind`."""
    radices, left = [], length
    for r in (4, 3, *range(2, length + 1)):
        while left % r == 0:
            radices.append(r)
            left //= r
    radices.sort(key=lambda r: r <= 4)  # others first: the last pass works in place
    angles, left = [], length
    for r in radices:
        if r > 4:
            angles += [j / r for j in range(r)]
        angles += [p * k / left for p in range(left // r) for k in range(1, r)]
        left //= r
    turns = 2j * np.pi * sign * np.array(angles)
    factors = np.exp(turns)
    return Plan(np.array(radices), np.stack([factors.real, factors.imag], axis=1).astype(kind), sign > 0)


@bare
def get(columns, i):
    """Point i of all columns."""
    return load(columns, 2 * i), load(columns, 2 * i + 1)


@bare
def put(columns, i, value):
    """Set point i of all columns."""
    store(columns, 2 * i, value[0])
    store(columns, 2 * i + 1, value[1])


@arithmetic
def times(a, b):
    """a b."""
    return a[0] * b[0] - a[1] * b[1], a[0] * b[1] + a[1] * b[0]


@arithmetic
def add_times(a, b, c):
    """a + b c."""
    return a[0] + (b[0] * c[0] - b[1] * c[1]), a[1] + (b[0] * c[1] + b[1] * c[0])


@arithmetic
def butterfly2(a, b):
    """The transform of two numbers."""
    return (a[0] + b[0], a[1] + b[1]), (a[0] - b[0], a[1] - b[1])


@arithmetic
def butterfly3(a, b, c):
    """The forward transform of three numbers."""
    sum_re, sum_im = b[0] + c[0], b[1] + c[1]
    turned_re, turned_im = HALF_ROOT * (b[1] - c[1]), HALF_ROOT * (c[0] - b[0])
    middle_re, middle_im = a[0] - 0.5 * sum_re, a[1] - 0.5 * sum_im
    return (
        (a[0] + sum_re, a[1] + sum_im),
        (middle_re + turned_re, middle_im + turned_im),
        (middle_re - turned_re, middle_im - turned_im),
    )


@arithmetic
def butterfly4(a, b, c, d):
    """The forward transform of four numbers."""
    (p, q), (r, s) = butterfly2(a, c), butterfly2(b, d)
    return (
        (p[0] + r[0], p[1] + r[1]),
        (q[0] + s[1], q[1] - s[0]),
        (p[0] - r[0], p[1] - r[1]),
        (q[0] - s[1], q[1] + s[0]),
    )


@bare_inlined
def pass2(x, y, s, m, w, t):
    """The pass of radix 2, with twiddle factors w (m, 2)."""
    for p in range(m):
        turn = w[t + p, 0], w[t + p, 1]
        for i in range(s * p, s * p + s):
            a, b = butterfly2(get(x, i), get(x, i + s * m))
            o = i + s * p
            put(y, o, a)
            put(y, o + s, times(b, turn))


@bare_inlined
def pass3(x, y, s, m, w, t, first):
    """The pass of radix 3, with twiddle factors w (2m, 2); first: where the first harmonic goes, 1, or backward 2."""
    one, two = first, 3 - first
    for p in range(m):
        i, j = t + 2 * p + one - 1, t + 2 * p + two - 1
        turn_b, turn_c = (w[i, 0], w[i, 1]), (w[j, 0], w[j, 1])
        for i in range(s * p, s * p + s):
            a, b, c = butterfly3(get(x, i), get(x, i + s * m), get(x, i + 2 * s * m))
            o = i + 2 * s * p
            put(y, o, a)
            put(y, o + one * s, times(b, turn_b))
            put(y, o + two * s, times(c, turn_c))


@bare_inlined
def pass4(x, y, s, m, w, t, first):
    """The pass of radix 4, with twiddle factors w (3m, 2); first: where the first harmonic goes, 1, or backward 3."""
    one, three = first, 4 - first
    for p in range(m):
        i, j, k = t + 3 * p + one - 1, t + 3 * p + 1, t + 3 * p + three - 1
        turn_b, turn_c, turn_d = (w[i, 0], w[i, 1]), (w[j, 0], w[j, 1]), (w[k, 0], w[k, 1])
        for i in range(s * p, s * p + s):
            quarters = get(x, i), get(x, i + s * m), get(x, i + 2 * s * m), get(x, i + 3 * s * m)
            a, b, c, d = butterfly4(*quarters)
            o = i + 3 * s * p
            put(y, o, a)
            put(y, o + one * s, times(b, turn_b))
            put(y, o + 2 * s, times(c, turn_c))
            put(y, o + three * s, times(d, turn_d))


@bare_inlined
def pass_any(x, y, s, m, w, t, r):
    """The pass of any other radix r, with its roots of unity before its twiddle factors in w (r + (r - 1) m, 2)."""
    for p in range(m):
        u = t + r + (r - 1) * p
        for i in range(s * p, s * p + s):
            o = i + (r - 1) * s * p
            for k in range(r):
                total = get(x, i)
                for j in range(1, r):
                    root = j * k % r
                    total = add_times(total, get(x, i + j * s * m), (w[t + root, 0], w[t + root, 1]))
                if k > 0:
                    total = times(total, (w[u + k - 1, 0], w[u + k - 1, 1]))
                put(y, o + k * s, total)


@bare
def transform(x, y, how):
    """y = the transforms of the columns x, which are written over."""
    radices, w, backward = how
    m = 1
    for r in radices:
        m *= r
    s, t = 1, 0
    source, target = x, y
    for number in range(radices.size):
        r = radices[number]
        m //= r
        first = r - 1 if backward else 1
        if m == 1:  # the last pass can work in place
            target = y
        if r == 4:
            pass4(source, target, s, m, w, t, first)
        elif r == 3:
            pass3(source, target, s, m, w, t, first)
        elif r == 2:
            pass2(source, target, s, m, w, t)
        else:
            pass_any(source, target, s, m, w, t, r)
            t += r
        t += (r - 1) * m
        source, target = target, source
        s *= r


@kernel(_nrt=False)
def repeat(x, y, how, count):
    """`transform` over and over: its time."""
    for _ in range(count):
        transform(x, y, how)
