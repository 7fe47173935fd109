"""The packages that set-up installs are those that pyproject.toml asks for, each by a hash and below a bound."""

from __future__ import annotations

import re
import tomllib
from pathlib import Path

import pytest
from packaging.requirements import Requirement
from packaging.utils import canonicalize_name

ROOT = Path(__file__).parents[1]
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
WANTED = {
    "locked.txt": PROJECT["dependencies"],
    "locked-test.txt": PROJECT["dependencies"] + PROJECT["optional-dependencies"]["test"],
}


@pytest.mark.parametrize("name", WANTED)
def test_locked(name):
    text = (ROOT / "tools" / name).read_text()
    locked = dict(re.findall(r"^([\w.-]+)==([\w.]+)", text, flags=re.M))
    entries = re.split(r"\n(?=\S)", text.strip())
    assert all("--hash=sha256:" in entry for entry in entries)
    for requirement in map(Requirement, WANTED[name]):
        assert any(bound.operator == "<" for bound in requirement.specifier), (
            f"{requirement} has no upper bound"
        )
        assert locked[canonicalize_name(requirement.name)] in requirement.specifier
    assert "setuptools" in locked  # which installs the package itself
