"""An OpenFOAM dictionary whose every entry is checked: wrong, missing and unknown ones are named."""

from __future__ import annotations

import math
from collections.abc import Iterable
from pathlib import Path
from typing import Any

from PyFoam.Basics.DataStructures import BoolProxy
from PyFoam.Error import PyFoamException
from PyFoam.RunDictionary.ParsedParameterFile import ParsedParameterFile, PyFoamParserError

from ..errors import CaseError
from .macros import MacroError, expand

_REQUIRED: Any = object()


class Dictionary:
    """One dictionary of a case, read entry by entry.

    The typed getters remember what was asked for, so that `done` can name every entry that nobody reads.
    """

    def __init__(self, entries: dict, where: str):
        self._entries = entries
        self._asked: list[str] = []
        self.where = where

    @classmethod
    def read(cls, case: Path, name: str) -> Dictionary:
        """The dictionary `name` (as "constant/fiberProperties") of a case. CaseError where it cannot be read."""
        path = Path(case) / name
        if not path.is_file():
            raise CaseError(f"there is no file {path}")
        try:
            entries = expand(ParsedParameterFile(str(path)).content)
        except (PyFoamParserError, PyFoamException, MacroError, UnicodeDecodeError) as error:
            raise CaseError(f"{path} is not an OpenFOAM dictionary: {error}") from None
        return cls(entries, str(path))

    def __contains__(self, name: str) -> bool:
        return name in self._entries

    def fail(self, name: str, problem: str) -> CaseError:
        return CaseError(f"{self.where}: entry '{name}' {problem}")

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
        """A finite number; dimensions in brackets before it are passed over."""
        value = self._get(name, default)
        if value is default and name not in self._entries:
            return value
        if hasattr(value, "__iter__") and not isinstance(value, str):  # name [dimensions] value
            value = list(value)[-1]
        if isinstance(value, str) and value.split():
            value = value.split()[-1]
        try:
            number = float(value)
        except (TypeError, ValueError):
            raise self.fail(name, f"is '{value}': a number is needed") from None
        if not math.isfinite(number):
            raise self.fail(name, f"is {value}: a finite number is needed")
        if number <= above:
            raise self.fail(name, f"is {value}: it must be greater than {above:g}")
        if number < least:
            raise self.fail(name, f"is {value}: it must be at least {least:g}")
        return number

    def integer(self, name: str, default: Any = _REQUIRED, *, least: float = -math.inf) -> int:
        number = self.number(name, default, least=least)
        if name not in self._entries:
            return number
        if number != int(number):
            raise self.fail(name, f"is {number:g}: a whole number is needed")
        return int(number)

    def word(self, name: str, allowed: Iterable[str] | None = None, default: Any = _REQUIRED) -> str:
        value = self._get(name, default)
        if value is default and name not in self._entries:
            return value
        value = str(value).strip('"')
        if allowed is not None and value not in (words := list(allowed)):
            raise self.fail(name, f"is '{value}'; allowed: {' '.join(words)}")
        return value

    def switch(self, name: str, default: Any = _REQUIRED) -> bool:
        value = self._get(name, default)
        if isinstance(value, bool):
            return value
        if isinstance(value, BoolProxy):
            return bool(value)
        raise self.fail(name, f"is '{value}'; allowed: yes no")

    def numbers(self, name: str, count: int | None = None, default: Any = _REQUIRED) -> list[float]:
        value = self._get(name, default)
        if value is default and name not in self._entries:
            return value
        try:
            numbers = [float(x) for x in value]
        except (TypeError, ValueError):
            raise self.fail(name, f"is '{value}': a list of numbers is needed") from None
        if count is not None and len(numbers) != count:
            raise self.fail(name, f"has {len(numbers)} numbers: {count} are needed")
        return numbers

    def raw(self, name: str, default: Any = _REQUIRED) -> Any:
        return self._get(name, default)

    def sub(self, name: str, default: Any = _REQUIRED) -> Dictionary:
        """The dictionary `name` inside this one."""
        value = self._get(name, default)
        if not isinstance(value, dict):
            raise self.fail(name, f"is '{value}': a dictionary in braces is needed")
        return Dictionary(value, f"{self.where}, {name}")

    @property
    def names(self) -> list[str]:
        return list(self._entries)

    def subs(self, others: bool = False) -> list[Dictionary]:
        """All entries, each of which must be a dictionary; with `others`, those that are."""
        return [self.sub(n) for n, value in self._entries.items() if not others or isinstance(value, dict)]

    def done(self) -> None:
        """CaseError where an entry is none of those that were asked for."""
        for name in self._entries:
            if name not in self._asked:
                allowed = " ".join(dict.fromkeys(self._asked))
                raise CaseError(f"{self.where}: unknown entry '{name}'; allowed: {allowed}")
