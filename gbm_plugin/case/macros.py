"""OpenFOAM's `$name` in parsed dictionaries. PyFoam's own expansion rounds numbers in lists to six digits."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any


class MacroError(ValueError):
    """A `$name` that no entry defines."""


def expand(value: Any, scopes: tuple[dict, ...] = ()) -> Any:
    """Copy of a parsed value with every macro replaced.

    `$name` and `${name}` are looked up in the dictionary they stand in and outwards, `$:name` from the top,
    `$..name` from one dictionary further out; a key `$name;` merges a whole dictionary.
    """
    if isinstance(value, Mapping):
        done: dict = {}
        inner = (*scopes, done)
        for key in list(value):
            if isinstance(key, str) and key.startswith("$"):
                merged = _look_up(key, inner)
                if not isinstance(merged, Mapping):
                    raise MacroError(f"the macro {key} does not name a dictionary")
                done.update(merged)
            else:
                done[key] = expand(value[key], inner)
        return done
    if isinstance(value, str):
        return _look_up(value, scopes) if value.startswith("$") else value
    if isinstance(value, list | tuple):
        return [expand(v, scopes) for v in value]
    return value


def _look_up(macro: str, scopes: tuple[dict, ...]) -> Any:
    name = macro[1:].strip("{}")
    if name.startswith(":"):
        name, scopes = name[1:], scopes[:1]
    while name.startswith(".."):
        name, scopes = name[2:], scopes[:-1]
    first, *rest = name.strip(".").split(".")
    for scope in reversed(scopes):
        if first in scope:
            value = scope[first]
            try:
                for part in rest:
                    value = value[part]
            except (KeyError, TypeError):
                break
            return value
    raise MacroError(f"the macro {macro} is not defined before it is used")
