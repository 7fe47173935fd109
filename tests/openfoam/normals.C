// Prints words of Philox and normal numbers: normals SEED STEP COUNT, or normals with counter and key in hexadecimal.
#include "normals.H"
#include <cstdio>
#include <cstdlib>

int main(int count, char** words)
{
    if (count == 7)
    {
        std::array<std::uint64_t, 6> w;
        for (int i = 0; i < 6; ++i) w[i] = std::strtoull(words[i + 1], nullptr, 16);
        for (std::uint64_t r : Foam::philox({{w[0], w[1], w[2], w[3]}}, {{w[4], w[5]}}))
        {
            std::printf("%016llx\n", static_cast<unsigned long long>(r));
        }
        return 0;
    }
    const std::uint64_t seed = std::strtoull(words[1], nullptr, 10), step = std::strtoull(words[2], nullptr, 10);
    for (double z : Foam::normals(seed, step, std::strtoull(words[3], nullptr, 10))) std::printf("%a\n", z);
}
