"""Kernels are compiled at set-up, found by every user, and never in a run."""

import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

import gbm_plugin

pytestmark = pytest.mark.slow  # each starts from an empty cache

PACKAGE = Path(gbm_plugin.__file__).parent

# counts what Numba compiles, whoever asks for it
COUNT = """
from numba.core import event
compiled = []
class Listener(event.Listener):
    def on_start(self, e): compiled.append(e.data["dispatcher"].py_func.__qualname__)
    def on_end(self, e): pass
event.register("numba:compile", Listener())
"""

# all words, with arrays as they come: broadcast, read-only, of single precision, not contiguous
EVERY_WORD = """
import itertools
import numpy as np
from gbm_plugin import Fibers, simulate
from gbm_plugin.fiber.model import BENDING_TORQUES, CURVATURE_LAWS, INTEGRATORS, MOBILITIES
from gbm_plugin.fiber import Stepper
from gbm_plugin.flow import LinearFlow, StoredFlow, TaylorGreen
from gbm_plugin.flow.grid import WORDS
from gbm_plugin.spectral import EswaranPope, SpectralSolver
shear = LinearFlow([[0, 1, 0], [0, 0, 0], [0, 0, 0]])
words = itertools.product(INTEGRATORS, MOBILITIES, BENDING_TORQUES, CURVATURE_LAWS, (False, True), (0.0, 1.0))
for integrator, mobility, torque, law, strain, repulsion in words:
    if strain and mobility == "freeDrain":
        continue
    fibers = Fibers.straight(9, 6, 1.0, 1e-3, 1.0, box=1.0, bending_torque=torque, curvature_law=law)
    options = {"strain_coupling": strain, "repulsion": repulsion, "record_every": 1}
    simulate(fibers, shear, 0.1, 0.3, integrator, mobility, **options)
for word in WORDS:
    for kind in (float, np.float32):
        field = np.ones((4, 4, 4, 3), kind)
        field.flags.writeable = False
        flow = StoredFlow([0, 1], lambda n: np.moveaxis(field, -1, 0), 3 * [1.0], interpolation=word)
        simulate(Fibers.straight(3, 4, 1.0, 1e-3, 1.0), flow, 0.1, 0.2)
        flow.sample(np.zeros((2, 3)), 0.3, "gradient")
for precision in ("double", "single"):
    forcing = EswaranPope(variance=1e-3, time_scale=1.0, cutoff=1.5, seed=1)
    solver = SpectralSolver(8, 0.1, forcing=forcing, time_step=0.05, threads=2, precision=precision)
    simulate(Fibers.straight(3, 4, 1.0, 1e-3, 1.0), solver, 0.05, 0.2, "ab3")
print("compiled:", *compiled)
"""

# one small kernel
CONTACTS = """
import numpy as np
from gbm_plugin.fiber.contact import self_contacts
assert self_contacts(np.zeros((1, 3, 3)), 1.0) == 1
print("compiled:", *compiled)
"""


def run(script: str, **variables) -> str:
    """Output of a fresh process."""
    environment = {name: value for name, value in os.environ.items() if name != "NUMBA_CACHE_DIR"}
    done = subprocess.run(
        [sys.executable, "-c", COUNT + script],
        env=environment | {name: str(value) for name, value in variables.items()},
        text=True,
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        cwd="/",
    )
    assert done.returncode == 0, done.stdout
    return done.stdout


def test_after_set_up_nothing_compiles_for_any_word():
    run("from gbm_plugin.prepare import prepare; prepare()")  # what tools/setup does
    assert run(EVERY_WORD).split("compiled:")[1].split() == []


@pytest.fixture
def installation(tmp_path):
    """Another installation, without compiled kernels, whose folder for them cannot be made."""
    site = tmp_path / "site"
    shutil.copytree(PACKAGE, site / "gbm_plugin", ignore=shutil.ignore_patterns("__pycache__", "openfoam"))
    (site / "gbm_plugin/__pycache__").mkdir()
    (site / "gbm_plugin/__pycache__/kernels").write_text("")  # as read-only as can be, for root too
    return {"PYTHONPATH": site, "PYTHONDONTWRITEBYTECODE": 1}


def test_a_read_only_installation_keeps_them_in_the_users_cache(installation, tmp_path):
    home = {"XDG_CACHE_HOME": tmp_path / "cache"}
    first, second = (run(CONTACTS, **installation, **home) for _ in range(2))
    assert "_count" in first
    assert second == "compiled:\n"
    assert any((tmp_path / "cache/gbm").iterdir())


def test_without_a_home_in_a_private_temporary_folder(installation, tmp_path):
    nowhere = {"XDG_CACHE_HOME": "/proc/none", "TMPDIR": tmp_path}
    first, second = (run(CONTACTS, **installation, **nowhere) for _ in range(2))
    folder = tmp_path / f"gbm-{os.getuid()}"
    assert "_count" in first
    assert second.splitlines()[-1] == "compiled:"
    assert folder.stat().st_mode & 0o777 == 0o700
    said = [line for line in first.splitlines() if str(folder) in line]
    assert said == [f"compiled kernels are kept in {folder}: installation and home cannot be written"]


def test_code_is_not_taken_from_a_folder_that_others_can_write(installation, tmp_path):
    folder = tmp_path / f"gbm-{os.getuid()}"
    folder.mkdir()
    folder.chmod(0o777)
    said = run(CONTACTS, **installation, XDG_CACHE_HOME="/proc/none", TMPDIR=tmp_path)
    assert str(folder) + ":" not in said
    assert list(folder.iterdir()) == []
    assert [path.name for path in tmp_path.glob("gbm-*")] == [folder.name]  # its own is gone with the process


def test_code_of_changed_sources_is_not_used(installation, tmp_path):
    """A change in what a kernel calls, in another file, counts too."""
    home = {"XDG_CACHE_HOME": tmp_path / "cache"}
    run(CONTACTS, **installation, **home)
    with (installation["PYTHONPATH"] / "gbm_plugin/simd.py").open("a") as file:
        file.write("# changed\n")
    assert "_count" in run(CONTACTS, **installation, **home)


def test_kernels_that_are_kept_load_without_the_compiler():
    """And the process that watches a run loads no kernels at all: a run starts a second sooner."""
    run(CONTACTS)
    script = CONTACTS + 'import sys; print("here:", *("numba.np.arraymath" in sys.modules,))'
    assert run(script).split("here:")[1].split() == ["False"]
    script = "import gbm_plugin.run.openfoam, sys; sys.exit(any(name in sys.modules for name in ('numba', 'PyFoam')))"
    assert subprocess.run([sys.executable, "-c", script]).returncode == 0
