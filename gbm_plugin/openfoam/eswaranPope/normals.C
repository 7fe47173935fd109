#include "normals.H"
#include <cmath>

// a product and a sum are rounded one after the other, as NumPy does
#if defined(__clang__)
    #pragma STDC FP_CONTRACT OFF
#elif defined(__GNUC__)
    #pragma GCC optimize("fp-contract=off")
#endif

namespace
{

__extension__ typedef unsigned __int128 uint128;


//- ln u for 0 < u: 2 artanh(s), s = (m - 1)/(m + 1), of the mantissa
double logarithm(const double u)
{
    int exponent;
    double m = std::frexp(u, &exponent);

    if (m < 0.70710678118654757)
    {
        m *= 2;
        --exponent;
    }

    const double s = (m - 1)/(m + 1);
    const double q = s*s;
    double sum = 0;
    for (int n = 21; n > 0; n -= 2)
    {
        sum = sum*q + 1.0/n;
    }
    return exponent*0.69314718055994529 + 2*s*sum;
}


//- Cosine and sine of 2 pi v, 0 <= v < 1: Taylor's series within pi/4 of the
//  nearest quarter
void turn(const double v, double& cosine, double& sine)
{
    const double quarter = std::floor(4*v + 0.5);
    const double x = (v - 0.25*quarter)*6.2831853071795862;
    const double q = x*x;

    double c = 1;
    double s = 1;
    for (int n = 18; n > 0; n -= 2)
    {
        c = 1 - q*c/((n - 1)*n);
        s = 1 - q*s/(n*(n + 1));
    }
    s = x*s;

    switch (int(quarter) % 4)
    {
        case 0: cosine = c; sine = s; break;
        case 1: cosine = -s; sine = c; break;
        case 2: cosine = -c; sine = -s; break;
        default: cosine = s; sine = -c;
    }
}

}


std::array<std::uint64_t, 4> Foam::philox
(
    std::array<std::uint64_t, 4> counter,
    std::array<std::uint64_t, 2> key
)
{
    for (int round = 0; round < 10; ++round)
    {
        const uint128 a = uint128(0xD2E7470EE14C6C93ULL)*counter[0];
        const uint128 b = uint128(0xCA5A826395121157ULL)*counter[2];

        counter =
        {
            std::uint64_t(b >> 64) ^ counter[1] ^ key[0],
            std::uint64_t(b),
            std::uint64_t(a >> 64) ^ counter[3] ^ key[1],
            std::uint64_t(a)
        };
        key[0] += 0x9E3779B97F4A7C15ULL;
        key[1] += 0xBB67AE8584CAA73BULL;
    }
    return counter;
}


std::vector<double> Foam::normals
(
    const std::uint64_t seed,
    const std::uint64_t step,
    const std::size_t count
)
{
    static const double unit = 1.0/9007199254740992.0;     // 2^-53

    std::vector<double> result(count);
    std::array<std::uint64_t, 4> words;

    for (std::size_t i = 0; i < count; i += 2)
    {
        if (i % 4 == 0)
        {
            words = philox({{i/4 + 1, 0, step, 0}}, {{seed, 0}});
        }

        // (0, 1] for the radius, [0, 1) for the angle
        const double u = double((words[i % 4] >> 11) + 1)*unit;
        const double v = double(words[i % 4 + 1] >> 11)*unit;

        double cosine;
        double sine;
        turn(v, cosine, sine);

        const double radius = std::sqrt(-2*logarithm(u));
        result[i] = radius*cosine;
        result[i + 1] = radius*sine;
    }
    return result;
}
