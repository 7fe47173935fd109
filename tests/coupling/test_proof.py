"""SHA-256 and HMAC of the plugin beside those of Python's library and the vectors of their standards."""

from __future__ import annotations

import hashlib
import hmac
import random
import shutil
import subprocess
from pathlib import Path

import pytest

import gbm_plugin

FOLDER = Path(gbm_plugin.__file__).parent / "openfoam/fiberCoupling/connection"
PROGRAM = r"""
#include "sha256.H"
#include <iostream>

std::string bytes(const std::string& hex)
{
    std::string result;
    for (std::size_t i = 0; i < hex.size(); i += 2) result += char(std::stoi(hex.substr(i, 2), nullptr, 16));
    return result;
}

void print(const std::string& digest)
{
    for (unsigned char c : digest) std::cout << "0123456789abcdef"[c >> 4] << "0123456789abcdef"[c & 15];
}

int main()
{
    for (std::string key, text; std::getline(std::cin, key) && std::getline(std::cin, text);)
    {
        print(Foam::sha256(bytes(text)));
        std::cout << ' ';
        print(Foam::hmacSha256(bytes(key), bytes(text)));
        std::cout << '\n';
    }
}
"""
# FIPS 180-4 (SHA-256 of "abc") and RFC 4231 (HMAC-SHA-256, cases 1, 2 and 6)
ABC = "ba7816bf8f01cfea414140de5dae2223b00361a396177a9cb410ff61f20015ad"
RFC4231 = [
    (b"\x0b" * 20, b"Hi There", "b0344c61d8db38535ca8afceaf0bf12b881dc200c9833da726e9376c2e32cff7"),
    (
        b"Jefe",
        b"what do ya want for nothing?",
        "5bdcc146bf60754e6a042426089575c75a003f089d2739839dec58b964ec3843",
    ),
    (
        b"\xaa" * 131,
        b"Test Using Larger Than Block-Size Key - Hash Key First",
        "60e431591ee0b67f0d8a26aacbf5b77f8e0bc6213728c5140546040f0ee37f54",
    ),
]


@pytest.fixture(scope="module")
def digests(tmp_path_factory):
    """Of pairs of a key and a text: the hash of the text, and the code with the key."""
    if not (compiler := shutil.which("g++")):
        pytest.skip("there is no g++")
    folder = tmp_path_factory.mktemp("sha256")
    (folder / "main.C").write_text(PROGRAM)
    argv = [compiler, "-std=c++11", "-Wall", "-Wextra", "-Werror", "-x", "c++", f"-I{FOLDER}"]
    subprocess.run([*argv, folder / "main.C", FOLDER / "sha256.C", "-o", folder / "main"], check=True)

    def run(pairs: list[tuple[bytes, bytes]]) -> list[list[str]]:
        lines = "".join(f"{key.hex()}\n{text.hex()}\n" for key, text in pairs)
        done = subprocess.run([folder / "main"], input=lines, capture_output=True, text=True, check=True)
        return [line.split() for line in done.stdout.splitlines()]

    return run


def test_vectors_of_the_standards(digests):
    assert digests([(b"", b"abc")])[0][0] == ABC
    codes = digests([(key, text) for key, text, _ in RFC4231])
    assert [code for _, code in codes] == [expected for _, _, expected in RFC4231]


def test_texts_and_keys_of_every_length(digests):
    """Around a block of 64 bytes, and the 56 that the padding leaves, most can go wrong."""
    rng = random.Random(1)
    pairs = [(rng.randbytes(rng.randrange(140)), rng.randbytes(n)) for n in range(260)]
    pairs += [(rng.randbytes(n), rng.randbytes(9)) for n in range(140)]
    for (key, text), (plain, code) in zip(pairs, digests(pairs), strict=True):
        assert plain == hashlib.sha256(text).hexdigest()
        assert code == hmac.new(key, text, "sha256").hexdigest()
