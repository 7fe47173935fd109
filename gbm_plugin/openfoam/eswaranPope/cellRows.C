#include "cellRows.H"
#include "DynamicList.H"
#include "mathematicalConstants.H"

namespace
{

//- Coordinates that differ by less, in units of edge/2 pi, are the same
constexpr Foam::scalar same = 1e-11;

}


// * * * * * * * * * * * * * * * * Constructors  * * * * * * * * * * * * * * //

Foam::cellRows::cellRows(const fvMesh& mesh, const waveSum& modes)
{
    const boundBox& box = mesh.bounds();
    const vectorField x
    (
        (mesh.cellCentres() - box.min())
       *(constant::mathematical::twoPi/box.span().x())
    );

    DynamicList<row> rows;
    forAll(x, celli)
    {
        if
        (
            rows.empty()
         || mag(x[celli].y() - rows.last().y) > same
         || mag(x[celli].z() - rows.last().z) > same
        )
        {
            rows.append(row{celli, 0, x[celli].y(), x[celli].z(), -1});
        }
        ++rows.last().size;
    }

    DynamicList<waveSum::waves> tables;
    const row* last = nullptr;      // that the last table is made for

    for (row& r : rows)
    {
        bool known = (last && last->size == r.size);

        for (label i = 0; known && i < r.size; ++i)
        {
            known = mag(x[r.first + i].x() - x[last->first + i].x()) < same;
        }
        if (!known)
        {
            const SubField<vector> here(x, r.size, r.first);
            tables.append(modes.along(here.component(vector::X)));
            last = &r;
        }
        r.table = tables.size() - 1;
    }

    rows_.transfer(rows);
    waves_.transfer(tables);
}


// * * * * * * * * * * * * * * * Member Functions  * * * * * * * * * * * * * //

void Foam::cellRows::forAllRows
(
    waveSum& modes,
    const UList<amplitude>& amplitudes,
    const use& f
) const
{
    scalarField values[vector::nComponents];
    scalar z = GREAT;

    for (const row& r : rows_)
    {
        if (mag(r.z - z) > same)
        {
            z = r.z;
            modes.toPlane(amplitudes, z);
        }
        modes.toRow(r.y);
        modes.values(waves_[r.table], values);
        f(r.first, values);
    }
}
