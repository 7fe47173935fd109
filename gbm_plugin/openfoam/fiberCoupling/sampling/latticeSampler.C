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

    forAll(beads.points(), i)
    {
        scalar* out = values.begin() + n*beads.placeOf(i);
        vector x;
        u.slot = cells.around(beads.points()[i], x);

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

}


template<class Interpolant>
Foam::scalarList Foam::latticeSampler<Interpolant>::sample
(
    const volVectorField& U,
    const ambient wanted,
    const beadExchange& beads
) const
{
    static const Interpolant interpolant = Interpolant();

    const vectorField& cells = U.primitiveField();
    const List<vector> neighbours(lattice_.gather(cells));
    const stencil u
    {
        lattice_.slots().cdata(), lattice_.runs().cdata(), 0,
        lattice_.strides(), cells.cdata(), neighbours.cdata(), cells.size()
    };

    scalarList values(beads.nPlaces()*(3 + components(wanted)));
    sampleWith(interpolant, lattice_, beads, wanted, u, values);

    return values;
}


template class Foam::latticeSampler<Foam::trilinear>;
template class Foam::latticeSampler<Foam::cubic>;
template class Foam::latticeSampler<Foam::quintic>;
