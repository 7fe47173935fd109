"""OpenFOAM's files of numbers, read as data: fields and lists, ascii or binary, compressed or not.

Nothing in a file is evaluated or followed: neither macros nor directives, which are refused by name. The layout is
that of OpenFOAM's own writing and of files written by hand in its syntax (User Guide, 2.2; IOstreams, List::write).
"""

from __future__ import annotations

import re
import warnings
import zlib
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

SHAPES = {"label": (), "scalar": (), "vector": (3,)}
CLASSES = {  # of a file that is one list: what it is a list of
    **{
        "labelList": "label",
        "labelIOList": "label",
        "labelField": "label",
        "scalarField": "scalar",
        "scalarList": "scalar",
    },
    **{"vectorField": "vector", "vectorList": "vector", "pointField": "vector"},
}
_SMALL = 64 << 20  # a file of so many bytes is read, whatever it is
_DENSITY = 100  # a larger one may hold so many times what it occupies on the disk, and not more
_WIDE = 200  # bytes for each number of a field: its digits, and those of its boundaries
_EQUAL = 1_000_000  # so many values may one stand for, where nothing is known of how many there must be
_GAP = re.compile(rb"(?:\s+|//[^\n]*|/\*.*?\*/)*", re.DOTALL)
_COMMENT = re.compile(rb"//[^\n]*|/\*.*?\*/", re.DOTALL)
_TOKEN = re.compile(rb'"(?:[^"\\]|\\.)*"|[{}()\[\];]|[^\s{}()\[\];"]+')
_OPENS = {b"{": b"}", b"(": b")", b"[": b"]"}
_WITHOUT_BRACKETS = bytes.maketrans(b"()", b"  ")


def read_list(path: Path) -> NDArray:
    """The list that a file holds, as those of constant/polyMesh: (n,) labels or scalars, (n, 3) vectors.

    path may lack the .gz that the file has. Raises FileNotFoundError, or ValueError with the file's name for one that
    is cut off, or of another kind or syntax.
    """
    file = _File.read(path)
    kind = CLASSES.get(file.header.get("class", ""))
    if kind is None:
        allowed = " ".join(CLASSES)
        raise file.fault(f"class '{file.header.get('class', '')}' is none of those read here: {allowed}")
    return file.values(kind, file.start)[0]


def read_field(path: Path, kind: str = "vector", most: int | None = None) -> NDArray[np.float64]:
    """The internal field of a file of this kind: (n, *SHAPES[kind]), n = 1 where it is uniform.

    most: a field of more values is refused before they are read. Path and errors as in read_list.
    """
    file = _File.read(path, None if most is None else _SMALL + _WIDE * most * max(1, *SHAPES[kind], 1))
    at = file.entry(b"internalField")
    word, at = file.token(at)
    if word == b"uniform":
        return file.single(kind, at)
    name, at = file.token(at)
    if word != b"nonuniform" or name != f"List<{kind}>".encode():
        found = b" ".join((word, name)).decode(errors="replace")[:60]
        raise file.fault(f"internalField is '{found}'; 'uniform' or 'nonuniform List<{kind}>' is read here")
    values, at = file.values(kind, at, most)
    if (mark := file.token(at)[0]) != b";":
        raise file.fault(
            f"'{mark.decode(errors='replace')[:60]}' follows the values of internalField, not a ';'"
        )
    return values


@dataclass
class _File:
    """The bytes of a file, the entries of its header, and where its content starts."""

    path: Path
    content: bytes
    header: dict[str, str]
    start: int

    @classmethod
    def read(cls, path: Path, most: int | None = None) -> _File:
        if not path.is_file() and path.with_name(path.name + ".gz").is_file():
            path = path.with_name(path.name + ".gz")
        file = cls(path, _bytes(path, most), {}, 0)
        word, at = file.token(0)
        if word != b"FoamFile":
            raise file.fault("it has no header FoamFile")
        mark, at = file.token(at)
        if mark != b"{":
            raise file.fault("its header FoamFile is not a dictionary")
        while (name := file.token(at))[0] != b"}":
            end = file.end_of_entry(name[1])
            text = file.content[name[1] : end - 1].decode(errors="replace")
            file.header[name[0].decode(errors="replace")] = text.strip().strip('"')
            at = end
        file.start = name[1]
        if file.header.get("format", "ascii") not in ("ascii", "binary"):
            raise file.fault(f"format '{file.header['format']}' is neither ascii nor binary")
        return file

    def fault(self, what: str) -> ValueError:
        return ValueError(f"{self.path}: {what}")

    def token(self, at: int) -> tuple[bytes, int]:
        """The next token that is no comment, and what follows it. ValueError at the end of the file."""
        match = _TOKEN.match(self.content, _GAP.match(self.content, at).end())
        if match is None:
            raise self.fault("it is cut off, or its syntax is not OpenFOAM's")
        return match[0], match.end()

    def end_of_entry(self, at: int) -> int:
        """What follows an entry whose value begins here: its ';', or the brace of a dictionary."""
        closing: list[bytes] = []
        while True:
            token, at = self.token(at)
            if token in _OPENS:
                closing.append(_OPENS[token])
            elif token in (b"}", b")", b"]"):
                if not closing or closing.pop() != token:
                    raise self.fault(f"unexpected '{token.decode()}'")
                if not closing and token == b"}":
                    return at
            elif token == b";" and not closing:
                return at

    def entry(self, name: bytes) -> int:
        """Where the value of an entry of the file itself begins."""
        at = self.start
        while _GAP.match(self.content, at).end() < len(self.content):
            word, at = self.token(at)
            if word == name:
                return at
            if word[:1] == b"#":
                raise self.fault(
                    f"'{word.decode(errors='replace')}' is a directive, which is not carried out here"
                )
            at = self.end_of_entry(at)
        raise self.fault(f"it has no entry {name.decode()}")

    @property
    def binary(self) -> bool:
        return self.header.get("format") == "binary"

    def dtype(self, kind: str) -> np.dtype:
        """Of binary values, as the header's `arch` has them."""
        arch = self.header.get("arch", "")
        width = "label" if kind == "label" else "scalar"
        bits = re.search(rf"\b{width}=(32|64)\b", arch)
        bits = int(bits[1]) if bits else {"label": 32, "scalar": 64}[width]
        return np.dtype(f"{'>' if 'MSB' in arch else '<'}{'i' if kind == 'label' else 'f'}{bits // 8}")

    def single(self, kind: str, at: int) -> NDArray[np.float64]:
        """One value, up to its ';'."""
        end = self.content.find(b";", at)
        values = self.numbers(self.content[at : max(end, at)], kind)
        if values.shape[0] != 1:
            raise self.fault(f"a uniform {kind} has {values.size} numbers")
        return values

    def values(self, kind: str, at: int, most: int | None = None) -> tuple[NDArray, int]:
        """A list, its count and its values in parentheses or a value for all of them in braces; and what follows."""
        word, behind = self.token(at)
        count = int(word) if re.fullmatch(rb"\d{1,18}", word) else None
        if count is None and word != b"(":
            raise self.fault(f"'{word.decode(errors='replace')[:60]}' stands where a list must come")
        mark, start = (word, behind) if count is None else self.token(behind)
        if most is None and mark == b"{":
            most = _EQUAL
        if most is not None and count is not None and count > most:
            raise self.fault(f"it has {count} values where there are at most {most}")
        if mark == b"{" and count is not None:
            end = self.content.find(b"}", start)
            value = self.numbers(self.content[start : max(end, start)], kind)
            if len(value) != 1:
                raise self.fault("a list of equal values has not one")
            return np.broadcast_to(value, (count, *value.shape[1:])), end + 1
        if mark != b"(":
            raise self.fault(
                f"'{mark.decode(errors='replace')[:60]}' stands where the values of a list must come"
            )
        if self.binary and count is not None:
            return self.binary_values(kind, count, start)
        end = self.end_of_list(kind, start)
        values = self.numbers(self.content[start:end], kind)
        if count is not None and len(values) != count:
            raise self.fault(f"it holds {len(values)} values of the {count} that it announces: cut off?")
        return values, end + 1

    def binary_values(self, kind: str, count: int, start: int) -> tuple[NDArray, int]:
        dtype, shape = self.dtype(kind), SHAPES[kind]
        numbers = count * int(np.prod(shape, dtype=int))
        end = start + numbers * dtype.itemsize
        if end >= len(self.content):
            held = (len(self.content) - start) // (dtype.itemsize * max(1, *shape, 1))
            raise self.fault(f"it holds {held} values of the {count} that it announces: cut off?")
        if self.content[end : end + 1] != b")":
            raise self.fault(
                "its values do not end where they must: another size of numbers than its header says?"
            )
        values = np.frombuffer(self.content, dtype, numbers, start).reshape(count, *shape)
        return values.astype(np.int64 if kind == "label" else np.float64, copy=False), end + 1

    def end_of_list(self, kind: str, start: int) -> int:
        """Where the closing parenthesis of a list in ascii stands."""
        if not SHAPES[kind]:
            end = self.content.find(b")", start)
        else:
            match = re.compile(rb"\)\s*\)").search(self.content, start)
            end = match.end() - 1 if match else -1
            if end < 0 and _GAP.match(self.content, start).end() == self.content.find(b")", start):
                end = self.content.find(b")", start)  # ( )
        if end < 0:
            raise self.fault("a list is not closed: cut off?")
        return end

    def numbers(self, text: bytes, kind: str) -> NDArray:
        """The values that stand in a text, (n, *shape)."""
        shape = SHAPES[kind]
        if b"/" in text:
            text = _COMMENT.sub(b" ", text)
        if shape and (text.count(b"(") != text.count(b")") or text.count(b"(") == 0 != len(text.strip())):
            raise self.fault("a vector is not in parentheses")
        vectors = text.count(b"(")
        text = text.translate(_WITHOUT_BRACKETS) if shape else text
        dtype = np.int64 if kind == "label" else np.float64
        with warnings.catch_warnings():
            warnings.simplefilter("error")
            try:
                values = np.fromstring(text, dtype, sep=" ") if text.strip() else np.empty(0, dtype)
            except (DeprecationWarning, ValueError):
                raise self.fault(f"there is something else than numbers in a list of {kind}s") from None
        if shape and values.size != 3 * vectors:
            raise self.fault(f"{vectors} vectors have {values.size} numbers")
        return values.reshape(-1, *shape)


def _bytes(path: Path, most: int | None) -> bytes:
    """The content of a file, unpacked. ValueError where it is not a plain file, damaged, or larger than `most`."""
    if not path.is_file():
        raise (ValueError if path.exists() else FileNotFoundError)(f"there is no file {path}")
    found = path.stat()
    most = most or max(_SMALL, _DENSITY * min(found.st_size, 512 * found.st_blocks))
    with path.open("rb") as file:
        packed = file.read(2) == b"\x1f\x8b"
        file.seek(0)
        if not packed and found.st_size > most:
            raise ValueError(f"{path}: it has {found.st_size} bytes, where {most} are more than enough")
        if not packed:
            return file.read()
        data, parts, size = zlib.decompressobj(wbits=31), [], 0
        try:
            while chunk := data.unconsumed_tail or file.read(1 << 20):
                part = data.decompress(chunk, 1 << 24)
                parts.append(part)
                size += len(part)
                if size > most:
                    raise ValueError(
                        f"{path}: it unpacks to more than {most} bytes, which are more than enough"
                    )
                if data.eof:
                    break
        except zlib.error as error:
            raise ValueError(f"{path}: it cannot be unpacked: {error}") from None
    if not data.eof:
        raise ValueError(f"{path}: it cannot be unpacked, it is cut off")
    return b"".join(parts)
