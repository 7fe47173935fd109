#include "waveSum.H"
#include "DynamicList.H"
#include "mathematicalConstants.H"

namespace
{

using namespace Foam;

//- Cell centres that differ by less, in units of edge/2 pi, are in one row
constexpr scalar same = 1e-11;


//- exp(i k x) for -reach <= k <= reach
List<complex> waves(const label reach, const scalar x)
{
    List<complex> w(2*reach + 1);

    forAll(w, i)
    {
        const scalar angle = (i - reach)*x;
        w[i] = complex(std::cos(angle), std::sin(angle));
    }
    return w;
}

}


// * * * * * * * * * * * * * * * * Constructors  * * * * * * * * * * * * * * //

Foam::waveSum::waveSum(const fvMesh& mesh, const UList<labelVector>& k)
:
    reach_(0)
{
    const boundBox& box = mesh.bounds();

    findColumns(k);
    findRows
    (
        (mesh.cellCentres() - box.min())
       *(constant::mathematical::twoPi/box.span().x())
    );
}


// * * * * * * * * * * * * * Private Member Functions  * * * * * * * * * * * //

void Foam::waveSum::findColumns(const UList<labelVector>& k)
{
    DynamicList<column> columns;
    modes_.setSize(k.size());

    forAll(k, i)
    {
        const bool conjugate = (k[i].x() < 0);
        const labelVector q(conjugate ? -k[i] : k[i]);
        reach_ = max(reach_, cmptMax(cmptMag(q)));

        label c = 0;
        while
        (
            c < columns.size()
         && (columns[c].kx != q.x() || columns[c].ky != q.y())
        )
        {
            ++c;
        }
        if (c == columns.size())
        {
            columns.append(column{q.x(), q.y()});
        }
        modes_[i] = {conjugate, c, q.z()};
    }
    columns_.transfer(columns);
}


void Foam::waveSum::findRows(const vectorField& x)
{
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
    rows_.transfer(rows);

    DynamicList<List<scalarField>> tables;
    label last = -1;    // the row that the last table is made for

    forAll(rows_, r)
    {
        const label n = rows_[r].size;
        const SubField<vector> here(x, n, rows_[r].first);
        bool known = (last >= 0 && rows_[last].size == n);

        for (label i = 0; known && i < n; ++i)
        {
            known = mag(here[i].x() - x[rows_[last].first + i].x()) < same;
        }

        if (!known)
        {
            last = r;
            tables.append(table(scalarField(here.component(vector::X))));
        }
        rows_[r].table = tables.size() - 1;
    }
    tables_.transfer(tables);
}


Foam::List<Foam::scalarField> Foam::waveSum::table(const scalarField& x) const
{
    List<scalarField> values(2*reach_);

    for (label k = 1; k <= reach_; ++k)
    {
        const scalarField angle(k*x);
        values[2*k - 2] = cos(angle);
        values[2*k - 1] = sin(angle);
    }
    return values;
}


void Foam::waveSum::sumColumns
(
    const UList<amplitude>& amplitudes,
    const scalar z,
    List<amplitude>& columns
) const
{
    const List<complex> w(waves(reach_, z));

    columns = amplitude{Zero, Zero};
    forAll(modes_, i)
    {
        amplitude a(amplitudes[i]);
        if (modes_[i].conjugate)
        {
            a.im = -a.im;
        }
        columns[modes_[i].column].add(w[modes_[i].kz + reach_], a);
    }
}


void Foam::waveSum::sumLines
(
    const UList<amplitude>& columns,
    const scalar y,
    List<amplitude>& lines
) const
{
    const List<complex> w(waves(reach_, y));

    lines = amplitude{Zero, Zero};
    forAll(columns_, c)
    {
        lines[columns_[c].kx].add(w[columns_[c].ky + reach_], columns[c]);
    }
}


void Foam::waveSum::sumRow
(
    const UList<amplitude>& lines,
    const List<scalarField>& table,
    const label size,
    scalarField (&values)[vector::nComponents]
) const
{
    for (direction d = 0; d < vector::nComponents; ++d)
    {
        values[d].setSize(size);
        values[d] = 2*lines[0].re[d];
        scalar* __restrict__ v = values[d].begin();

        for (label k = 1; k <= reach_; ++k)
        {
            const scalar* __restrict__ cosine = table[2*k - 2].cdata();
            const scalar* __restrict__ sine = table[2*k - 1].cdata();
            const scalar re = 2*lines[k].re[d];
            const scalar im = 2*lines[k].im[d];

            for (label i = 0; i < size; ++i)
            {
                v[i] += re*cosine[i] - im*sine[i];
            }
        }
    }
}


// * * * * * * * * * * * * * * * Member Functions  * * * * * * * * * * * * * //

void Foam::waveSum::sum(const UList<amplitude>& amplitudes, const use& f) const
{
    List<amplitude> columns(columns_.size());
    List<amplitude> lines(reach_ + 1);
    scalarField values[vector::nComponents];
    scalar z = GREAT;

    for (const row& r : rows_)
    {
        if (mag(r.z - z) > same)
        {
            z = r.z;
            sumColumns(amplitudes, z, columns);
        }
        sumLines(columns, r.y, lines);
        sumRow(lines, tables_[r.table], r.size, values);
        f(r.first, values);
    }
}


void Foam::waveSum::sum
(
    const UList<amplitude>& amplitudes,
    const latticeLayer& layer,
    const use& f
) const
{
    const auto centre = [&](const label i, const direction d)
    {
        return constant::mathematical::twoPi*(i + 0.5)/layer.n[d];
    };

    if (layerTable_.empty())
    {
        scalarField x(layer.n.x());
        forAll(x, i)
        {
            x[i] = centre(i, vector::X);
        }
        layerTable_ = table(x);
    }

    List<amplitude> columns(columns_.size());
    List<amplitude> lines(reach_ + 1);
    scalarField values[vector::nComponents];

    sumColumns(amplitudes, centre(layer.k, vector::Z), columns);
    for (label y = 0; y < layer.n.y(); ++y)
    {
        sumLines(columns, centre(y, vector::Y), lines);
        sumRow(lines, layerTable_, layer.n.x(), values);
        f(y, values);
    }
}
