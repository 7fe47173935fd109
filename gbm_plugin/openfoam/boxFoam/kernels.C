#include "kernels.H"
#include "vectorised.H"

#include <algorithm>
#include <cmath>

namespace
{

using Foam::label;
using namespace Foam::kernels;

//- With s = a (u_j(+-m) + u_j), half of what the two forms of convection in
//  direction j share: d_j(u_j u_i) + u_j d_j u_i = 2 sum (+-) s u_i(+-m)
template<int M>
INLINE void convectRow
(
    const label n,
    const neighbourhood& around,
    const coefficients& D,
    double* const (&rate)[3],
    double* __restrict__ divergence
)
{
    const neighbourhood u(around);
    const coefficients a(D);
    double* __restrict__ r0 = rate[0];
    double* __restrict__ r1 = rate[1];
    double* __restrict__ r2 = rate[2];
    constexpr int O = maxReach;

    #pragma GCC ivdep
    for (label x = 0; x < n; ++x)
    {
        const double u0 = u.y[0][O][x];
        const double u1 = u.y[1][O][x];
        const double u2 = u.y[2][O][x];
        double s0 = 0, s1 = 0, s2 = 0, d = 0;

        #pragma GCC unroll 3
        for (int m = 1; m <= M; ++m)
        {
            {
                const double p = u.y[0][O][x + m];
                const double q = u.y[0][O][x - m];
                const double sp = a.a[0][m - 1]*(p + u0);
                const double sq = a.a[0][m - 1]*(q + u0);
                s0 += sp*p - sq*q;
                s1 += sp*u.y[1][O][x + m] - sq*u.y[1][O][x - m];
                s2 += sp*u.y[2][O][x + m] - sq*u.y[2][O][x - m];
                d += sp - sq;
            }
            {
                const double p = u.y[1][O + m][x];
                const double q = u.y[1][O - m][x];
                const double sp = a.a[1][m - 1]*(p + u1);
                const double sq = a.a[1][m - 1]*(q + u1);
                s0 += sp*u.y[0][O + m][x] - sq*u.y[0][O - m][x];
                s1 += sp*p - sq*q;
                s2 += sp*u.y[2][O + m][x] - sq*u.y[2][O - m][x];
                d += sp - sq;
            }
            {
                const double p = u.z[2][O + m][x];
                const double q = u.z[2][O - m][x];
                const double sp = a.a[2][m - 1]*(p + u2);
                const double sq = a.a[2][m - 1]*(q + u2);
                s0 += sp*u.z[0][O + m][x] - sq*u.z[0][O - m][x];
                s1 += sp*u.z[1][O + m][x] - sq*u.z[1][O - m][x];
                s2 += sp*p - sq*q;
                d += sp - sq;
            }
        }

        r0[x] = -s0;
        r1[x] = -s1;
        r2[x] = -s2;
        divergence[x] = 2*d;
    }
}

//- Partial sums side by side, which vectorise
constexpr label lanes = 8;

}


namespace
{

VECTORISED
void convect1
(
    label n, const neighbourhood& u, const coefficients& D,
    double* const (&rate)[3], double* divergence
)
{
    convectRow<1>(n, u, D, rate, divergence);
}

VECTORISED
void convect2
(
    label n, const neighbourhood& u, const coefficients& D,
    double* const (&rate)[3], double* divergence
)
{
    convectRow<2>(n, u, D, rate, divergence);
}

VECTORISED
void convect3
(
    label n, const neighbourhood& u, const coefficients& D,
    double* const (&rate)[3], double* divergence
)
{
    convectRow<3>(n, u, D, rate, divergence);
}

}


void Foam::kernels::convect
(
    const label reach,
    const label n,
    const neighbourhood& u,
    const coefficients& D,
    double* const (&rate)[3],
    double* divergence
)
{
    (reach == 1 ? convect1 : reach == 2 ? convect2 : convect3)
    (
        n, u, D, rate, divergence
    );
}


VECTORISED
void Foam::kernels::courant
(
    const label n,
    const double* const (&u)[3],
    const double (&perCell)[3],
    double& largest,
    double& sum
)
{
    double most[lanes] = {}, total[lanes] = {};

    const auto add = [&](const label x, const label lane)
    {
        const double c =
            std::abs(u[0][x])*perCell[0]
          + std::abs(u[1][x])*perCell[1]
          + std::abs(u[2][x])*perCell[2];
        most[lane] = c > most[lane] ? c : most[lane];
        total[lane] += c;
    };

    label x = 0;
    for (; x + lanes <= n; x += lanes)
    {
        for (label lane = 0; lane < lanes; ++lane)
        {
            add(x + lane, lane);
        }
    }
    for (; x < n; ++x)
    {
        add(x, 0);
    }
    for (label lane = 0; lane < lanes; ++lane)
    {
        largest = std::max(largest, most[lane]);
        sum += total[lane];
    }
}


VECTORISED
void Foam::kernels::sums
(
    const label n,
    const double* values,
    double& magnitudes,
    double& plain
)
{
    double a[lanes] = {}, b[lanes] = {};

    label x = 0;
    for (; x + lanes <= n; x += lanes)
    {
        for (label lane = 0; lane < lanes; ++lane)
        {
            a[lane] += std::abs(values[x + lane]);
            b[lane] += values[x + lane];
        }
    }
    for (; x < n; ++x)
    {
        a[0] += std::abs(values[x]);
        b[0] += values[x];
    }
    for (label lane = 0; lane < lanes; ++lane)
    {
        magnitudes += a[lane];
        plain += b[lane];
    }
}


VECTORISED
void Foam::kernels::project
(
    const label width,
    double* const (&v)[3],
    const double* kx,
    const double ky,
    const double kz
)
{
    double* __restrict__ v0 = v[0];
    double* __restrict__ v1 = v[1];
    double* __restrict__ v2 = v[2];

    // where k' is zero, so is what is divided by it
    const double rest = ky*ky + kz*kz + 1e-300;

    #pragma GCC ivdep
    for (label i = 0; i < width; ++i)
    {
        const double s =
            (kx[i]*v0[i] + ky*v1[i] + kz*v2[i])/(kx[i]*kx[i] + rest);
        v0[i] -= kx[i]*s;
        v1[i] -= ky*s;
        v2[i] -= kz*s;
    }
}


VECTORISED
void Foam::kernels::advance
(
    const label width,
    const double* const (&decay)[3],
    const double scale,
    const double (&factor)[3],
    double* __restrict__ n,
    double* __restrict__ u,
    const double* __restrict__ slope1,
    double* __restrict__ slope2
)
{
    const double* __restrict__ e0 = decay[0];
    const double* __restrict__ e1 = decay[1];
    const double* __restrict__ e2 = decay[2];
    const double f0 = factor[0], f1 = factor[1], f2 = factor[2];

    for (label i = 0; i < width; ++i)
    {
        const double rate = n[i];
        const double v =
            e0[i]*(scale*u[i] + f0*rate)
          + f1*e1[i]*slope1[i]
          + f2*e2[i]*slope2[i];
        slope2[i] = rate;
        u[i] = v;
        n[i] = v;
    }
}


void Foam::kernels::combine
(
    const label width,
    const std::initializer_list<term> terms,
    double* u
)
{
    for (label i = 0; i < width; ++i)
    {
        double sum = 0;
        for (const term& t : terms)
        {
            sum += t.factor*t.decay[i]*t.row[i];
        }
        u[i] = sum;
    }
}


VECTORISED
void Foam::kernels::tally
(
    const label width,
    const double* const (&u)[3],
    const double first,
    const double second,
    double* __restrict__ energy,
    double* __restrict__ firsts,
    double* __restrict__ seconds
)
{
    const double* __restrict__ u0 = u[0];
    const double* __restrict__ u1 = u[1];
    const double* __restrict__ u2 = u[2];

    for (label i = 0; i < width; ++i)
    {
        const double e = u0[i]*u0[i] + u1[i]*u1[i] + u2[i]*u2[i];
        energy[i] += e;
        firsts[i] += e*first;
        seconds[i] += e*second;
    }
}
