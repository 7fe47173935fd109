"""The syntax of OpenFOAM's dictionaries: text to nested Python, with words and numbers left as they are written.

A value is one item, or a tuple where several stand in a row; an item is a text (a string keeps no quotes), a list
(what stands in parentheses), `Dimensions` (in brackets) or a dict (in braces). Libraries read less: PyFoam stops at
addresses, at [m^2/s] and at one line of macros; foamlib reads (1 2 (3 4)) as a counted list.
"""

from __future__ import annotations

import re
from typing import Any, NamedTuple

# what goes on in a word, which may hold parentheses that close: div(phi,U)
_PLAIN = r"(?:[^\s\"';{}()\[\]/]|/(?![/*]))"
_NEST = rf"\({_PLAIN}*\)"
for _ in range(5):
    _NEST = rf"\((?:{_PLAIN}|{_NEST})*\)"
_TOKEN = re.compile(
    rf"""(?P<space>\s+|//[^\n]*|/\*.*?\*/)
    |(?P<string>"(?:\\.|[^"\\])*")
    |(?P<verbatim>\#\{{.*?\#\}})
    |(?P<number>-?\.?\d[-+.\deE]*(?![^\s"';{{}}()\[\]/*,:=^]))
    |(?P<mark>[{{}}()\[\];])
    |(?P<word>[^\s"';{{}}()\[\]](?:{_PLAIN}|{_NEST})*)""",
    re.VERBOSE | re.DOTALL,
)
_PAIRS = {"}": "{", ")": "(", "]": "["}
_LIKE_A_NUMBER = re.compile(r"-?\.?\d")


class SyntaxFault(ValueError):
    """Text that OpenFOAM does not take for a dictionary; says the line."""


class Token(NamedTuple):
    kind: str  # string, verbatim, number, mark, word
    text: str
    line: int


class Dimensions(list):
    """[0 2 -1 0 0 0 0] or [m^2/s]."""


def tokens(text: str) -> list[Token]:
    """The tokens of a text without its comments. SyntaxFault where there are none to be made."""
    found, line, at = [], 1, 0
    while at < len(text):
        match = _TOKEN.match(text, at)
        if match is None or "\0" in match[0]:
            raise SyntaxFault(f"line {line}: {text[at : at + 20].split(chr(10))[0]!r} cannot be read")
        if match.lastgroup != "space":
            found.append(Token(match.lastgroup, match[0], line))
        line += match[0].count("\n")
        at = match.end()
    return found


def check_pairs(found: list[Token]) -> None:
    """SyntaxFault where a brace or a parenthesis has no partner."""
    opened: list[Token] = []
    for token in found:
        if token.kind != "mark" or token.text == ";":
            continue
        if token.text not in _PAIRS:
            opened.append(token)
        elif not opened or opened[-1].text != _PAIRS[token.text]:
            where = f", opened in line {opened[-1].line}, is not closed before it" if opened else ""
            partner = f": the '{opened[-1].text}'{where}" if opened else " without its partner"
            raise SyntaxFault(f"line {token.line}: unexpected '{token.text}'{partner}")
        else:
            opened.pop()
    if opened:
        raise SyntaxFault(
            f"line {opened[-1].line}: the '{opened[-1].text}' that is opened here is never closed"
        )


def parse(found: list[Token]) -> dict[str, Any]:
    """The entries of a file, without macros; SyntaxFault with the line. The header FoamFile is left out."""
    check_pairs(found)
    entries, end = _entries(found, 0)
    if end < len(found):
        raise SyntaxFault(f"line {found[end].line}: unexpected '}}'")
    entries.pop("FoamFile", None)
    return entries


def _entries(found: list[Token], at: int) -> tuple[dict[str, Any], int]:
    """Entries up to a closing brace or the end, and where that is. A later entry of a name overrides or is merged."""
    entries: dict[str, Any] = {}
    while at < len(found) and found[at].text != "}":
        key, at = found[at], at + 1
        if key.text == ";":
            continue
        if key.kind not in ("word", "string"):
            raise SyntaxFault(f"line {key.line}: '{key.text}' stands where the name of an entry must come")
        name = _text(key)
        if at < len(found) and found[at].text == "{":
            inner, at = _entries(found, at + 1)
            entries[name] = _merged(entries.get(name), inner)
            at += 1
        else:
            value, at = _value(found, at, key)
            if value == () and name.startswith("$"):
                raise SyntaxFault(f"line {key.line}: the macro {name} is not expanded")
            entries[name] = value[0] if len(value) == 1 else value
    return entries, at


def _merged(earlier: Any, later: dict) -> dict:
    if not isinstance(earlier, dict):
        return later
    result = dict(earlier)
    for name, value in later.items():
        result[name] = _merged(result.get(name), value) if isinstance(value, dict) else value
    return result


def _value(found: list[Token], at: int, key: Token) -> tuple[tuple, int]:
    """Items up to the semicolon, and what follows it."""
    items, first = [], at
    while at < len(found) and found[at].text != ";":
        if found[at].text == "}":
            break
        item, at = _item(found, at)
        items.append(item)
    if at == len(found) or found[at].text != ";":
        line = _broken(found[first - 1 : at])
        raise SyntaxFault(f"line {line}: a ';' is missing at its end, behind the entry '{key.text}'")
    return tuple(items), at + 1


def _broken(part: list[Token]) -> int:
    """The line that an entry should have ended with: the first that the rest does not stand in."""
    return part[0].line if part[-1].line != part[0].line else part[-1].line


def _item(found: list[Token], at: int) -> tuple[Any, int]:
    token = found[at]
    if token.text in ("(", "["):
        closing = ")" if token.text == "(" else "]"
        items, at = [], at + 1
        while found[at].text != closing:
            if found[at].text == ";":
                raise SyntaxFault(f"line {found[at].line}: a ';' inside the list of line {token.line}")
            item, at = _item(found, at)
            items.append(item)
        return (items if closing == ")" else Dimensions(items)), at + 1
    if token.text == "{":
        inner, at = _entries(found, at + 1)
        return inner, at + 1
    if token.kind != "string" and _LIKE_A_NUMBER.match(token.text) and not _is_number(token.text):
        raise SyntaxFault(
            f"line {token.line}: OpenFOAM does not read '{token.text}', which begins like a number: put it in quotes"
        )
    return _text(token), at + 1


def _is_number(text: str) -> bool:
    try:
        float(text)
    except ValueError:
        return False
    return True


def _text(token: Token) -> str:
    if token.kind == "string":
        return re.sub(r'\\(["\\])', r"\1", token.text[1:-1])
    return token.text
