"""Altered files in small; `python tests/fuzz/fuzz.py` is the large run."""

from __future__ import annotations

import shutil

import numpy as np
import pytest

from gbm_plugin.errors import StateError

from fuzz import FINE, REFUSED, fuzz, table
from targets import TARGETS


def test_altered_files_end_in_a_line():
    found = fuzz(30, seed=7)
    assert all(line["outcome"] in FINE for line in found), "\n".join(map(str, found))
    assert sum(line["outcome"] == REFUSED for line in found) > 15, table(found)  # the alterations are some


@pytest.fixture(scope="module")
def saved(tmp_path_factory):
    """A fiber state, and how it is read."""
    target = next(target for target in TARGETS if target.name == "fiber-state")
    path = target.make(tmp_path_factory.mktemp("saved"))
    return path, target.read


ALTERED = {  # once a crash in a kernel, a hang, or taken for granted
    "soft/multipliers": lambda a: np.repeat(a, 20000, axis=1),
    "soft/samples": lambda a: a[..., :3],
    "soft/rates": lambda a: a[:, :1],
    "stiff/links_and_centres": lambda a: 1.01 * a,
    "stiff/suggested_step": lambda a: 0 * a,
    "stiff/sample_times": lambda a: a[::-1],
    "soft/rate_ages": lambda a: -a,
    "soft/tension": lambda a: a * np.nan,
    "soft/own_disturbance": lambda a: a[..., :3],
    "stiff/own_disturbance": lambda a: a * np.inf,
}


@pytest.mark.parametrize("name", ALTERED)
def test_fiber_states(name, saved, tmp_path):
    path, read = saved
    case = shutil.copytree(path.parents[3], tmp_path / "copy")
    copy = case / path.relative_to(path.parents[3])
    with np.load(path) as file:
        arrays = {key: file[key] for key in file.files}
    arrays[name] = ALTERED[name](arrays[name])
    np.savez(copy, **arrays)
    with pytest.raises(StateError, match=f"{copy} cannot be read: .*{name.split('/')[0]}"):
        read(copy)
