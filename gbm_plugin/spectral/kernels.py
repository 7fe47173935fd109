"""Compiled point-wise kernels of the slab-wise operators; every one of them runs without Python's lock.

A complex plane Z carries two real planes a, b at once: Z = a + i b. In Fourier space
Z(k) = A(k) + i B(k) and Z(-k) = conj A(k) + i conj B(k); in physical space products are taken on the real
view.
"""

from functools import partial

from ..compiled import kernel

# sums may be reordered and fused; infinities and NaN keep their meaning
jit = partial(kernel, fastmath={"contract", "reassoc", "nsz"})


@jit
def pack(mixed, first, planes, rows):
    """Fill planes (pairs, 5, n, >= n) [0:3] with the modes of the plane pairs (x, x + 1) from x = first on.

    mixed (5, n, 2K+1, K+1): modes in y and z, points in x; rows: where the stored ky lie in a full plane.
    """
    n, stored, half = mixed.shape[1:]
    for pair in range(planes.shape[0]):
        x = first + 2 * pair
        for c in range(3):
            z = planes[pair, c]
            z[half : n - half + 1, :] = 0
            for j in range(stored):
                a, b, up, down = mixed[c, x, j], mixed[c, x + 1, j], z[rows[j]], z[(n - rows[j]) % n]
                up[0] = complex(a[0].real - b[0].imag, a[0].imag + b[0].real)
                up[half : n - half + 1] = 0
                for m in range(1, half):
                    up[m] = complex(a[m].real - b[m].imag, a[m].imag + b[m].real)
                    down[n - m] = complex(a[m].real + b[m].imag, b[m].real - a[m].imag)


@jit
def unpack(planes, mixed, first, rows):
    """The inverse of `pack` for all five products, times -2i."""
    n, stored, half = mixed.shape[1:]
    for pair in range(planes.shape[0]):
        x = first + 2 * pair
        for c in range(mixed.shape[0]):
            z = planes[pair, c]
            for j in range(stored):
                a, b, up, down = mixed[c, x, j], mixed[c, x + 1, j], z[rows[j]], z[(n - rows[j]) % n]
                p, q = up[0], down[0]
                a[0] = complex(p.imag - q.imag, -p.real - q.real)
                b[0] = complex(q.real - p.real, -p.imag - q.imag)
                for m in range(1, half):
                    p, q = up[m], down[n - m]
                    a[m] = complex(p.imag - q.imag, -p.real - q.real)
                    b[m] = complex(q.real - p.real, -p.imag - q.imag)


@jit
def split(planes, first, out):
    """Write the plane pairs to fields out (m <= 3, n, n, n), from x = first on."""
    for pair in range(planes.shape[0]):
        x = first + 2 * pair
        for j in range(out.shape[2]):
            for m in range(out.shape[3]):
                for c in range(out.shape[0]):
                    out[c, x, j, m] = planes[pair, c, j, m].real
                    out[c, x + 1, j, m] = planes[pair, c, j, m].imag


@jit
def join(fields, first, planes):
    """The inverse of `split`; fields beyond those given become 0, up to three."""
    for pair in range(planes.shape[0]):
        x = first + 2 * pair
        for c in range(fields.shape[0], 3):
            planes[pair, c] = 0
        for j in range(fields.shape[2]):
            for m in range(fields.shape[3]):
                for c in range(fields.shape[0]):
                    planes[pair, c, j, m] = complex(fields[c, x, j, m], fields[c, x + 1, j, m])


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
def products(planes, width):
    """Replace u, v, w in planes (pairs, 5, n, *), a real view, by u^2 - w^2, v^2 - w^2, uv, uw, vw."""
    for pair in range(planes.shape[0]):
        for j in range(planes.shape[2]):
            xx, yy, xy = planes[pair, 0, j], planes[pair, 1, j], planes[pair, 2, j]
            xz, yz = planes[pair, 3, j], planes[pair, 4, j]
            for m in range(width):
                u, v, w = xx[m], yy[m], xy[m]
                xx[m] = u * u - w * w
                yy[m] = v * v - w * w
                xy[m] = u * v
                xz[m] = u * w
                yz[m] = v * w


@jit
def max_speed(planes, width):
    """max(|u| + |v| + |w|) over planes (pairs, >= 3, n, *), a real view; NaN is passed over."""
    found = 0.0
    for pair in range(planes.shape[0]):
        for j in range(planes.shape[2]):
            for m in range(width):
                speed = abs(planes[pair, 0, j, m]) + abs(planes[pair, 1, j, m]) + abs(planes[pair, 2, j, m])
                found = max(found, speed)
    return found


@jit
def project(products, u, out, first, last, rows, kx, ky, kz, scale, linear, row):
    """out = P [scale k.products + linear u] at the ky with indices first ... last - 1, on real views.

    products (5, n, columns, >= 2K+2), holding -i times the products at all kx; u, out (3, 2K+1, 2K+1, 2K+2);
    kz (2K+2,); row (3, 2K+2) is scratch. Whole arrays are indexed, not parts of them: only so does the
    compiler see few enough of them to vectorise the loop (3.5 times faster).
    """
    for i in range(u.shape[1]):
        for j in range(first, last):
            a, b, r, t = kx[i], ky[j], rows[i], j - first
            for s in range(kz.size):
                c = kz[s]
                xy, xz, yz = products[2, r, t, s], products[3, r, t, s], products[4, r, t, s]
                x = scale * (a * products[0, r, t, s] + b * xy + c * xz) + linear * u[0, i, j, s]
                y = scale * (a * xy + b * products[1, r, t, s] + c * yz) + linear * u[1, i, j, s]
                z = scale * (a * xz + b * yz) + linear * u[2, i, j, s]
                q = (a * x + b * y + c * z) / (a * a + b * b + c * c)
                row[0, s] = x - a * q
                row[1, s] = y - b * q
                row[2, s] = z - c * q
            if a == 0 and b == 0:  # the mean flow feels no force
                row[:, :2] = 0
            for m in range(3):
                for s in range(kz.size):
                    out[m, i, j, s] = row[m, s]


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
