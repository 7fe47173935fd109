#include "latticeSampler.H"
#include "interpolants.H"

namespace
{

using namespace Foam;

//- What 'sample' of sampler gives, for all points
template<class Interpolant>
INLINE void sampleAll
(
    const Interpolant& interpolant,
    const lattice& cells,
    const beadExchange& beads,
    const ambient wanted,
    stencil u,
    scalarList& values
)
{
    const vector perCell(cells.box().perCell());
    const label n = 3 + components(wanted);

    const UList<point>& points = beads.points();
    vector next;
    label nextSlot = points.size() ? cells.around(points[0], next) : 0;

    forAll(points, i)
    {
        scalar* out = values.begin() + n*beads.placeOf(i);
        const vector x(next);
        u.slot = nextSlot;
        if (i + 1 < points.size())
        {
            nextSlot = cells.around(points[i + 1], next);
            interpolant.fetch(u, nextSlot);
        }

        vector d[3];
        const vector velocity
        (
            wanted == NOTHING
          ? interpolant.value(u, x)
          : interpolant.gradient(u, x, d)
        );

        out = std::copy_n(velocity.cdata(), 3, out);
        for (direction j = 0; wanted != NOTHING && j < 3; ++j)
        {
            d[j] *= perCell[j];
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
}


VECTORISED
void sampleWith
(
    const trilinear& interpolant, const lattice& cells,
    const beadExchange& beads, ambient wanted, const stencil& u, scalarList& values
)
{
    sampleAll(interpolant, cells, beads, wanted, u, values);
}


VECTORISED
void sampleWith
(
    const cubic& interpolant, const lattice& cells,
    const beadExchange& beads, ambient wanted, const stencil& u, scalarList& values
)
{
    sampleAll(interpolant, cells, beads, wanted, u, values);
}


VECTORISED
void sampleWith
(
    const quintic& interpolant, const lattice& cells,
    const beadExchange& beads, ambient wanted, const stencil& u, scalarList& values
)
{
    sampleAll(interpolant, cells, beads, wanted, u, values);
}


//- What 'spread' of sampler gives, in the order of the points
template<class Interpolant>
INLINE void spreadAll
(
    const Interpolant& interpolant,
    const lattice& cells,
    const beadExchange& beads,
    const scalar* loads,
    vector* own,
    vector* neighbours,
    const label nCells
)
{
    constexpr int N = Interpolant::reach;
    constexpr int below = Interpolant::below;
    const vector perCell(cells.box().perCell());
    const Vector<label> stride(cells.strides());
    const label* slots = cells.slots().cdata();
    const unsigned char* runs = cells.runs().cdata();

    forAll(beads.points(), bead)
    {
        const scalar* load = loads + 6*beads.placeOf(bead);
        vector x;
        const label slot =
            cells.around(beads.points()[bead], x)
          - below*(stride.x() + stride.y() + stride.z());

        double w[3][N], s[3][N];
        for (direction d = 0; d < 3; ++d)
        {
            interpolant.weights(x[d], w[d], s[d]);
            for (int m = 0; m < N; ++m)
            {
                s[d][m] *= perCell[d];
            }
        }
        const vector force(load[0], load[1], load[2]);
        const vector couple(0.5*load[3], 0.5*load[4], 0.5*load[5]);

        for (int k = 0; k < N; ++k)
        for (int j = 0; j < N; ++j)
        {
            // couple x slopes, by its part of the weights and slopes in x
            const double yz = w[1][j]*w[2][k];
            const vector slopes(0, s[1][j]*w[2][k], w[1][j]*s[2][k]);
            if (yz == 0 && slopes.y() == 0 && slopes.z() == 0)
            {
                continue;
            }
            const vector byValue(yz*force + (couple ^ slopes));
            const vector bySlope(0, yz*couple.z(), -yz*couple.y());
            const label first = slot + stride.y()*j + stride.z()*k;
            const label* values = slots + first;

            double row[3*N];
            for (int i = 0; i < N; ++i)
            for (direction c = 0; c < 3; ++c)
            {
                row[3*i + c] = w[0][i]*byValue[c] + s[0][i]*bySlope[c];
            }
            if (runs[first] >= N)
            {
                double* target = own[values[0]].v_;
                for (int i = 0; i < 3*N; ++i)
                {
                    target[i] += row[i];
                }
                continue;
            }
            for (int i = 0; i < N; ++i)
            {
                const label value = values[i];
                vector& target =
                    value < nCells ? own[value] : neighbours[value - nCells];
                target += vector(row[3*i], row[3*i + 1], row[3*i + 2]);
            }
        }
    }
}

#define SPREAD_WITH(interpolation)                                             \
VECTORISED                                                                     \
void spreadWith                                                                \
(                                                                              \
    const interpolation& interpolant, const lattice& cells,                    \
    const beadExchange& beads, const scalar* loads, vector* own,               \
    vector* neighbours, const label nCells                                     \
)                                                                              \
{                                                                              \
    spreadAll(interpolant, cells, beads, loads, own, neighbours, nCells);      \
}

SPREAD_WITH(trilinear)
SPREAD_WITH(cubic)
SPREAD_WITH(quintic)

}


template<class Interpolant>
void Foam::latticeSampler<Interpolant>::spread
(
    const UList<scalar>& loads,
    const beadExchange& beads,
    vectorField& cells
) const
{
    static const Interpolant interpolant = Interpolant();

    cells.setSize(lattice_.nCells());
    cells = Zero;
    List<vector> neighbours(lattice_.nNeighbours(), Zero);
    spreadWith
    (
        interpolant, lattice_, beads, loads.cdata(), cells.begin(),
        neighbours.begin(), cells.size()
    );
    lattice_.addBack(neighbours, cells);
}


template<class Interpolant>
void Foam::latticeSampler<Interpolant>::look(const volVectorField& U)
{
    cells_.shallowCopy(U.primitiveField());
    neighbours_ = lattice_.gather(U.primitiveField());
}


template<class Interpolant>
Foam::scalarList Foam::latticeSampler<Interpolant>::sample
(
    const ambient wanted,
    const beadExchange& beads
) const
{
    static const Interpolant interpolant = Interpolant();

    const stencil u
    {
        lattice_.slots().cdata(), lattice_.runs().cdata(), 0,
        lattice_.strides(), cells_.cdata(), neighbours_.cdata(), cells_.size()
    };

    scalarList values(beads.nPlaces()*(3 + components(wanted)));
    sampleWith(interpolant, lattice_, beads, wanted, u, values);

    return values;
}


template class Foam::latticeSampler<Foam::trilinear>;
template class Foam::latticeSampler<Foam::cubic>;
template class Foam::latticeSampler<Foam::quintic>;
