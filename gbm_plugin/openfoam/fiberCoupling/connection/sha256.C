#include "sha256.H"

#include <cstdint>

namespace
{

// the first 32 bits of the fractional parts of the cube roots of primes
const std::uint32_t K[64] =
{
    0x428a2f98, 0x71374491, 0xb5c0fbcf, 0xe9b5dba5, 0x3956c25b, 0x59f111f1,
    0x923f82a4, 0xab1c5ed5, 0xd807aa98, 0x12835b01, 0x243185be, 0x550c7dc3,
    0x72be5d74, 0x80deb1fe, 0x9bdc06a7, 0xc19bf174, 0xe49b69c1, 0xefbe4786,
    0x0fc19dc6, 0x240ca1cc, 0x2de92c6f, 0x4a7484aa, 0x5cb0a9dc, 0x76f988da,
    0x983e5152, 0xa831c66d, 0xb00327c8, 0xbf597fc7, 0xc6e00bf3, 0xd5a79147,
    0x06ca6351, 0x14292967, 0x27b70a85, 0x2e1b2138, 0x4d2c6dfc, 0x53380d13,
    0x650a7354, 0x766a0abb, 0x81c2c92e, 0x92722c85, 0xa2bfe8a1, 0xa81a664b,
    0xc24b8b70, 0xc76c51a3, 0xd192e819, 0xd6990624, 0xf40e3585, 0x106aa070,
    0x19a4c116, 0x1e376c08, 0x2748774c, 0x34b0bcb5, 0x391c0cb3, 0x4ed8aa4a,
    0x5b9cca4f, 0x682e6ff3, 0x748f82ee, 0x78a5636f, 0x84c87814, 0x8cc70208,
    0x90befffa, 0xa4506ceb, 0xbef9a3f7, 0xc67178f2
};

constexpr std::size_t block = 64;


std::uint32_t rotated(std::uint32_t x, int n)
{
    return (x >> n) | (x << (32 - n));
}


void compress(std::uint32_t (&H)[8], const unsigned char* bytes)
{
    std::uint32_t w[64];
    for (int t = 0; t < 16; ++t, bytes += 4)
    {
        w[t] =
            std::uint32_t(bytes[0]) << 24 | std::uint32_t(bytes[1]) << 16
          | std::uint32_t(bytes[2]) << 8 | std::uint32_t(bytes[3]);
    }
    for (int t = 16; t < 64; ++t)
    {
        const std::uint32_t x = w[t - 15];
        const std::uint32_t y = w[t - 2];
        w[t] =
            w[t - 16] + w[t - 7]
          + (rotated(x, 7) ^ rotated(x, 18) ^ (x >> 3))
          + (rotated(y, 17) ^ rotated(y, 19) ^ (y >> 10));
    }

    std::uint32_t a = H[0], b = H[1], c = H[2], d = H[3];
    std::uint32_t e = H[4], f = H[5], g = H[6], h = H[7];
    for (int t = 0; t < 64; ++t)
    {
        const std::uint32_t first =
            h + (rotated(e, 6) ^ rotated(e, 11) ^ rotated(e, 25))
          + ((e & f) ^ (~e & g)) + K[t] + w[t];
        const std::uint32_t second =
            (rotated(a, 2) ^ rotated(a, 13) ^ rotated(a, 22))
          + ((a & b) ^ (a & c) ^ (b & c));
        h = g; g = f; f = e; e = d + first;
        d = c; c = b; b = a; a = first + second;
    }
    H[0] += a; H[1] += b; H[2] += c; H[3] += d;
    H[4] += e; H[5] += f; H[6] += g; H[7] += h;
}

}


std::string Foam::sha256(const std::string& bytes)
{
    // a one, zeros, and the number of bits fill the last block
    std::string padded(bytes);
    padded += '\x80';
    padded.append((2*block - 8 - padded.size() % block) % block, '\0');
    for (int shift = 56; shift >= 0; shift -= 8)
    {
        padded += char(8*std::uint64_t(bytes.size()) >> shift);
    }

    std::uint32_t H[8] =
    {
        0x6a09e667, 0xbb67ae85, 0x3c6ef372, 0xa54ff53a,
        0x510e527f, 0x9b05688c, 0x1f83d9ab, 0x5be0cd19
    };
    for (std::size_t i = 0; i < padded.size(); i += block)
    {
        compress(H, reinterpret_cast<const unsigned char*>(padded.data()) + i);
    }

    std::string digest;
    for (const std::uint32_t word : H)
    {
        for (int shift = 24; shift >= 0; shift -= 8)
        {
            digest += char(word >> shift);
        }
    }
    return digest;
}


std::string Foam::hmacSha256(const std::string& key, const std::string& bytes)
{
    std::string inner(key.size() > block ? sha256(key) : key);
    inner.resize(block, '\0');
    std::string outer(inner);

    for (std::size_t i = 0; i < block; ++i)
    {
        inner[i] ^= '\x36';
        outer[i] ^= '\x5c';
    }
    return sha256(outer + sha256(inner + bytes));
}
