#include "latticeSampler.H"
#include "interpolants.H"

template<class Interpolant>
Foam::scalarList Foam::latticeSampler<Interpolant>::sample
(
    const volVectorField& U,
    const ambient wanted,
    const beadExchange& beads
) const
{
    const vectorField& cells = U.primitiveField();
    const List<vector> neighbours(lattice_.gather(cells));
    const vector& perCell = lattice_.box().perCell();

    stencil u
    {
        nullptr, lattice_.strides(), cells.cdata(), neighbours.cdata(),
        cells.size()
    };

    scalarList values(beads.points().size()*(3 + components(wanted)));
    scalar* out = values.begin();

    for (const point& p : beads.points())
    {
        vector x;
        u.slot = lattice_.around(p, x);

        vector d[3];
        const vector velocity
        (
            wanted == NOTHING
          ? Interpolant::value(u, x)
          : Interpolant::gradient(u, x, d)
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

    return values;
}


template class Foam::latticeSampler<Foam::trilinear>;
template class Foam::latticeSampler<Foam::cubic>;
