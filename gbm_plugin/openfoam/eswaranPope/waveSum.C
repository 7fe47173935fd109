#include "waveSum.H"
#include "DynamicList.H"

// * * * * * * * * * * * * * * * * Constructors  * * * * * * * * * * * * * * //

Foam::waveSum::waveSum(const UList<labelVector>& k)
:
    reach_(0),
    modes_(k.size())
{
    DynamicList<column> columns;

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
            columns.append(column{q.x(), q.y(), {Zero, Zero}});
        }
        modes_[i] = {conjugate, c, q.z()};
    }
    columns_.transfer(columns);
    lines_.setSize(reach_ + 1);
    powers_.setSize(2*reach_ + 1);
}


// * * * * * * * * * * * * * Private Member Functions  * * * * * * * * * * * //

void Foam::waveSum::setPowers(const scalar x)
{
    const complex first(std::cos(x), std::sin(x));
    complex* const w = powers_.begin() + reach_;

    w[0] = complex(1, 0);
    for (label k = 1; k <= reach_; ++k)
    {
        w[k] = w[k - 1]*first;
        w[-k] = w[k].conjugate();
    }
}


// * * * * * * * * * * * * * * * Member Functions  * * * * * * * * * * * * * //

Foam::waveSum::waves Foam::waveSum::along(const scalarField& x) const
{
    waves table(2*reach_);

    for (label k = 1; k <= reach_; ++k)
    {
        table[2*k - 2] = cos(k*x);
        table[2*k - 1] = sin(k*x);
    }
    return table;
}


void Foam::waveSum::toPlane(const UList<amplitude>& amplitudes, const scalar z)
{
    setPowers(z);

    for (column& c : columns_)
    {
        c.sum = {Zero, Zero};
    }
    forAll(modes_, i)
    {
        amplitude a(amplitudes[i]);
        if (modes_[i].conjugate)
        {
            a.im = -a.im;
        }
        columns_[modes_[i].column].sum.add(powers_[modes_[i].kz + reach_], a);
    }
}


void Foam::waveSum::toRow(const scalar y)
{
    setPowers(y);

    lines_ = amplitude{Zero, Zero};
    for (const column& c : columns_)
    {
        lines_[c.kx].add(powers_[c.ky + reach_], c.sum);
    }
}


void Foam::waveSum::values
(
    const waves& table,
    scalarField (&f)[vector::nComponents]
) const
{
    for (direction d = 0; d < vector::nComponents; ++d)
    {
        f[d].setSize(table[0].size());
        f[d] = 2*lines_[0].re[d];

        double* __restrict__ v = f[d].begin();

        for (label k = 1; k <= reach_; ++k)
        {
            const double* __restrict__ cosine = table[2*k - 2].cdata();
            const double* __restrict__ sine = table[2*k - 1].cdata();
            const double re = 2*lines_[k].re[d];
            const double im = 2*lines_[k].im[d];

            forAll(f[d], i)
            {
                v[i] += re*cosine[i] - im*sine[i];
            }
        }
    }
}
