#include "adamsBashforth3.H"
#include "kernels.H"

// * * * * * * * * * * * * * Private Member Functions  * * * * * * * * * * * //

void Foam::adamsBashforth3::adamsBashforth(const scalar h)
{
    const scalar a1 = steps_[0];
    const scalar a2 = steps_[0] + steps_[1];
    const scalar ages[3] = {0, a1, a2};

    // integrals of the polynomials that are 1 at one of the ages
    const scalar normal = 1/flow_.normalisation();
    const scalar b[3] =
    {
        normal*h*(sqr(h)/3 + h*(a1 + a2)/2 + a1*a2)/(a1*a2),
       -normal*h*h*(h/3 + a2/2)/(a1*(a2 - a1)),
        normal*h*h*(h/3 + a1/2)/(a2*(a2 - a1))
    };

    for (label j = 0; j < 3; ++j)
    {
        decay_[j] = flow_.k().decay(flow_.nu()*(h + ages[j]));
    }
    const double* const x[3] =
    {
        decay_[0][vector::X].begin(),
        decay_[1][vector::X].begin(),
        decay_[2][vector::X].begin()
    };
    double* modes = flow_.modes().begin();
    const double* latest = rates_[0].begin();
    double* oldest = rates_[1].begin();

    flow_.advance
    (
        [&](const label y, const label z, double* const (&v)[3])
        {
            const label row = flow_.firstRow() + y;
            double yz[3];
            double factor[3];
            for (label j = 0; j < 3; ++j)
            {
                yz[j] = decay_[j][vector::Y][row]*decay_[j][vector::Z][z];
                factor[j] = b[j]*yz[j];
            }
            for (label c = 0; c < 3; ++c)
            {
                const label i = flow_.place(y, z, c);
                kernels::advance
                (
                    flow_.width(), x, yz[0], factor,
                    v[c], modes + i, latest + i, oldest + i
                );
            }
        }
    );

    // the oldest has become the latest
    rates_[0].swap(rates_[1]);
    steps_[1] = steps_[0];
    steps_[0] = h;
}


void Foam::adamsBashforth3::rungeKutta
(
    const scalar h,
    const evaluator& evaluate
)
{
    const FixedList<scalarList, 3> full(flow_.k().decay(flow_.nu()*h));
    const FixedList<scalarList, 3> half(flow_.k().decay(0.5*flow_.nu()*h));
    const FixedList<scalarList, 3> none(flow_.k().decay(0));
    const scalar g = h/flow_.normalisation();
    const label width = flow_.width();

    double* u = flow_.modes().begin();
    List<double> rate(flow_.size());
    List<double> total(flow_.size());

    // a factor times E of a row
    const auto times = [&]
    (
        const scalar factor,
        const FixedList<scalarList, 3>& E,
        const label y,
        const label z,
        const double* row
    )
    {
        return kernels::term
        {
            factor*E[vector::Y][flow_.firstRow() + y]*E[vector::Z][z],
            E[vector::X].begin(),
            row
        };
    };

    // for each row of a stage, with its rate: what to add to the total, and
    // the state of the next stage
    typedef std::function<void(label y, label z, label i, double* v)> stageRows;
    const auto stage = [&](const stageRows& rows)
    {
        flow_.advance
        (
            [&](const label y, const label z, double* const (&v)[3])
            {
                for (label c = 0; c < 3; ++c)
                {
                    const label i = flow_.place(y, z, c);
                    rows(y, z, i, v[c]);
                }
            }
        );
    };

    stage([&](const label y, const label z, const label i, double* v)
    {
        std::copy_n(v, width, rate.begin() + i);
        kernels::combine
        (
            width,
            {times(1, full, y, z, u + i), times(g/6, full, y, z, v)},
            total.begin() + i
        );
        kernels::combine
        (
            width,
            {times(1, half, y, z, u + i), times(g/2, half, y, z, v)},
            v
        );
    });
    evaluate(0.5);

    stage([&](const label y, const label z, const label i, double* v)
    {
        double* sum = total.begin() + i;
        kernels::combine
        (
            width, {times(1, none, y, z, sum), times(g/3, half, y, z, v)}, sum
        );
        kernels::combine
        (
            width, {times(1, half, y, z, u + i), times(g/2, none, y, z, v)}, v
        );
    });
    evaluate(0.5);

    stage([&](const label y, const label z, const label i, double* v)
    {
        double* sum = total.begin() + i;
        kernels::combine
        (
            width, {times(1, none, y, z, sum), times(g/3, half, y, z, v)}, sum
        );
        kernels::combine
        (
            width, {times(1, full, y, z, u + i), times(g, half, y, z, v)}, v
        );
    });
    evaluate(1);

    stage([&](const label y, const label z, const label i, double* v)
    {
        kernels::combine
        (
            width,
            {
                times(1, none, y, z, total.begin() + i),
                times(g/6, none, y, z, v)
            },
            u + i
        );
        std::copy_n(u + i, width, v);
    });

    if (rates_.size())
    {
        rates_ = List<List<double>>({rate, rates_[0]});
        steps_ = scalarList({h, steps_[0]});
    }
    else
    {
        rates_ = List<List<double>>({rate});
        steps_ = scalarList({h});
    }
}


// * * * * * * * * * * * * * * * Member Functions  * * * * * * * * * * * * * //

void Foam::adamsBashforth3::advance(const scalar h, const evaluator& evaluate)
{
    if (rates_.size() == 2)
    {
        adamsBashforth(h);
    }
    else
    {
        rungeKutta(h, evaluate);
    }
}


void Foam::adamsBashforth3::set
(
    const List<List<double>>& rates,
    const scalarList& steps
)
{
    rates_ = rates;
    steps_ = steps;
}
