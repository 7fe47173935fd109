"""Ways to alter a file, each drawn by chance; all say in a word what they did."""

from __future__ import annotations

import io
import zipfile
from pathlib import Path
from random import Random

import h5py
import numpy as np

TOKENS = [
    *(
        b"(",
        b")",
        b"{",
        b"}",
        b";",
        b"[",
        b"]",
        b'"',
        b"/*",
        b"//",
        b"*/",
        b"\0",
        b"\xff",
        b"\n",
        b"#include",
        b"$x",
    ),
    *(
        b"nan",
        b"-inf",
        b"1e999",
        b"-1",
        b"0",
        b"99999999999",
        b"9223372036854775808",
        b"uniform",
        b"List<scalar>",
    ),
    *(b"binary", b"ascii", b"MSB", b"scalar=32", b"null", b"[" * 3000),
]


def some_bytes(path: Path, random: Random) -> str:
    """Flipped, cut off, zeroed, doubled or strange bytes."""
    data = bytearray(path.read_bytes())
    at = random.randrange(len(data))
    length = min(random.choice([1, 4, 32, 512]), len(data) - at)
    how = random.choice(["flipped", "cut", "zeroed", "doubled", "random"])
    if how == "flipped":
        for _ in range(random.choice([1, 8, 64])):
            data[random.randrange(len(data))] ^= 1 << random.randrange(8)
    elif how == "cut":
        del data[at:]
    elif how == "zeroed":
        data[at : at + length] = bytes(length)
    elif how == "doubled":
        data[at:at] = data[at : at + length]
    else:
        data[at : at + length] = random.randbytes(length)
    path.write_bytes(data)
    return f"{how} bytes at {at}"


def a_text(path: Path, random: Random) -> str:
    """A token put in or in place of another, or lines moved about; or its bytes."""
    if random.random() < 0.3:
        return some_bytes(path, random)
    data = path.read_bytes()
    how = random.choice(["token", "token", "token", "line dropped", "line doubled", "tail"])
    at = random.randrange(min(len(data), 400) if random.random() < 0.6 else len(data))
    end = data.find(b"\n", at) + 1 or len(data)
    start = data.rfind(b"\n", 0, at) + 1
    if how == "token":
        token = random.choice(TOKENS)
        end = at + random.choice([0, 1, 4])
        data = data[:at] + token + data[end:]
        how = f"token {token[:12]!r} at {at}"
    elif how == "line dropped":
        data = data[:start] + data[end:]
    elif how == "line doubled":
        data = data[:end] + data[start:]
    else:
        data += random.choice(TOKENS)
    path.write_bytes(data)
    return how


def _changed(array: np.ndarray, random: Random) -> tuple[str, np.ndarray]:
    how = random.choice(
        [
            "wider",
            "narrower",
            "flat",
            "one value",
            "value",
            "type",
            "scaled",
            "zero",
            "order",
            "more",
            "none",
            "moved",
        ]
    )
    values = array.astype(array.dtype)
    if how == "wider":
        values = np.concatenate([values.reshape(-1)] * random.choice([2, 3, 20000])).reshape(
            *values.shape[:-1], -1
        ) if values.size else np.zeros(7)  # fmt: skip
    elif how == "narrower":
        values = values[..., : max(1, values.shape[-1] // 2)] if values.ndim else values.reshape(1)
    elif how == "flat":
        values = values.reshape(-1)
    elif how == "one value":
        values = np.zeros((), values.dtype)
    elif how == "value" and values.size and values.dtype.kind in "fc":
        values.reshape(-1)[random.randrange(values.size)] = random.choice(
            [np.nan, np.inf, -1.0, 0.0, 1e300, -1e-300]
        )
    elif how == "type":
        kind = random.choice(["f4", "i8", "c16", ">f8", "f2", "U9", "?", "S3"])
        values = np.zeros(values.shape, kind) if values.dtype.kind == "U" else values.astype(kind)
    elif how == "scaled" and values.dtype.kind in "fc":
        values = values * random.choice([-1.0, 1.0 + 1e-3, 1e-300, 1e12, 1e300])
    elif how == "zero":
        values = np.zeros_like(values)
    elif how == "order":
        values = np.asfortranarray(values[::-1] if values.ndim else values)
    elif how == "more":
        values = np.stack([values] * random.choice([1, 2, 5]))
    elif how == "none":
        values = np.zeros((0, *values.shape[1:]), values.dtype)
    elif values.ndim:
        values = np.moveaxis(values, 0, -1)
    return how, values


def an_array(path: Path, random: Random) -> str:
    """One array of a .npz or .npy file; or its bytes, or its header."""
    if random.random() < 0.15:
        return some_bytes(path, random)
    with np.errstate(all="ignore"):
        if path.suffix == ".npy":
            how, values = _changed(np.load(path), random)
            content = _npy(values, random)
            path.write_bytes(content)
            return how
        with np.load(path) as file:
            arrays = {name: file[name] for name in file.files}
        name = random.choice(sorted(arrays))
        kind = random.random()
        if kind < 0.08:
            del arrays[name]
            how = "missing"
        elif kind < 0.12:
            arrays["strange"] = arrays[name]
            how = "strange"
        elif kind < 0.16:
            arrays[name] = np.array([{"a": 1}], dtype=object)
            how = "object"
        else:
            how, arrays[name] = _changed(arrays[name], random)
    with zipfile.ZipFile(path, "w", random.choice([zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED])) as archive:
        for key, value in arrays.items():
            archive.writestr(f"{key}.npy", _npy(value, random if key == name else None))
    return f"{name}: {how}"


def _npy(values: np.ndarray, random: Random | None) -> bytes:
    buffer = io.BytesIO()
    np.lib.format.write_array(buffer, np.asanyarray(values), allow_pickle=True)
    content = buffer.getvalue()
    if random is not None and random.random() < 0.15:  # a header that promises more
        for old, new in ((b"(", b"(99999999999, "), (b"'shape': ", b"'shape': (1, 10**9), '': ")):
            if random.random() < 0.5:
                content = content.replace(old, new, 1)
    return content


def a_node(file: h5py.File, random: Random) -> str:
    """A dataset, group or attribute of an HDF5 file."""
    names: list[str] = []
    file.visit(names.append)
    name = random.choice(names)
    node = file[name]
    if random.random() < 0.25 and (attributes := sorted(node.attrs) or sorted(file.attrs)):
        owner, key = (node if node.attrs else file), random.choice(attributes)
        value = random.choice([None, -1, 1e300, "text", np.zeros(3), np.nan, h5py.Empty("f8"), b"\xff"])
        del owner.attrs[key]
        if value is not None:
            owner.attrs[key] = value
        return f"attribute {key} of {owner.name}"
    if isinstance(node, h5py.Group):
        del file[name]
        if random.random() < 0.5:
            file[name] = random.choice([1.0, np.zeros((2, 2)), "text"])
        return f"group {name}"
    value = node[()]
    del file[name]
    kind = random.random()
    if kind < 0.1:
        how = "missing"
    elif kind < 0.2:
        how = "huge"
        file.create_dataset(name, (1 << 34, 3)[: random.choice([1, 2])], "f8", chunks=True)
    elif kind < 0.3:
        how = "a link"
        file[name] = random.choice(
            [h5py.SoftLink("/"), h5py.ExternalLink("/etc/passwd", "x"), h5py.SoftLink("/none")]
        )
    elif isinstance(value, bytes):
        how = "no text"
        file[name] = random.choice([1.0, b"\xff\xfe", np.zeros(3), h5py.Empty("f8")])
    else:
        with np.errstate(all="ignore"):
            how, value = _changed(np.asarray(value), random)
        if value.dtype.kind == "U":
            value = value.astype("S9")
        file[name] = value if value.size < 1 << 22 else value.reshape(-1)[: 1 << 22]
    return f"{name}: {how}"
