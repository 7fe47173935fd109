#include "differences.H"
#include "allowedEntries.H"
#include "dictionary.H"
#include "mathematicalConstants.H"

const Foam::Enum<Foam::differences::order> Foam::differences::orderNames
({
    { order::central2, "central2" },
    { order::central4, "central4" },
    { order::central6, "central6" }
});


// * * * * * * * * * * * * * * * * Constructors  * * * * * * * * * * * * * * //

Foam::differences::differences(const order p)
:
    order_(p)
{
    switch (p)
    {
        case central2:
            a_ = {1.0/2};
            b_ = {1.0/2};
            c_ = {1};
            break;

        case central4:
            a_ = {8.0/12, -1.0/12};
            b_ = {7.0/12, -1.0/12};
            c_ = {4.0/3, -1.0/12};
            break;

        case central6:
            a_ = {45.0/60, -9.0/60, 1.0/60};
            b_ = {37.0/60, -8.0/60, 1.0/60};
            c_ = {3.0/2, -3.0/20, 1.0/90};
            break;
    }
}


Foam::differences Foam::differences::New(const dictionary& fvSchemes)
{
    const dictionary& dict = fvSchemes.subOrEmptyDict("boxSchemes");
    allowedEntries(dict, {"differences"});

    return differences
    (
        orderNames.lookupOrDefault("differences", dict, order::central6)
    );
}


// * * * * * * * * * * * * * * * Member Functions  * * * * * * * * * * * * * //

Foam::scalar Foam::differences::first(const scalar theta) const
{
    scalar sum = 0;
    forAll(a_, i)
    {
        sum += 2*a_[i]*Foam::sin((i + 1)*theta);
    }
    return sum;
}


Foam::scalar Foam::differences::second(const scalar theta) const
{
    scalar sum = 0;
    forAll(c_, i)
    {
        sum += 2*c_[i]*(1 - Foam::cos((i + 1)*theta));
    }
    return sum;
}


Foam::scalar Foam::differences::stableCourant() const
{
    scalar largest = 0;
    for (label i = 0; i < 1000; ++i)
    {
        largest = max(largest, first(constant::mathematical::pi*i/1000));
    }
    return 0.7236/largest;
}
