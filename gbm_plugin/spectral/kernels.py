"""Compiled steps of the slab-wise operators; every one of them runs without Python's lock.

On its way between modes and points a field is `mixed` (n, 5, 2K+1, blocks, 2, lanes): points in x, modes in y and z, so
that columns along x and y lie in lanes, a block of kz, its real and its imaginary parts. A plane of it then becomes
`lines` (5, groups, kz, 2, lanes): points in y, a group of which lies in lanes, so that columns along z do. There two
groups of real fields a, b are one complex field, a + i b, whose modes are A(k) + i B(k), and those of -k
conj A(k) + i conj B(k). Every transform is of one block of columns, in the first-level cache. Arrays of modes are
C-contiguous, and ordered as `Modes` says.
"""

from functools import partial
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..compiled import bare, kernel
from ..simd import (
    LINE,
    arithmetic,
    blank,
    larger,
    load,
    load_complex,
    prefetch,
    prefetch_to_write,
    store,
    store_complex,
    transpose,
)
from .modes import Modes
from .transform import Plan, get, plan, put, transform

# sums may be reordered and fused; infinities and NaN keep their meaning
jit = partial(kernel, _nrt=False, fastmath={"contract", "reassoc", "nsz"})

FIELDS = 5  # that are transformed at once


class Work(NamedTuple):
    """What one thread works with."""

    rows: NDArray  # (2K+1,), where the stored kx, or ky, lie among all n
    inverse: Plan
    forward: Plan
    zero: NDArray  # (1, 2, lanes)
    x: NDArray  # (blocks, >= n, 2, lanes), columns that are transformed; what is beyond n is zero
    y: NDArray  # (5, blocks, >= n, 2, lanes), and what they are transformed to
    lines: NDArray  # (5, groups, kz, 2, lanes), a plane
    kz: NDArray  # (blocks, lanes)
    speed: NDArray  # (1, lanes), the largest |u| + |v| + |w| of each lane


def work_space(modes: Modes, kind: np.dtype) -> Work:
    """For modes in a real precision."""
    n, lanes = modes.cells, LINE // kind.itemsize
    blocks, groups = -(-(modes.cut + 1) // lanes), 2 * -(-n // (2 * lanes))
    kz = blank(blocks, kind=kind)
    kz.reshape(-1)[:] = modes.k0 * np.arange(kz.size)
    return Work(
        modes.rows,
        plan(n, 1, kind),
        plan(n, -1, kind),
        blank(1, 2, kind=kind),
        blank(blocks, groups * lanes, 2, kind=kind),
        blank(FIELDS, blocks, groups * lanes, 2, kind=kind),
        blank(FIELDS, groups, blocks * lanes, 2, kind=kind),
        kz,
        blank(1, kind=kind),
    )


@bare
def _place(mixed, x, c, j, block):
    """Where block of row j of field c in plane x is, among all points."""
    return ((x * mixed.shape[1] + c) * mixed.shape[2] + j) * mixed.shape[3] + block


# what the next transform but one needs comes from memory while the next one computes


@bare
def _will_read(mixed, place):
    """Have a point of a block of columns brought near."""
    prefetch(mixed, 2 * place)
    prefetch(mixed, 2 * place + 1)


@bare
def _will_write(mixed, place):
    """Have the room for a point of a block of columns brought near."""
    prefetch_to_write(mixed, 2 * place)
    prefetch_to_write(mixed, 2 * place + 1)


@bare
def _clear(x, first, last, work):
    """Set points of a block of columns to zero."""
    for i in range(first, last):
        put(x, i, get(work.zero, 0))


@jit
def to_mixed(u, mixed, work, start, stop):
    """Modes u (m, 2K+1, 2K+1, K+1) to points in x, at the ky from start to stop."""
    n, lanes, rows, x, y = mixed.shape[0], mixed.shape[5], work.rows, work.x, work.y[0]
    stored, half = rows.size, u.shape[3]
    for j in range(start, stop):
        for c in range(u.shape[0]):
            for i in range(stored):
                first = ((c * stored + i) * stored + j) * half
                for block in range(x.shape[0]):
                    kz = block * lanes
                    put(x[block], rows[i], load_complex(u, first + kz, min(lanes, half - kz)))
            for block in range(x.shape[0]):
                for i in range(n):
                    _will_write(mixed, _place(mixed, i, c, j, block))
                _clear(x[block], half, n - half + 1, work)
                transform(x[block], y[block], work.inverse)
            for i in range(n):
                for block in range(x.shape[0]):
                    put(mixed, _place(mixed, i, c, j, block), get(y[block], i))


@bare
def _from_mixed(mixed, c, j, work):
    """work.y[c] = modes in x, all n of them, of field c in a row of ky."""
    x, y = work.x, work.y[c]
    next_c, next_j = (c + 1, j) if c < FIELDS - 1 else (0, j + 1)
    for i in range(mixed.shape[0]):
        for block in range(x.shape[0]):
            put(x[block], i, get(mixed, _place(mixed, i, c, j, block)))
    for block in range(x.shape[0]):
        if next_j < mixed.shape[2]:
            for i in range(mixed.shape[0]):
                _will_read(mixed, _place(mixed, i, next_c, next_j, block))
        transform(x[block], y[block], work.forward)


@arithmetic
def _scaled(a, factor):
    """factor a."""
    return factor * a[0], factor * a[1]


@jit
def from_mixed(mixed, out, factor, work, start, stop):
    """factor times the modes, out (m, 2K+1, 2K+1, K+1), at the ky from start to stop."""
    lanes, rows, y = mixed.shape[5], work.rows, work.y
    stored, half = rows.size, out.shape[3]
    for j in range(start, stop):
        for c in range(out.shape[0]):
            _from_mixed(mixed, c, j, work)
            for i in range(stored):
                first = ((c * stored + i) * stored + j) * half
                for block in range(y.shape[1]):
                    kz, value = block * lanes, _scaled(get(y[c, block], rows[i]), factor)
                    store_complex(out, first + kz, min(lanes, half - kz), value)


@arithmetic
def _slope(a, b, c, scale, products, linear, velocity):
    """P [-i scale k.products + linear velocity] for k = (a, b, c), from xx, yy, xy, xz, yz and u, v, w."""
    over_square = 1.0 / (a * a + b * b + c * c)

    def part(which, factor):
        xx, yy, xy, xz, yz = (factor * product[1 - which] for product in products)
        u, v, w = (linear * component[which] for component in velocity)
        x, y, z = a * xx + b * xy + c * xz + u, a * xy + b * yy + c * yz + v, a * xz + b * yz + w
        q = (a * x + b * y + c * z) * over_square
        return x - a * q, y - b * q, z - c * q

    return tuple(zip(part(0, scale), part(1, -scale), strict=True))


@jit
def slope(mixed, u, out, kx, ky, scale, linear, work, start, stop):
    """out = P [-i scale k.products + linear u] at the ky from start to stop."""
    lanes, rows, y = mixed.shape[5], work.rows, work.y
    stored, half = rows.size, u.shape[3]
    field = stored * stored * half
    for j in range(start, stop):
        for c in range(FIELDS):
            _from_mixed(mixed, c, j, work)
        for i in range(stored):
            row, first = rows[i], (i * stored + j) * half
            for block in range(y.shape[1]):
                width, at = min(lanes, half - block * lanes), first + block * lanes
                products = (
                    get(y[0, block], row),
                    get(y[1, block], row),
                    get(y[2, block], row),
                    get(y[3, block], row),
                    get(y[4, block], row),
                )
                velocity = (
                    load_complex(u, at, width),
                    load_complex(u, at + field, width),
                    load_complex(u, at + 2 * field, width),
                )
                kz = load(work.kz, block)
                du, dv, dw = _slope(kx[i], ky[j], kz, scale, products, linear, velocity)
                store_complex(out, at, width, du)
                store_complex(out, at + field, width, dv)
                store_complex(out, at + 2 * field, width, dw)
        if ky[j] == 0:  # the mean flow feels no force
            out[:, 0, 0, 0] = 0


@bare
def _to_lines(mixed, plane, fields, work):
    """Modes in y of a plane to points."""
    n, lanes, rows, x, y = mixed.shape[0], mixed.shape[5], work.rows, work.x[0], work.y[0, 0]
    half = rows.size // 2 + 1
    for c in range(fields):
        target = work.lines[c]
        for block in range(mixed.shape[3]):
            _clear(x, half, n - half + 1, work)
            for j in range(rows.size):
                put(x, rows[j], get(mixed, _place(mixed, plane, c, j, block)))
            next_block, next_c = (block + 1, c) if block + 1 < mixed.shape[3] else (0, c + 1)
            if next_c < fields:
                for j in range(rows.size):
                    _will_read(mixed, _place(mixed, plane, next_c, j, next_block))
            transform(x, y, work.inverse)
            for group in range(target.shape[0]):
                into = 2 * (group * target.shape[1] + block * lanes)
                transpose(y, 2 * group * lanes, 2, target, into, 2)
                transpose(y, 2 * group * lanes + 1, 2, target, into + 1, 2)


@bare
def _from_lines(mixed, plane, fields, work):
    """Points in y of a plane to modes."""
    lanes, rows, x, y = mixed.shape[5], work.rows, work.x[0], work.y[0, 0]
    for c in range(fields):
        source = work.lines[c]
        for block in range(mixed.shape[3]):
            for group in range(source.shape[0]):
                first = 2 * (group * source.shape[1] + block * lanes)
                transpose(source, first, 2, x, 2 * group * lanes, 2)
                transpose(source, first + 1, 2, x, 2 * group * lanes + 1, 2)
            for j in range(rows.size):
                _will_write(mixed, _place(mixed, plane, c, j, block))
            transform(x, y, work.forward)
            for j in range(rows.size):
                put(mixed, _place(mixed, plane, c, j, block), get(y, rows[j]))


@arithmetic
def _joined(a, b):
    """a + i b, and conj a + i conj b."""
    return (a[0] - b[1], a[1] + b[0]), (a[0] + b[1], b[0] - a[1])


@arithmetic
def _parted(p, q):
    """2 a and 2 b from p = a + i b, q = conj a + i conj b."""
    return (p[0] + q[0], p[1] - q[1]), (p[1] + q[1], q[0] - p[0])


@bare
def _to_points(c, pair, n, work, out):
    """out = points along z of field c at two groups of y, as real and imaginary part."""
    x, a, b = work.x[0], work.lines[c, 2 * pair], work.lines[c, 2 * pair + 1]
    half = work.rows.size // 2 + 1
    put(x, 0, (load(a, 0), load(b, 0)))
    for m in range(1, half):
        up, down = _joined(get(a, m), get(b, m))
        put(x, m, up)
        put(x, n - m, down)
    _clear(x, half, n - half + 1, work)
    transform(x, out, work.inverse)


@bare
def _from_points(c, pair, n, work):
    """Twice the modes along z from work.x[0], the inverse of `_to_points`."""
    x, y, a, b = work.x[0], work.y[4, 0], work.lines[c, 2 * pair], work.lines[c, 2 * pair + 1]
    transform(x, y, work.forward)
    for m in range(work.rows.size // 2 + 1):
        mirror = n - m if m > 0 else 0
        one, other = _parted(get(y, m), get(y, mirror))
        put(a, m, one)
        put(b, m, other)


@bare
def _product(c, n, u, v, w, out):
    """u^2 - w^2, v^2 - w^2, uv, uw or vw, whichever c says."""
    if c < 2:
        first = u if c == 0 else v
        for i in range(2 * n):
            a, b = load(first, i), load(w, i)
            store(out, i, a * a - b * b)
    else:
        first, second = (v if c == 4 else u), (v if c == 2 else w)
        for i in range(2 * n):
            store(out, i, load(first, i) * load(second, i))


@arithmetic
def _faster(u, v, w, than):
    """The larger of |u| + |v| + |w| and than; than where one is NaN."""
    return larger(larger(u, -u) + larger(v, -v) + larger(w, -w), than)


@jit
def multiply(mixed, want_speed, work, start, stop):
    """Replace u, v, w by twice u^2 - w^2, v^2 - w^2, uv, uw, vw in the planes from start to stop."""
    n, speed = mixed.shape[0], work.speed
    u, v, w = work.y[0, 0], work.y[1, 0], work.y[2, 0]
    for plane in range(start, stop):
        _to_lines(mixed, plane, 3, work)
        for pair in range(work.lines.shape[1] // 2):
            for c in range(3):
                _to_points(c, pair, n, work, work.y[c, 0])
            if want_speed:
                for i in range(2 * n):
                    store(speed, 0, _faster(load(u, i), load(v, i), load(w, i), load(speed, 0)))
            for c in range(5):
                _product(c, n, u, v, w, work.x[0])
                _from_points(c, pair, n, work)
        _from_lines(mixed, plane, 5, work)


@jit
def to_points(mixed, out, work, start, stop):
    """Points in y and z, too, of fields out (m, n, n, n), in the planes from start to stop."""
    n, lanes = mixed.shape[0], mixed.shape[5]
    for plane in range(start, stop):
        _to_lines(mixed, plane, out.shape[0], work)
        for group in range(-(-n // lanes)):
            part, first = group % 2, group * lanes
            for c in range(out.shape[0]):
                if part == 0:
                    _to_points(c, group // 2, n, work, work.y[c, 0])
                points = work.y[c, 0]
                for s in range(min(lanes, n - first)):
                    for z in range(n):
                        out[c, plane, first + s, z] = points[z, part, s]


@jit
def from_points(fields, mixed, work, start, stop):
    """Twice the modes in y and z of fields (m, n, n, n), in the planes from start to stop."""
    n, lanes, x = mixed.shape[0], mixed.shape[5], work.x[0]
    for plane in range(start, stop):
        for pair in range(work.lines.shape[1] // 2):
            for c in range(fields.shape[0]):
                for part in range(2):
                    first = (2 * pair + part) * lanes
                    width = max(0, min(lanes, n - first))
                    for s in range(width):
                        for z in range(n):
                            x[z, part, s] = fields[c, plane, first + s, z]
                    for s in range(width, lanes):
                        x[:n, part, s] = 0
                _from_points(c, pair, n, work)
        _from_lines(mixed, plane, fields.shape[0], work)


@jit
def loads(modes, out, kx, ky, kz, start, stop):
    """out = P [F + ik x T/2] without its mean, for kx from start to stop; modes: of F, and where there are six of T."""
    for i in range(start, stop):
        for j in range(ky.size):
            a, b = kx[i], ky[j]
            for m in range(kz.size):
                c = kz[m]
                x, y, z = modes[0, i, j, m], modes[1, i, j, m], modes[2, i, j, m]
                if modes.shape[0] == 6:
                    r, s, t = modes[3, i, j, m], modes[4, i, j, m], modes[5, i, j, m]
                    u, v, w = b * t - c * s, c * r - a * t, a * s - b * r
                    x += complex(-u.imag / 2, u.real / 2)
                    y += complex(-v.imag / 2, v.real / 2)
                    z += complex(-w.imag / 2, w.real / 2)
                square = a * a + b * b + c * c
                if square == 0:
                    continue
                q = (a * x + b * y + c * z) / square
                out[0, i, j, m], out[1, i, j, m], out[2, i, j, m] = x - a * q, y - b * q, z - c * q


@jit
def combine(out, arrays, fx, fy, fz, weights, row, energy, start, stop):
    """out = sum_m fx[m] fy[m] fz[m] arrays[m] on real views (3, 2K+1, 2K+1, 2K+2), for kx from start to stop.

    energy (2K+1,) receives sum of weights out^2 of each kx; row is scratch, so that out may be one of the
    arrays.
    """
    for i in range(start, stop):
        total = 0.0
        for c in range(3):
            for j in range(out.shape[2]):
                row[:] = 0
                for m in range(len(arrays)):
                    source, factor, along = arrays[m][c, i, j], fx[m, i] * fy[m, j], fz[m]
                    for s in range(row.size):
                        row[s] += factor * along[s] * source[s]
                target = out[c, i, j]
                for s in range(row.size):
                    target[s] = row[s]
                    total += weights[s] * row[s] * row[s]
        energy[i] = total
