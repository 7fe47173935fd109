"""The messages: what is encoded is decoded; whatever else arrives is a ProtocolError, and nothing else."""

from __future__ import annotations

import random
import struct
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from gbm_plugin.case.share import WHOLE, Share
from gbm_plugin.coupling.message import (
    HEADER_SIZE,
    MAX_TEXT,
    NEEDS,
    NONCE_SIZE,
    VERSION,
    Hello,
    Kind,
    Message,
    ProtocolError,
    decode_folder,
    decode_header,
    decode_sample,
    encode_array,
    encode_header,
    encode_welcome,
    sample_size,
)

finite = st.floats(allow_nan=False, allow_infinity=False)
triple = st.tuples(finite, finite, finite)
messages = st.sampled_from(Kind).flatmap(
    lambda kind: st.builds(
        Message,
        st.just(kind),
        st.integers(-(2**63), 2**63 - 1),
        finite,
        st.binary(max_size=200),
        st.integers(0, 3 if kind is Kind.POSITIONS else 0),
    )
)
shares = st.integers(1, 2**40).flatmap(lambda of: st.builds(Share, st.integers(1, of), st.just(of)))
nonces = st.binary(min_size=NONCE_SIZE, max_size=NONCE_SIZE)
hellos = st.builds(
    Hello, finite, finite, triple, triple, st.integers(0, 2**50), shares,
    st.from_regex(r"(processor[0-9]{1,4}/)?[0-9]{1,6}(\.[0-9]{1,6})?", fullmatch=True), nonces,
)  # fmt: skip


@given(messages)
def test_header_round_trip(message):
    head, size = decode_header(message.encode()[:HEADER_SIZE])
    assert replace(head, payload=message.payload) == message
    assert size == len(message.payload)
    assert encode_header(message) + message.payload == message.encode()


def test_layout_of_the_header():
    """As docs/protocol.md has it: little-endian, 40 bytes, no padding."""
    data = Message(Kind.SAMPLE, -2, 0.5, b"abc", flags=3).encode()
    assert data[:4] == b"GBMC" and data[4:8] == bytes([VERSION, 0, 4, 0])
    assert data[8:16] == bytes([3, 0, 0, 0, 0, 0, 0, 0])
    assert data[16:24] == (-2).to_bytes(8, "little", signed=True)
    assert data[24:32] == struct.pack("<d", 0.5)
    assert data[32:40] == (3).to_bytes(8, "little") and data[40:] == b"abc"


@given(hellos)
def test_hello_round_trip(hello):
    assert Hello.decode(hello.encode()) == hello


@given(st.sampled_from(NEEDS), st.integers(1, 5), st.randoms(use_true_random=False))
def test_sample_round_trip(need, beads, rng):
    extra = {"velocity": 0, "rotation": 3, "gradient": 9}[need]
    u = np.array([rng.uniform(-9, 9) for _ in range(3 * beads)]).reshape(beads, 3)
    rest = np.array([rng.uniform(-9, 9) for _ in range(extra * beads)])
    message = Message(Kind.SAMPLE, 7, 0.1, bytes(encode_array(u)) + bytes(encode_array(rest)))
    assert len(message.payload) == sample_size(beads, need)
    velocity, found = decode_sample(message, beads, need)
    np.testing.assert_array_equal(velocity, u)
    if extra:
        np.testing.assert_array_equal(found.ravel(), rest)
    else:
        assert found is None


def test_welcome_is_a_list_of_integers():
    assert struct.unpack("<9q", encode_welcome("gradient", True, [(60, 20, 5), (1, 2, 0)])) == (
        2,
        1,
        2,
        60,
        20,
        5,
        1,
        2,
        0,
    )


@pytest.mark.parametrize(
    "data, expected",
    [
        (b"", "short message: 0 bytes"),
        (b"GBMC" + bytes(35), "short message: 39 bytes"),
        (b"HTTP" + bytes(36), "not a message of a gbm plugin"),
        (b"GBMC" + struct.pack("<HHIIqdQ", 3, 1, 0, 0, 0, 0.0, 0), f"version 3 of .* this daemon {VERSION}"),
        (b"GBMC" + struct.pack("<HHIIqdQ", VERSION + 1, 1, 0, 0, 0, 0.0, 0), f"version {VERSION + 1}"),
        (b"GBMC" + struct.pack("<HHIIqdQ", VERSION, 0, 0, 0, 0, 0.0, 0), "unknown kind 0"),
        (b"GBMC" + struct.pack("<HHIIqdQ", VERSION, 13, 0, 0, 0, 0.0, 0), "unknown kind 13"),
        (b"GBMC" + struct.pack("<HHIIqdQ", VERSION, 3, 4, 0, 0, 0.0, 0), "POSITIONS has unknown flags: 4"),
        (b"GBMC" + struct.pack("<HHIIqdQ", VERSION, 4, 5, 0, 0, 0.0, 0), "SAMPLE has unknown flags: 5"),
        (b"GBMC" + struct.pack("<HHIIqdQ", VERSION, 4, 0, 7, 0, 0.0, 0), "SAMPLE has 7 where 0 is reserved"),
        (
            b"GBMC" + struct.pack("<HHIIqdQ", VERSION, 4, 0, 0, 0, 0.0, MAX_TEXT + 1),
            f"announces {MAX_TEXT + 1} bytes",
        ),
        (b"GBMC" + struct.pack("<HHIIqdQ", VERSION, 4, 0, 0, 5, float("inf"), 0), "step 5 has the time inf"),
    ],
)
def test_header_that_is_none(data, expected):
    with pytest.raises(ProtocolError, match=expected):
        decode_header(data)


def test_size_that_is_expected_is_taken():
    data = encode_header(Message(Kind.SAMPLE, 0, 0.0))[:32] + struct.pack("<Q", 10**6)
    assert decode_header(data, most=10**6)[1] == 10**6
    with pytest.raises(ProtocolError, match="where at most 999999 are expected"):
        decode_header(data, most=10**6 - 1)


@pytest.mark.parametrize(
    "folder",
    [
        "",
        ".",
        "..",
        "../0",
        "/etc",
        "0/..",
        "processor0",
        "processor0/../0",
        "processor/0",
        "a",
        "0\n",
        "0\0",
        "0 1",
    ],
)
def test_folder_that_is_no_time(folder):
    with pytest.raises(ProtocolError, match="is not a time folder"):
        decode_folder(folder.encode())


@pytest.mark.parametrize("folder", ["0", "0.25", "1e-05", "12", "processor0/0.1", "processor11/3"])
def test_folder_of_a_time(folder):
    assert decode_folder(folder.encode()) == folder


def decode_all(data: bytes) -> int:
    """Everything that could decode this; the number of those that did."""
    decoders = [
        lambda: decode_header(data[:HEADER_SIZE]),
        lambda: Hello.decode(data),
        lambda: decode_folder(data),
        *(lambda n=n: decode_sample(Message(Kind.SAMPLE, 0, 0.0, data), 2, n) for n in NEEDS),
    ]
    passed = 0
    for decode in decoders:
        try:
            decode()
        except ProtocolError as error:
            assert str(error) and "\n" not in str(error)
        else:
            passed += 1
    return passed


@settings(max_examples=2000, deadline=None)
@given(st.binary(max_size=200))
@example(Hello(1.0, 1.0, (0.0,) * 3, (1.0,) * 3, 8, WHOLE, "0", bytes(32)).encode())
def test_whatever_arrives(data):
    decode_all(data)


def test_a_hundred_thousand_damaged_messages():
    """Valid bytes with a few of them changed, cut, doubled or inserted, which get much deeper than random ones."""
    rng = random.Random(1)
    hello = Hello(
        0.01, 0.02, (0.0,) * 3, (6.28,) * 3, 4096, Share(2, 3), "processor0/0.2", b"f" * 32
    ).encode()
    seeds = [
        Message(Kind.HELLO, 3, 0.1, hello).encode(),
        hello,
        encode_header(Message(Kind.SAMPLE, 3, 0.1)),
        np.linspace(-1, 1, 12).tobytes(),
        np.linspace(-1, 1, 24).tobytes(),
        b"processor0/0.25",
    ]
    special = [0, 1, 0x7F, 0x80, 0xF0, 0xFF]
    passed = 0
    for _ in range(100_000):
        data = bytearray(rng.choice(seeds))
        for _ in range(rng.randrange(1, 4)):
            at = rng.randrange(len(data) + 1)
            what = rng.randrange(5)
            if what <= 1 and at < len(data):
                data[at] = rng.choice(special) if what else rng.randrange(256)
            elif what == 2:
                del data[at:]
            elif what == 3:
                data[at:at] = rng.randbytes(rng.randrange(9))
            else:
                data[at:at] = data[: rng.randrange(9)]
        passed += decode_all(bytes(data))
    assert 1000 < passed < 300_000  # both ways were taken
