#include "shellProcess.H"
#include "normals.H"
#include "vectorList.H"
#include "DynamicList.H"
#include <algorithm>
#include <cmath>

// a product and a sum are rounded one after the other, as NumPy does
#if defined(__clang__)
    #pragma STDC FP_CONTRACT OFF
#elif defined(__GNUC__)
    #pragma GCC optimize("fp-contract=off")
#endif

// * * * * * * * * * * * * * * * * Constructors  * * * * * * * * * * * * * * //

Foam::shellProcess::shellProcess
(
    const scalar variance,
    const scalar timeScale,
    const scalar cutoff,
    const label seed
)
:
    variance_(variance),
    timeScale_(timeScale),
    seed_(seed),
    draws_(0),
    k_(halfShell(cutoff)),
    b_(k_.size(), amplitude{Zero, Zero})
{
    addNoise(1);
}


// * * * * * * * * * * * * * Private Member Functions  * * * * * * * * * * * //

void Foam::shellProcess::addNoise(const scalar factor)
{
    const std::vector<double> noise(normals(seed_, draws_, 6*k_.size()));
    const double deviation = std::sqrt(variance_);
    auto next = noise.begin();

    forAll(k_, i)
    {
        for (direction d = 0; d < vector::nComponents; ++d)
        {
            b_[i].re[d] += factor*(deviation*(*next++));
            b_[i].im[d] += factor*(deviation*(*next++));
        }
    }
    ++draws_;
}


// * * * * * * * * * * * * * * * Member Functions  * * * * * * * * * * * * * //

Foam::List<Foam::labelVector> Foam::shellProcess::halfShell
(
    const scalar cutoff
)
{
    const label reach = label(cutoff);
    DynamicList<labelVector> k;

    for (label x = -reach; x <= reach; ++x)
    for (label y = -reach; y <= reach; ++y)
    for (label z = 0; z <= reach; ++z)
    {
        const label leading = z ? z : y ? y : x;

        if (leading > 0 && x*x + y*y + z*z <= cutoff*cutoff*(1 + 1e-12))
        {
            k.append(labelVector(x, y, z));
        }
    }

    std::stable_sort
    (
        k.begin(),
        k.end(),
        [](const labelVector& a, const labelVector& b)
        {
            return (a & a) < (b & b);
        }
    );
    return List<labelVector>(std::move(k));
}


void Foam::shellProcess::advance(const scalar deltaT)
{
    const double memory = std::exp(-deltaT/timeScale_);

    for (amplitude& b : b_)
    {
        b.re *= memory;
        b.im *= memory;
    }
    addNoise(std::sqrt(-std::expm1(-2*deltaT/timeScale_)));
}


Foam::List<Foam::amplitude> Foam::shellProcess::force() const
{
    List<amplitude> f(b_);

    forAll(f, i)
    {
        const vector k(k_[i].x(), k_[i].y(), k_[i].z());

        f[i].re -= k*((k & f[i].re)/magSqr(k));
        f[i].im -= k*((k & f[i].im)/magSqr(k));
    }
    return f;
}


void Foam::shellProcess::read(const dictionary& state)
{
    const vectorList re(state.get<vectorList>("re"));
    const vectorList im(state.get<vectorList>("im"));

    if (re.size() != b_.size() || im.size() != b_.size())
    {
        FatalIOErrorInFunction(state)
            << "the stored force has " << re.size() << " modes, this one "
            << b_.size() << ": its cutoff is another"
            << exit(FatalIOError);
    }
    forAll(b_, i)
    {
        b_[i] = {re[i], im[i]};
    }
    state.readEntry("draws", draws_);
}


void Foam::shellProcess::write(Ostream& os) const
{
    vectorList re(b_.size());
    vectorList im(b_.size());

    forAll(b_, i)
    {
        re[i] = b_[i].re;
        im[i] = b_[i].im;
    }
    os.writeEntry("draws", draws_);
    os.writeEntry("re", re);
    os.writeEntry("im", im);
}
