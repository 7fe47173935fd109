"""What was changed in a case's dictionaries between two parts of a run, in the words of the dictionaries."""

from __future__ import annotations

from collections.abc import Mapping

from .dictionary import shown
from .syntax import SyntaxFault, parse, tokens

WHOLE = (  # dictionaries of which every entry is physics or numerics
    "constant/fiberProperties",
    "constant/transportProperties",
    "constant/turbulenceProperties",
    "constant/fvOptions",
    "system/fvSchemes",
    "system/fvSolution",
)
PARTS = {"system/controlDict": ("application", "deltaT")}  # and of which only these are
ASIDE = ("coupling", "recordInterval", "record")  # how, and not what


def changes(before: Mapping[str, str], now: Mapping[str, str]) -> list[str]:
    """ "nu 0.01 → 0.02" for each entry that differs; the texts of dictionaries by name. A text with directives is
    compared as a whole."""
    found = []
    for name in (*WHOLE, *PARTS):
        old, new = before.get(name), now.get(name)
        if old == new:
            continue
        try:
            a, b = _entries(name, old), _entries(name, new)
        except SyntaxFault:
            found.append(f"{name} edited")
            continue
        found += [
            f"{entry} {a.get(entry, 'none')} → {b.get(entry, 'none')}"
            for entry in dict.fromkeys((*a, *b))
            if a.get(entry) != b.get(entry)
        ]
    return found


def _entries(name: str, text: str | None) -> dict[str, str]:
    """Entries by their path, as "soft bendingStiffness"."""
    top = parse(tokens(text)) if text is not None else {}
    chosen = {n: v for n, v in top.items() if n not in ASIDE and n in PARTS.get(name, (n,))}
    return dict(_flat(chosen, ""))


def _flat(entries: Mapping, path: str):
    for name, value in entries.items():
        if isinstance(value, Mapping):
            inner = path if name == "families" else f"{path}{name} "
            yield from _flat(value, inner)
        else:
            yield f"{path}{name}", shown(value)
