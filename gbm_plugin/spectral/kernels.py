"""Compiled point-wise kernels of the slab-wise operators; every one of them runs without Python's lock.

A complex plane Z carries two real planes a, b at once: Z = a + i b. In Fourier space
Z(k) = A(k) + i B(k) and Z(-k) = conj A(k) + i conj B(k); in physical space products are taken on the real
view.
"""

from numba import njit

# sums may be reordered and fused; infinities and NaN keep their meaning
jit = njit(nogil=True, cache=True, fastmath={"contract", "reassoc", "nsz"})


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
def unpack(planes, mixed, first, rows, scale):
    """The inverse of `pack`, for all five products, times scale."""
    n, stored, half = mixed.shape[1:]
    s = scale / 2
    for pair in range(planes.shape[0]):
        x = first + 2 * pair
        for c in range(mixed.shape[0]):
            z = planes[pair, c]
            for j in range(stored):
                a, b, up, down = mixed[c, x, j], mixed[c, x + 1, j], z[rows[j]], z[(n - rows[j]) % n]
                p, q = up[0], down[0]
                a[0] = complex(s * (p.real + q.real), s * (p.imag - q.imag))
                b[0] = complex(s * (p.imag + q.imag), s * (q.real - p.real))
                for m in range(1, half):
                    p, q = up[m], down[n - m]
                    a[m] = complex(s * (p.real + q.real), s * (p.imag - q.imag))
                    b[m] = complex(s * (p.imag + q.imag), s * (q.real - p.real))


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
def project(products, u, out, rows, kx, ky, kz, linear):
    """out = P [-i k.T + linear u] for one ky: products (5, n, K+1) with all kx, u and out (3, 2K+1, K+1)."""
    for i in range(u.shape[1]):
        xx, yy, xy = products[0, rows[i]], products[1, rows[i]], products[2, rows[i]]
        xz, yz = products[3, rows[i]], products[4, rows[i]]
        ux, uy, uz, x, y, z = u[0, i], u[1, i], u[2, i], out[0, i], out[1, i], out[2, i]
        a, b = kx[i], ky
        for m in range(u.shape[2]):
            c = kz[m]
            # -i (p + i q) = q - i p
            fxr = a * xx[m].imag + b * xy[m].imag + c * xz[m].imag + linear * ux[m].real
            fxi = linear * ux[m].imag - a * xx[m].real - b * xy[m].real - c * xz[m].real
            fyr = a * xy[m].imag + b * yy[m].imag + c * yz[m].imag + linear * uy[m].real
            fyi = linear * uy[m].imag - a * xy[m].real - b * yy[m].real - c * yz[m].real
            fzr = a * xz[m].imag + b * yz[m].imag + linear * uz[m].real
            fzi = linear * uz[m].imag - a * xz[m].real - b * yz[m].real
            k_squared = a * a + b * b + c * c
            inverse = 1 / k_squared if k_squared > 0 else k_squared
            qr = (a * fxr + b * fyr + c * fzr) * inverse
            qi = (a * fxi + b * fyi + c * fzi) * inverse
            x[m] = complex(fxr - a * qr, fxi - a * qi)
            y[m] = complex(fyr - b * qr, fyi - b * qi)
            z[m] = complex(fzr - c * qr, fzi - c * qi)
        if a == 0 and b == 0:
            x[0] = y[0] = z[0] = 0  # the mean flow feels no force


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
