"""A preset of `gbm new`."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field


@dataclass(frozen=True)
class Preset:
    """What differs from the shipped case: entries by dictionary, dictionaries of another text, text at their end."""

    title: str
    entries: Mapping[str, Mapping[str, object]] = field(default_factory=dict)
    texts: Mapping[str, str] = field(default_factory=dict)
    added: Mapping[str, str] = field(default_factory=dict)
    without: tuple[str, ...] = ()
