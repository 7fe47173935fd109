"""An OpenFOAM dictionary whose every entry is checked: wrong, missing and unknown ones are named."""

from __future__ import annotations

import difflib
import math
import re
from collections.abc import Iterable
from pathlib import Path
from typing import Any

from ..errors import CaseError
from .openfoam import expanded
from .syntax import Dimensions, SyntaxFault, check_pairs, parse, tokens

_REQUIRED: Any = object()
_SWITCHES = {word: True for word in ("yes", "on", "true", "y", "t")}
_SWITCHES |= {word: False for word in ("no", "off", "false", "n", "f", "none")}
COMPILED = ("#calc", "#codeStream")  # what compiles and runs code while a dictionary is read


class Dictionary:
    """One dictionary of a case, read entry by entry.

    The typed getters remember what was asked for, so that `done` can name every entry that nobody reads.
    """

    def __init__(self, entries: dict, where: str, text: str = ""):
        """text: as it is written, to find lines in."""
        self._entries = entries
        self._asked: list[str] = []
        self._text = text
        self.where = where

    @classmethod
    def read(cls, case: Path, name: str) -> Dictionary:
        """The dictionary `name` (as "constant/fiberProperties") of a case. CaseError where it cannot be read.

        What has macros or directives in it is expanded by OpenFOAM itself; code in it is refused, never run.
        """
        path = Path(case) / name
        if not path.is_file():
            raise CaseError(f"there is no file {path}")
        try:
            text = path.read_text()
            found = tokens(text)
            check_pairs(found)
            for token in found:
                if token.text in COMPILED:
                    raise SyntaxFault(
                        f"line {token.line}: {token.text} runs code, which gbm does not; write the value"
                    )
            if any("$" in token.text or token.text.startswith("#") for token in found):
                found = tokens(expanded(Path(case), path))
            entries = parse(found)
        except (SyntaxFault, UnicodeDecodeError) as error:
            raise CaseError(f"{path} is not an OpenFOAM dictionary: {error}") from None
        if not found:
            raise CaseError(f"{path} is not an OpenFOAM dictionary: it is empty")
        return cls(entries, str(path), text)

    def __contains__(self, name: str) -> bool:
        return name in self._entries

    def fail(self, name: str, problem: str) -> CaseError:
        return CaseError(f"{self.where}: entry '{name}' {problem}{self._open_end(name)}")

    def _open_end(self, name: str) -> str:
        """Where an entry of several lines may lack its semicolon."""
        if not isinstance(self._entries.get(name), tuple):
            return ""
        lines = [line.partition("//")[0].rstrip() for line in self._text.splitlines()]
        opened = re.compile(rf"\s*{re.escape(name)}\s+[^;{{]+")
        found = [number for number, line in enumerate(lines, start=1) if opened.fullmatch(line)]
        return f" (is a ';' missing at the end of line {found[0]}?)" if len(found) == 1 else ""

    def _get(self, name: str, default: Any) -> Any:
        self._asked.append(name)
        if name in self._entries:
            return self._entries[name]
        if default is _REQUIRED:
            raise CaseError(f"{self.where}: the entry '{name}' is missing")
        return default

    def number(
        self, name: str, default: Any = _REQUIRED, *, above: float = -math.inf, least: float = -math.inf
    ) -> float:
        """A finite number; a name and dimensions in brackets before it are passed over."""
        value = self._get(name, default)
        if name not in self._entries:
            return value
        if isinstance(value, tuple) and any(isinstance(item, Dimensions) for item in value[:-1]):
            value = value[-1] if len(value) <= 3 else value  # [dimensions] value, name [dimensions] value
        if isinstance(value, str) and value.startswith("+"):
            raise self.fail(name, f"is '{value}': OpenFOAM does not read a leading +")
        try:
            number = float(value)
        except (TypeError, ValueError):
            raise self.fail(name, f"is '{shown(value)}': a number is needed") from None
        if not math.isfinite(number):
            raise self.fail(name, f"is {value}: a finite number is needed")
        if number <= above:
            raise self.fail(name, f"is {value}: it must be greater than {above:g}")
        if number < least:
            raise self.fail(name, f"is {value}: it must be at least {least:g}")
        return number

    def either(
        self, first: str, second: str, both: str, **bounds: float
    ) -> tuple[float | None, float | None]:
        """The numbers of two entries of which exactly one is given; a misspelt one is named by `nearest`."""
        values = self.number(first, None, **bounds), self.number(second, None, **bounds)
        if values == (None, None):
            for name in self._entries:
                if name not in self._asked and (hint := nearest(name, (first, second))):
                    raise CaseError(f"{self.where}: unknown entry '{name}'{hint}")
        if (values[0] is None) == (values[1] is None):
            raise CaseError(f"{self.where}: exactly one of the entries {both} is needed")
        return values

    def integer(self, name: str, default: Any = _REQUIRED, *, least: float = -math.inf) -> int:
        number = self.number(name, default, least=least)
        if name not in self._entries:
            return number
        if number != int(number):
            raise self.fail(name, f"is {number:g}: a whole number is needed")
        return int(number)

    def word(self, name: str, allowed: Iterable[str] | None = None, default: Any = _REQUIRED) -> str:
        value = self._get(name, default)
        if name not in self._entries:
            return value
        text = shown(value)
        if allowed is not None and text not in (words := list(allowed)):
            raise self.fail(name, f"is '{text}'; allowed: {' '.join(words)}{nearest(text, words)}")
        if not isinstance(value, str) and " " in text:
            raise self.fail(name, f"is '{text}': one word is needed")
        return text

    def words(self, name: str, allowed: Iterable[str]) -> tuple[str, ...]:
        """A list of words, or a single one; none where the entry is not there."""
        value = self._get(name, [])
        words = list(allowed)
        for text in map(shown, value if isinstance(value, list) else [value]):
            if text not in words:
                raise self.fail(name, f"has '{text}'; allowed: {' '.join(words)}{nearest(text, words)}")
        return tuple(dict.fromkeys(map(shown, value))) if isinstance(value, list) else (shown(value),)

    def switch(self, name: str, default: Any = _REQUIRED) -> bool:
        value = self._get(name, default)
        if name not in self._entries:
            return value
        if not isinstance(value, str) or value not in _SWITCHES:
            raise self.fail(name, f"is '{shown(value)}'; allowed: yes no")
        return _SWITCHES[value]

    def numbers(self, name: str, count: int | None = None, default: Any = _REQUIRED) -> list[float]:
        value = self._get(name, default)
        if name not in self._entries:
            return value
        try:
            numbers = [float(x) for x in value]
        except (TypeError, ValueError):
            raise self.fail(name, f"is '{shown(value)}': a list of numbers is needed") from None
        if count is not None and len(numbers) != count:
            raise self.fail(name, f"has {len(numbers)} numbers: {count} are needed")
        return numbers

    def raw(self, name: str, default: Any = _REQUIRED) -> Any:
        return self._get(name, default)

    def sub(self, name: str, default: Any = _REQUIRED) -> Dictionary:
        """The dictionary `name` inside this one."""
        value = self._get(name, default)
        if not isinstance(value, dict):
            raise self.fail(name, f"is '{shown(value)}': a dictionary in braces is needed")
        return Dictionary(value, f"{self.where}, {name}", self._text)

    @property
    def names(self) -> list[str]:
        return list(self._entries)

    def subs(self, others: bool = False) -> dict[str, Dictionary]:
        """All entries by name, each of which must be a dictionary; with `others`, those that are."""
        return {n: self.sub(n) for n, value in self._entries.items() if not others or isinstance(value, dict)}

    def done(self) -> None:
        """CaseError where an entry is none of those that were asked for."""
        for name in self._entries:
            if name not in self._asked:
                allowed = list(dict.fromkeys(self._asked))
                raise CaseError(
                    f"{self.where}: unknown entry '{name}'; allowed: {' '.join(allowed)}{nearest(name, allowed)}"
                )


def shown(value: Any) -> str:
    """A value as it would be written in a dictionary."""
    if isinstance(value, dict):
        return "{ " + " ".join(f"{name} {shown(inner)};" for name, inner in value.items()) + " }"
    if isinstance(value, tuple):
        return " ".join(map(shown, value)).replace(" / ", "/")  # OpenFOAM takes a path without quotes apart
    if isinstance(value, list):
        left, right = "[]" if isinstance(value, Dimensions) else "()"
        return f"{left}{' '.join(map(shown, value))}{right}"
    return str(value)


def nearest(word: str, allowed: Iterable[str]) -> str:
    """A hint at what a misspelt word may mean."""
    match = difflib.get_close_matches(word, allowed, n=1)
    return f" (did you mean {match[0]}?)" if match else ""
