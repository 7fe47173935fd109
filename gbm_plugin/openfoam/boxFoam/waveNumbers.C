#include "waveNumbers.H"
#include "mathematicalConstants.H"

Foam::waveNumbers::waveNumbers
(
    const differences& D,
    const Vector<label>& n,
    const vector& h
)
{
    for (direction d = 0; d < 3; ++d)
    {
        const label copies = (d == vector::X ? 2 : 1);
        const label size = (d == vector::X ? 2*(n.x()/2 + 1) : n[d]);

        first_[d].setSize(size);
        second_[d].setSize(size);
        resolved_[d].setSize(size);

        for (label i = 0; i < size; ++i)
        {
            const label mode = i/copies;
            const scalar theta = constant::mathematical::twoPi*mode/n[d];

            // rounding would leave something of a derivative that is zero
            resolved_[d][i] = (2*mode != n[d]);
            first_[d][i] = resolved_[d][i] ? D.first(theta)/h[d] : 0;
            second_[d][i] = D.second(theta)/sqr(h[d]);
        }
    }

    weights_.setSize(first_[vector::X].size(), 2.0);
    weights_[0] = weights_[1] = 1;
    if (n.x() % 2 == 0)
    {
        weights_[n.x()] = weights_[n.x() + 1] = 1;
    }
}


Foam::FixedList<Foam::scalarList, 3> Foam::waveNumbers::decay
(
    const scalar s
) const
{
    FixedList<scalarList, 3> factors;

    for (direction d = 0; d < 3; ++d)
    {
        factors[d].setSize(second_[d].size());
        forAll(factors[d], i)
        {
            factors[d][i] = resolved_[d][i] ? Foam::exp(-s*second_[d][i]) : 0;
        }
    }

    return factors;
}
