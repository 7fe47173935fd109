#include "trilinearSampler.H"

namespace
{

using namespace Foam;

//- Cell values by their steps from a slot
struct stencil
{
    const label* slot;
    const Vector<label> stride;
    const vector* cells;
    const vector* neighbours;   // numbered after the cells
    const label nCells;

    const vector& operator()(label i, label j, label k) const
    {
        const label value = slot[i + stride.y()*j + stride.z()*k];

        return value < nCells ? cells[value] : neighbours[value - nCells];
    }
};


//- Velocity between the eight cells around a point
vector velocityAt(const stencil& u, const scalar (&w)[3][2])
{
    vector sum(Zero);

    for (label k = 0; k < 2; ++k)
    for (label j = 0; j < 2; ++j)
    {
        const scalar wjk = w[1][j]*w[2][k];
        sum += wjk*(w[0][0]*u(0, j, k) + w[0][1]*u(1, j, k));
    }

    return sum;
}


//- Velocity and its derivatives d[j] = du/dx_j. Interpolated central
//  differences are differences of four cells in their direction:
//  -(1-w), -w, 1-w, w over 2h.
vector gradientAt
(
    const stencil& u,
    const scalar (&w)[3][2],
    const vector& inverse2h,
    vector (&d)[3]
)
{
    vector sum(Zero);
    d[0] = d[1] = d[2] = Zero;

    for (label k = 0; k < 2; ++k)
    for (label j = 0; j < 2; ++j)
    for (label i = 0; i < 2; ++i)
    {
        // 0: -w of its own, 1: 1-w; the far cell has the other weight
        const vector& centre = u(i, j, k);
        const label si = 2*i - 1, sj = 2*j - 1, sk = 2*k - 1;
        const scalar wi = w[0][i], wj = w[1][j], wk = w[2][k];
        const scalar vi = w[0][1 - i], vj = w[1][1 - j], vk = w[2][1 - k];

        sum += (wi*wj*wk)*centre;
        d[0] += (si*wj*wk)*(vi*centre + wi*u(i + si, j, k));
        d[1] += (sj*wi*wk)*(vj*centre + wj*u(i, j + sj, k));
        d[2] += (sk*wi*wj)*(vk*centre + wk*u(i, j, k + sk));
    }

    for (direction c = 0; c < 3; ++c)
    {
        d[c] *= inverse2h[c];
    }

    return sum;
}

}


Foam::scalarList Foam::trilinearSampler::sample
(
    const volVectorField& U,
    const ambient wanted,
    const UList<point>& points,
    const labelUList&
) const
{
    const vectorField& cells = U.primitiveField();
    const List<vector> neighbours(lattice_->gather(cells));
    const vector inverse2h(cmptDivide(vector::one, 2*lattice_->cellSize()));

    stencil u
    {
        nullptr, lattice_->strides(), cells.cdata(),
        neighbours.cdata(), cells.size()
    };

    scalarList values(points.size()*(3 + components(wanted)));
    scalar* out = values.begin();

    for (const point& p : points)
    {
        vector x;
        u.slot = lattice_->around(p, x);
        const scalar w[3][2] =
        {
            {1 - x.x(), x.x()}, {1 - x.y(), x.y()}, {1 - x.z(), x.z()}
        };

        vector d[3];
        const vector velocity
        (
            wanted == NOTHING
          ? velocityAt(u, w)
          : gradientAt(u, w, inverse2h, d)
        );

        for (direction i = 0; i < 3; ++i)
        {
            *out++ = velocity[i];
        }
        if (wanted == ROTATION)
        {
            *out++ = 0.5*(d[1].z() - d[2].y());
            *out++ = 0.5*(d[2].x() - d[0].z());
            *out++ = 0.5*(d[0].y() - d[1].x());
        }
        else if (wanted == GRADIENT)
        {
            for (direction i = 0; i < 3; ++i)
            for (direction j = 0; j < 3; ++j)
            {
                *out++ = d[j][i];
            }
        }
    }

    return values;
}
