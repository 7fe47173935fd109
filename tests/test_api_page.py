"""docs/api.md says what the docstrings say, and every public name has one."""

from __future__ import annotations

import runpy
from importlib import import_module
from pathlib import Path

import pytest

API = runpy.run_path(str(Path(__file__).parents[1] / "tools/api"))


def test_the_page_is_that_of_the_docstrings():
    assert API["TARGET"].read_text() == API["page"](), "run tools/api"


@pytest.mark.parametrize("name", API["MODULES"])
def test_every_public_name_is_described(name):
    module = import_module(name)
    for word in API["_public"](module):
        thing = getattr(module, word)
        assert not callable(thing) or (thing.__doc__ or "").strip(), f"{name}.{word} has no docstring"
