"""3×3 matrices of lanes: tuples of nine, row by row; symmetric ones of six (xx, xy, xz, yy, yz, zz)."""

from ..simd import arithmetic, cross, dot


@arithmetic
def identity_plus(alpha, p, e):
    """α I + p eᵀ."""
    return (
        alpha + p[0] * e[0],
        p[0] * e[1],
        p[0] * e[2],
        p[1] * e[0],
        alpha + p[1] * e[1],
        p[1] * e[2],
        p[2] * e[0],
        p[2] * e[1],
        alpha + p[2] * e[2],
    )


@arithmetic
def plus_outer(m, p, e):
    """m + p eᵀ."""
    return (
        m[0] + p[0] * e[0],
        m[1] + p[0] * e[1],
        m[2] + p[0] * e[2],
        m[3] + p[1] * e[0],
        m[4] + p[1] * e[1],
        m[5] + p[1] * e[2],
        m[6] + p[2] * e[0],
        m[7] + p[2] * e[1],
        m[8] + p[2] * e[2],
    )


@arithmetic
def product(a, b):
    """a b."""
    return (
        a[0] * b[0] + a[1] * b[3] + a[2] * b[6],
        a[0] * b[1] + a[1] * b[4] + a[2] * b[7],
        a[0] * b[2] + a[1] * b[5] + a[2] * b[8],
        a[3] * b[0] + a[4] * b[3] + a[5] * b[6],
        a[3] * b[1] + a[4] * b[4] + a[5] * b[7],
        a[3] * b[2] + a[4] * b[5] + a[5] * b[8],
        a[6] * b[0] + a[7] * b[3] + a[8] * b[6],
        a[6] * b[1] + a[7] * b[4] + a[8] * b[7],
        a[6] * b[2] + a[7] * b[5] + a[8] * b[8],
    )


@arithmetic
def minus_product(m, a, b):
    """m − a b."""
    return (
        m[0] - a[0] * b[0] - a[1] * b[3] - a[2] * b[6],
        m[1] - a[0] * b[1] - a[1] * b[4] - a[2] * b[7],
        m[2] - a[0] * b[2] - a[1] * b[5] - a[2] * b[8],
        m[3] - a[3] * b[0] - a[4] * b[3] - a[5] * b[6],
        m[4] - a[3] * b[1] - a[4] * b[4] - a[5] * b[7],
        m[5] - a[3] * b[2] - a[4] * b[5] - a[5] * b[8],
        m[6] - a[6] * b[0] - a[7] * b[3] - a[8] * b[6],
        m[7] - a[6] * b[1] - a[7] * b[4] - a[8] * b[7],
        m[8] - a[6] * b[2] - a[7] * b[5] - a[8] * b[8],
    )


@arithmetic
def minus_apply(v, a, x):
    """v − a x."""
    return (
        v[0] - a[0] * x[0] - a[1] * x[1] - a[2] * x[2],
        v[1] - a[3] * x[0] - a[4] * x[1] - a[5] * x[2],
        v[2] - a[6] * x[0] - a[7] * x[1] - a[8] * x[2],
    )


@arithmetic
def apply(a, x):
    """a x."""
    return dot(a[0:3], x), dot(a[3:6], x), dot(a[6:9], x)


@arithmetic
def transposed(m):
    """mᵀ."""
    return m[0], m[3], m[6], m[1], m[4], m[7], m[2], m[5], m[8]


@arithmetic
def apply_transposed(a, x):
    """aᵀ x."""
    return apply(transposed(a), x)


def by_columns(function, a, m):
    """function(a, v) of each column v of m, as the columns of a matrix."""
    columns = [function(a, m[c::3]) for c in range(3)]
    return tuple(columns[c][r] for r in range(3) for c in range(3))


@arithmetic
def inverse(m):
    """Inverse by cofactors."""
    c0 = m[4] * m[8] - m[5] * m[7]
    c1 = m[5] * m[6] - m[3] * m[8]
    c2 = m[3] * m[7] - m[4] * m[6]
    r = 1.0 / (m[0] * c0 + m[1] * c1 + m[2] * c2)
    return (
        r * c0,
        r * (m[2] * m[7] - m[1] * m[8]),
        r * (m[1] * m[5] - m[2] * m[4]),
        r * c1,
        r * (m[0] * m[8] - m[2] * m[6]),
        r * (m[2] * m[3] - m[0] * m[5]),
        r * c2,
        r * (m[1] * m[6] - m[0] * m[7]),
        r * (m[0] * m[4] - m[1] * m[3]),
    )


@arithmetic
def inverse_symmetric(s):
    """Inverse of a symmetric matrix."""
    xx = s[3] * s[5] - s[4] * s[4]
    xy = s[2] * s[4] - s[1] * s[5]
    xz = s[1] * s[4] - s[2] * s[3]
    r = 1.0 / (s[0] * xx + s[1] * xy + s[2] * xz)
    yy = s[0] * s[5] - s[2] * s[2]
    yz = s[1] * s[2] - s[0] * s[4]
    zz = s[0] * s[3] - s[1] * s[1]
    return r * xx, r * xy, r * xz, r * yy, r * yz, r * zz


@arithmetic
def apply_symmetric(s, v):
    """Symmetric matrix times vector."""
    return (
        s[0] * v[0] + s[1] * v[1] + s[2] * v[2],
        s[1] * v[0] + s[3] * v[1] + s[4] * v[2],
        s[2] * v[0] + s[4] * v[1] + s[5] * v[2],
    )


@arithmetic
def plus(a, b):
    """a + b, of as many numbers each."""
    return tuple(x + y for x, y in zip(a, b, strict=True))


@arithmetic
def minus(a, b):
    """a − b, of as many numbers each."""
    return tuple(x - y for x, y in zip(a, b, strict=True))


@arithmetic
def scaled(c, m):
    """c m."""
    return tuple(c * x for x in m)


@arithmetic
def minus_product_transposed(m, a, b):
    """m − a bᵀ."""
    return minus_product(m, a, transposed(b))


@arithmetic
def minus_transposed_product(m, a, b):
    """m − aᵀ b."""
    return minus_product(m, transposed(a), b)


@arithmetic
def cross_symmetric(e, s):
    """[e]× S, S symmetric: e × each column."""
    columns = cross(e, s[0:3]), cross(e, (s[1], s[3], s[4])), cross(e, (s[2], s[4], s[5]))
    return tuple(columns[j][i] for i in range(3) for j in range(3))


@arithmetic
def times_cross(m, e):
    """m [e]×: each row × e."""
    return (*cross(m[0:3], e), *cross(m[3:6], e), *cross(m[6:9], e))
