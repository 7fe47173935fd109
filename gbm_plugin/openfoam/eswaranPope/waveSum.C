#include "waveSum.H"
#include "vectorised.H"
#include "DynamicList.H"

namespace
{

using namespace Foam;

//- Waves that are summed in one pass
constexpr label few = 4;


//- f += sum c[2 k] wave[2 k] - c[2 k + 1] wave[2 k + 1]
template<label N>
INLINE void addFew
(
    const label n,
    const double* __restrict__ c,
    const double* const* __restrict__ wave,
    double* __restrict__ f
)
{
    for (label i = 0; i < n; ++i)
    {
        double sum = 0;

        #pragma GCC unroll 4
        for (label k = 0; k < N; ++k)
        {
            sum += c[2*k]*wave[2*k][i] - c[2*k + 1]*wave[2*k + 1][i];
        }
        f[i] += sum;
    }
}


VECTORISED
void addWaves
(
    const label n,
    const label waves,
    const double* c,
    const double* const* wave,
    double* f
)
{
    switch (waves)
    {
        case 1: addFew<1>(n, c, wave, f); break;
        case 2: addFew<2>(n, c, wave, f); break;
        case 3: addFew<3>(n, c, wave, f); break;
        default: addFew<few>(n, c, wave, f);
    }
}

}


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

        for (label first = 1; first <= reach_; first += few)
        {
            const label waves = min(few, reach_ + 1 - first);
            const double* wave[2*few];
            double c[2*few];

            for (label k = 0; k < waves; ++k)
            {
                c[2*k] = 2*lines_[first + k].re[d];
                c[2*k + 1] = 2*lines_[first + k].im[d];
                wave[2*k] = table[2*(first + k) - 2].cdata();
                wave[2*k + 1] = table[2*(first + k) - 1].cdata();
            }
            addWaves(f[d].size(), waves, c, wave, f[d].begin());
        }
    }
}
