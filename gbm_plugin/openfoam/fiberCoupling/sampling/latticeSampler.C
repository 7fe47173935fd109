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


//- Numbers of a vector unit, anywhere in memory: of short loops the compiler
//  would make single ones
typedef double pair __attribute__((vector_size(16), aligned(8), may_alias));
typedef double four __attribute__((vector_size(32), aligned(8), may_alias));


//- target (+)= f a + g b
template<int M, bool add>
INLINE void combine
(
    double* target,
    const double f,
    const double* a,
    const double g,
    const double* b
)
{
    #define COMBINE(type, i)                                                   \
    {                                                                          \
        type& t = reinterpret_cast<type&>(target[i]);                          \
        const type sum =                                                       \
            f*reinterpret_cast<const type&>(a[i])                              \
          + g*reinterpret_cast<const type&>(b[i]);                             \
        t = add ? t + sum : sum;                                               \
    }
    static_assert(M % 2 == 0, "pairs");
    for (int i = 0; i + 4 <= M; i += 4) COMBINE(four, i)
    if (M % 4) COMBINE(pair, M - 2)
    #undef COMBINE
}


//- The N^3 cells from a slot on, as far as they are local, will be added to
template<int N>
INLINE void mark
(
    const lattice& cells,
    const label slot,
    const label nCells,
    filledParts& filled
)
{
    const Vector<label> stride(cells.strides());
    const label* slots = cells.slots().cdata();
    const unsigned char* runs = cells.runs().cdata();

    for (int k = 0; k < N; ++k)
    for (int j = 0; j < N; ++j)
    {
        const label first = slot + stride.y()*j + stride.z()*k;
        if (runs[first] >= N)
        {
            filled.mark(slots[first], N);
            continue;
        }
        for (int m = 0; m < N; ++m)
        {
            const label celli = slots[first + m];
            if (celli >= 0 && celli < nCells)
            {
                filled.mark(celli, 1);
            }
        }
    }
}


//- What 'spread' of sampler gives, in the order of the points
template<class Interpolant>
INLINE void spreadAll
(
    const Interpolant& interpolant,
    const lattice& cells,
    const beadExchange& beads,
    const scalar* loads,
    vectorField& field,
    filledParts& filled,
    vector* neighbours
)
{
    vector* own = field.begin();
    const label nCells = field.size();
    constexpr int N = Interpolant::reach;
    constexpr int below = Interpolant::below;
    constexpr int outer = Interpolant::outer;
    const auto weighted = [](const int m)
    {
        return outer <= m && m < N - outer;
    };
    const vector perCell(cells.box().perCell());
    const Vector<label> stride(cells.strides());
    const label* slots = cells.slots().cdata();
    const unsigned char* runs = cells.runs().cdata();
    const stencil target{slots, runs, 0, stride, own, neighbours, nCells};

    const UList<point>& points = beads.points();
    vector next;
    label nextSlot = points.size() ? cells.around(points[0], next) : 0;
    label marked = -1;

    forAll(points, bead)
    {
        const vector x(next);
        const label slot =
            nextSlot - below*(stride.x() + stride.y() + stride.z());
        if (bead + 1 < points.size())
        {
            nextSlot = cells.around(points[bead + 1], next);
            target.template fetch<N>(nextSlot, below);
        }

        if (slot != marked)
        {
            mark<N>(cells, slot, nCells, filled);
            marked = slot;
        }

        double w[3][N], s[3][N];
        for (direction d = 0; d < 3; ++d)
        {
            interpolant.weights(x[d], w[d], s[d]);
            for (int m = 0; m < N; ++m)
            {
                s[d][m] *= perCell[d];
            }
        }
        const scalar* load = loads + 6*beads.placeOf(bead);
        const vector couple(0.5*load[3], 0.5*load[4], 0.5*load[5]);

        // along x: the force with the couple x slope there, and what the
        // slopes in y and z multiply, couple x e_y and couple x e_z
        double p[3*N], q[3*N], r[3*N];
        for (int m = 0; m < N; ++m)
        {
            const double v = w[0][m], d = s[0][m];
            p[3*m] = v*load[0];
            p[3*m + 1] = v*load[1] + d*couple.z();
            p[3*m + 2] = v*load[2] - d*couple.y();
            q[3*m] = -v*couple.z();
            q[3*m + 1] = 0;
            q[3*m + 2] = v*couple.x();
            r[3*m] = v*couple.y();
            r[3*m + 1] = -v*couple.x();
            r[3*m + 2] = 0;
        }

        for (int k = 0; k < N; ++k)
        {
            double a[3*N], b[3*N];
            combine<3*N, false>(a, w[2][k], p, s[2][k], r);
            combine<3*N, false>(b, w[2][k], q, 0, q);

            for (int j = 0; j < N; ++j)
            {
                if (!weighted(j) && !weighted(k))
                {
                    continue;
                }
                const label first = slot + stride.y()*j + stride.z()*k;

                if (runs[first] >= N)
                {
                    combine<3*N, true>
                    (
                        own[slots[first]].v_, w[1][j], a, s[1][j], b
                    );
                    continue;
                }
                for (int m = 0; m < N; ++m)
                {
                    const label value = slots[first + m];
                    vector& cell =
                        value < nCells ? own[value] : neighbours[value - nCells];
                    for (int c = 0; c < 3; ++c)
                    {
                        cell[c] += w[1][j]*a[3*m + c] + s[1][j]*b[3*m + c];
                    }
                }
            }
        }
    }
}

#define SPREAD_WITH(interpolation)                                             \
VECTORISED                                                                     \
void spreadWith                                                                \
(                                                                              \
    const interpolation& interpolant, const lattice& cells,                    \
    const beadExchange& beads, const scalar* loads, vectorField& own,          \
    filledParts& filled, vector* neighbours                                    \
)                                                                              \
{                                                                              \
    spreadAll(interpolant, cells, beads, loads, own, filled, neighbours);      \
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
    vectorField& cells,
    filledParts& filled
) const
{
    static const Interpolant interpolant = Interpolant();

    cells.setSize(lattice_.nCells());
    filled.clear(cells);
    List<vector> neighbours(lattice_.nNeighbours(), Zero);
    spreadWith
    (
        interpolant, lattice_, beads, loads.cdata(), cells, filled,
        neighbours.begin()
    );
    lattice_.addBack(neighbours, cells, filled);
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
