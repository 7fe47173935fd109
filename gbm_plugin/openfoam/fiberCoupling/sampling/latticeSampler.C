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

#define AT(type, numbers) (*reinterpret_cast<type*>(numbers))


//- M numbers in a row, in registers
template<int M>
struct inRow
{
    static_assert(M % 2 == 0, "pairs");

    four most[M/4];
    pair rest;

    //- f a + g b
    INLINE inRow(const double f, const double* a, const double g, const double* b)
    :
        rest{0, 0}
    {
        for (int i = 0; i < M/4; ++i)
        {
            most[i] = f*AT(const four, a + 4*i) + g*AT(const four, b + 4*i);
        }
        if (M % 4)
        {
            rest = f*AT(const pair, a + M - 2) + g*AT(const pair, b + M - 2);
        }
    }

    INLINE void operator+=(const inRow& other)
    {
        for (int i = 0; i < M/4; ++i)
        {
            most[i] += other.most[i];
        }
        rest += other.rest;
    }

    INLINE void store(double* row) const
    {
        for (int i = 0; i < M/4; ++i)
        {
            AT(four, row + 4*i) = most[i];
        }
        if (M % 4)
        {
            AT(pair, row + M - 2) = rest;
        }
    }

    INLINE void addTo(double* row) const
    {
        for (int i = 0; i < M/4; ++i)
        {
            AT(four, row + 4*i) += most[i];
        }
        if (M % 4)
        {
            AT(pair, row + M - 2) += rest;
        }
    }
};


//- What the loads of a bead are to the cells around it: a row of cells along x
//  gets w_y (w_z p + s_z r) + s_y w_z q
template<int N>
struct beadRows
{
    //- Slot of the lowest cell
    label slot;

    //- Weights of value and slope in y and z
    double w[2][N], s[2][N];

    //- Along x: the force with the couple x slope there, and what the slopes
    //  in y and z multiply, couple x e_y and couple x e_z
    double p[3*N], q[3*N], r[3*N];

    template<class Interpolant>
    INLINE void set
    (
        const Interpolant& interpolant,
        const vector& x,
        const vector& perCell,
        const double* load
    )
    {
        double along[N], slope[N];
        interpolant.weights(x.x(), along, slope);
        for (direction d = 0; d < 2; ++d)
        {
            interpolant.weights(x[d + 1], w[d], s[d]);
            for (int m = 0; m < N; ++m)
            {
                s[d][m] *= perCell[d + 1];
            }
        }

        const vector couple(0.5*load[3], 0.5*load[4], 0.5*load[5]);
        for (int m = 0; m < N; ++m)
        {
            const double v = along[m], d = slope[m]*perCell.x();
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
    }
};


//- What 'spread' of sampler gives, in the order of the points
template<class Interpolant>
INLINE void spreadAll
(
    const Interpolant& interpolant,
    const lattice& cells,
    const beadExchange& beads,
    const scalar* loads,
    vectorField& own,
    filledParts& filled,
    vector* neighbours
)
{
    constexpr int N = Interpolant::reach;
    constexpr int below = Interpolant::below;
    constexpr int outer = Interpolant::outer;
    const auto inner = [](const int m)
    {
        return outer <= m && m < N - outer;
    };
    const vector perCell(cells.box().perCell());
    const Vector<label> stride(cells.strides());
    const label lowest = below*(stride.x() + stride.y() + stride.z());
    const label* slots = cells.slots().cdata();
    const unsigned char* runs = cells.runs().cdata();
    const label nCells = own.size();
    const stencil target
    {
        slots, runs, 0, stride, own.cdata(), neighbours, nCells
    };
    const UList<point>& points = beads.points();

    // some beads at a time: their rows are in memory, and their cells have
    // come from there, when they are added
    constexpr label most = 8;
    beadRows<N> some[most];
    label last = -1;

    for (label start = 0; start < points.size(); start += most)
    {
        const label count = min(most, points.size() - start);
        for (label i = 0; i < count; ++i)
        {
            vector x;
            const label around = cells.around(points[start + i], x);
            some[i].slot = around - lowest;
            some[i].set
            (
                interpolant, x, perCell, loads + 6*beads.placeOf(start + i)
            );
            if (some[i].slot != (i ? some[i - 1].slot : last))
            {
                target.template fetch<N>(around, below);
            }
        }

        for (label i = 0, end; i < count; i = end)
        {
            // those between the same cells
            const label slot = some[i].slot;
            for (end = i + 1; end < count && some[end].slot == slot; ++end)
            {}
            const bool opened = slot == last;
            last = slot;

            for (int k = 0; k < N; ++k)
            {
                double a[most][3*N], b[most][3*N];
                for (label n = i; n < end; ++n)
                {
                    const beadRows<N>& bead = some[n];
                    const double v = bead.w[1][k], d = bead.s[1][k];
                    inRow<3*N>(v, bead.p, d, bead.r).store(a[n]);
                    inRow<3*N>(v, bead.q, 0, bead.q).store(b[n]);
                }

                for (int j = 0; j < N; ++j)
                {
                    if (!inner(j) && !inner(k))
                    {
                        continue;
                    }
                    const auto ofBead = [&](const label n)
                    {
                        return inRow<3*N>
                        (
                            some[n].w[0][j], a[n], some[n].s[0][j], b[n]
                        );
                    };
                    inRow<3*N> sum(ofBead(i));
                    for (label n = i + 1; n < end; ++n)
                    {
                        sum += ofBead(n);
                    }

                    const label first = slot + stride.y()*j + stride.z()*k;
                    if (runs[first] >= N)
                    {
                        if (!opened)
                        {
                            filled.open(slots[first], N, own);
                        }
                        sum.addTo(own[slots[first]].v_);
                        continue;
                    }
                    double row[3*N];
                    sum.store(row);
                    for (int m = 0; m < N; ++m)
                    {
                        const label value = slots[first + m];
                        if (value < nCells)
                        {
                            filled.open(value, 1, own);
                        }
                        vector& cell =
                            value < nCells
                          ? own[value] : neighbours[value - nCells];
                        cell += vector(row[3*m], row[3*m + 1], row[3*m + 2]);
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

#undef SPREAD_WITH
#undef AT

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
    filled.begin(cells.size());
    List<vector> neighbours(lattice_.nNeighbours(), Zero);
    spreadWith
    (
        interpolant, lattice_, beads, loads.cdata(), cells, filled,
        neighbours.begin()
    );
    lattice_.addBack(neighbours, cells, filled);
    filled.end(cells);
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
