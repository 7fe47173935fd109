"""eswaranPope in pimpleFoam and boxFoam: the spectral solver's force, at their cell centres and times."""

from __future__ import annotations

import re
import shutil
import subprocess
from pathlib import Path

import numpy as np
import pytest

from gbm_plugin.case.initial import read_initial_field
from gbm_plugin.case.openfoam import fatal_message, utility
from gbm_plugin.output.field import read_velocity
from gbm_plugin.output.tables import read_dat
from gbm_plugin.spectral import EswaranPope, SpectralSolver
from gbm_plugin.spectral.forcing import half_shell
from gbm_plugin.spectral.normals import normals

from conftest import HEADER, divide, make_case, set_entry, solver_log, start_solver

pytestmark = pytest.mark.openfoam

PLUGIN = Path(__file__).parents[2] / "gbm_plugin/openfoam/eswaranPope"
CELLS, STEP, T_L, CUTOFF = 12, 0.1, 0.5, 8**0.5
SMOOTH = "field random; kineticEnergy 0.2; peakWavenumber 1; maxWavenumber 1;"
ROUGH = "field random; kineticEnergy 1; peakWavenumber 3; maxWavenumber 5;"


def entry(variance: float = 0.05, seed: int = 4) -> str:
    return f"stirring {{ type eswaranPope; variance {variance!r}; timeScale {T_L}; cutoff {CUTOFF!r}; seed {seed}; }}"


def python_force(variance: float = 0.05, seed: int = 4) -> EswaranPope:
    return EswaranPope(variance=variance, time_scale=T_L, cutoff=CUTOFF, seed=seed)


def at_centres(force: EswaranPope, n: int) -> np.ndarray:
    """The force (3, n, n, n), the sum over both k and -k, as it is written."""
    x = (np.arange(n) + 0.5) * 2 * np.pi / n
    waves = np.exp(1j * np.einsum("mc,cijk->mijk", half_shell(CUTOFF), np.meshgrid(x, x, x, indexing="ij")))
    return 2 * np.einsum("mc,mijk->cijk", force.force(), waves).real


def prepare(path, *, variance: float = 0.05, steps: int = 4, **options):
    """A case without fibers that writes every step in all digits."""
    options = {
        "cells": CELLS,
        "time_step": STEP,
        "write_every": 1,
        "initial": ROUGH,
        "application": "pimpleFoam",
    } | options
    make_case(path, steps=steps, fv_options=entry(variance), **options)
    control = path / "system/controlDict"
    control.write_text(control.read_text().split("functions")[0])
    set_entry(control, "writePrecision", "17")
    return path


def solve(path, ranks: int = 1):
    assert start_solver(path, ranks).wait() == 0, solver_log(path).read_text()[-2000:]
    if ranks > 1:
        utility(path, "reconstructPar", "-latestTime")
    return read_dat(path / "postProcessing/stirring", "stirring.dat")


def state(path, time: str, name: str = "stirring") -> str:
    return (path / time / "uniform" / name).read_text()


def amplitudes(text: str) -> np.ndarray:
    parts = [re.search(rf"\n{part}\s+\d+\s*\((.*?\))\s*\)", text, re.S).group(1) for part in ("re", "im")]
    re_, im = (
        np.array(part.replace("(", " ").replace(")", " ").split(), float).reshape(-1, 3) for part in parts
    )
    return re_ + 1j * im


@pytest.fixture(scope="module")
def numbers(tmp_path_factory):
    """The plugin's random numbers: a program that prints them."""
    program = tmp_path_factory.mktemp("normals") / "normals"
    sources = [str(PLUGIN / "normals.C"), str(Path(__file__).parent / "normals.C")]
    subprocess.run(["g++", "-std=c++11", "-O3", f"-I{PLUGIN}", *sources, "-o", str(program)], check=True)

    def call(*words) -> list[str]:
        return subprocess.run(
            [program, *map(str, words)], capture_output=True, text=True, check=True
        ).stdout.split()

    return call


@pytest.mark.parametrize(
    "counter, key, words",
    [
        (["0"] * 4, ["0"] * 2, "16554d9eca36314c db20fe9d672d0fdc d7e772cee186176b 7e68b68aec7ba23b"),
        (
            ["f" * 16] * 4,
            ["f" * 16] * 2,
            "87b092c3013fe90b 438c3c67be8d0224 9cc7d7c69cd777b6 a09caebf594f0ba0",
        ),
        (
            ["243f6a8885a308d3", "13198a2e03707344", "a4093822299f31d0", "082efa98ec4e6c89"],
            ["452821e638d01377", "be5466cf34e90c6c"],
            "a528f45403e61d95 38c72dbd566e9788 a5a1610e72fd18b5 57bd43b5e52b7fe6",
        ),
    ],
)
def test_known_answers_of_philox(numbers, counter, key, words):
    """kat_vectors of Random123 (Salmon et al. 2011), philox4x64-10."""
    assert numbers(*counter, *key) == words.split()


@pytest.mark.parametrize("seed, step", [(0, 0), (1, 5), (2**31 - 1, 10**6)])
def test_the_same_bits_in_both_languages(numbers, seed, step):
    there = [float.fromhex(word) for word in numbers(seed, step, 10000)]
    np.testing.assert_array_equal(there, normals(seed, step, 10000))


@pytest.fixture(scope="module", params=["pimpleFoam", "boxFoam"])
def runs(request, tmp_path_factory) -> dict[str, tuple[Path, dict]]:
    """One case as it is, on ranks, and with its cells in another order: folder and table of each."""
    folder, box = tmp_path_factory.mktemp("runs"), request.param == "boxFoam"
    names = ("whole", "ranks", "renumbered")
    cases = {name: prepare(folder / name, application=request.param) for name in names}
    divide(cases["ranks"], 2, (1, 1, 2) if box else None)
    utility(cases["renumbered"], "renumberMesh", "-overwrite")
    return {name: (path, solve(path, 2 if name == "ranks" else 1)) for name, path in cases.items()}


def test_the_force_is_the_spectral_solvers(runs):
    """Its product with a velocity that has all wavenumbers, at each time."""
    path, table = runs["whole"]
    force = python_force()
    for step, power in enumerate(table["power"]):
        if step == 0 and solver_log(path).name == "log.boxFoam":
            force.advance(STEP)
            continue  # it begins with the solenoidal part of what it reads
        u = read_velocity(path, f"{step * STEP:g}", (CELLS,) * 3)
        assert power == pytest.approx((u * at_centres(force, CELLS)).sum(axis=0).mean(), rel=1e-11)
        force.advance(STEP)
    assert len(table["power"]) == 5


@pytest.mark.parametrize("name", ["whole", "ranks", "renumbered"])
def test_its_amplitudes_are_the_spectral_solvers_to_the_last_bit(runs, name):
    path, _ = runs[name]
    force = python_force()
    for step in range(1, 5):
        force.advance(STEP)
        stored = state(path / "processor0" if name == "ranks" else path, f"{step * STEP:g}")
        np.testing.assert_array_equal(amplitudes(stored), force.state()["amplitudes"])


@pytest.mark.parametrize("name", ["ranks", "renumbered"])
def test_decomposition_and_numbering_change_nothing(runs, name):
    for column in ("k", "power", "epsilonBudget"):
        np.testing.assert_allclose(runs[name][1][column], runs["whole"][1][column], rtol=1e-8)


@pytest.mark.parametrize("application", ["pimpleFoam", "boxFoam"])
def test_a_restart_continues_to_the_last_bit(tmp_path, application):
    whole = prepare(tmp_path / "whole", application=application)
    parts = prepare(tmp_path / "parts", application=application, steps=2)
    for path in (whole, parts):  # Euler remembers nothing of its own
        schemes = path / "system/fvSchemes"
        schemes.write_text(re.sub(r"default\s+backward", "default Euler", schemes.read_text()))
    solve(whole), solve(parts)
    set_entry(parts / "system/controlDict", "endTime", repr(4 * STEP))
    solve(parts)
    for time in ("0.3", "0.4"):
        assert state(parts, time) == state(whole, time)


def test_another_step_after_a_restart(tmp_path):
    """The process is exact for any step: the state of 0.2 moves on by the steps that follow."""
    path = prepare(tmp_path / "case", steps=2)
    solve(path)
    control = path / "system/controlDict"
    set_entry(control, "endTime", "0.3")
    set_entry(control, "deltaT", "0.05")
    solve(path)
    force = python_force()
    for step in (0.1, 0.1, 0.05, 0.05):
        force.advance(step)
    np.testing.assert_array_equal(amplitudes(state(path, "0.3")), force.state()["amplitudes"])


def test_the_force_of_the_end_of_each_step(tmp_path):
    """A mode along an axis, in a flow too weak to convect, has no pressure: `backward`, which begins with a step of
    implicit Euler, adds up f(t) at the new times, in one as in several calls of a step."""
    variance, steps = 1e-8, 6
    path = prepare(
        tmp_path / "case",
        variance=variance,
        steps=steps,
        initial="field modes; modes (((0 0 1) (0 0 0) (0 0 0)));",
    )
    set_entry(path / "constant/transportProperties", "nu", "1e-9")
    control = path / "system/fvSolution"
    control.write_text(control.read_text().replace("nOuterCorrectors 1", "nOuterCorrectors 3"))
    solve(path)
    force = python_force(variance)
    mode = next(i for i, k in enumerate(half_shell(CUTOFF)) if tuple(k) == (1, 0, 0))
    before, now = 0, 0
    for step in range(steps):
        force.advance(STEP)
        f = force.force()[mode]
        new = now + STEP * f if step == 0 else (4 * now - before + 2 * STEP * f) / 3
        before, now = now, new
    u = read_velocity(path, f"{steps * STEP:g}", (CELLS,) * 3).mean(axis=(2, 3))
    found = (u * np.exp(-1j * (np.arange(CELLS) + 0.5) * 2 * np.pi / CELLS)).mean(axis=1)
    np.testing.assert_allclose(found, now, rtol=0, atol=1e-4 * np.abs(now).max())


@pytest.mark.parametrize(
    "application, time_scale, cells, order", [("pimpleFoam", 20, (12, 24), 2), ("boxFoam", 0.5, (16, 32), 6)]
)
def test_both_engines_in_one_realisation(tmp_path, application, time_scale, cells, order):
    """From one field, under one force that changes all of it, for more than half a turnover time: the flows differ by
    the order of the finite differences. boxFoam takes the force when the spectral solver does; with pimpleFoam it
    varies slowly, or the difference of the schemes in time would show."""
    force = f"stirring {{ type eswaranPope; variance 0.2; timeScale {time_scale}; cutoff 1.4143; seed 4; }}"
    stirring = EswaranPope(variance=0.2, time_scale=time_scale, cutoff=1.4143, seed=4)
    viscosity, time, steps, n = 0.2, 0.8, 60, 2 * cells[-1]
    solver = SpectralSolver(n, viscosity, forcing=stirring, time_step=time / steps)
    errors = []
    for count in cells:
        path = tmp_path / str(count)
        options = {"cells": count, "steps": steps, "time_step": time / steps, "write_every": steps}
        make_case(path, **options, fv_options=force, initial=SMOOTH, tight=False, application=application)
        set_entry(path / "constant/transportProperties", "nu", repr(viscosity))
        control = path / "system/controlDict"
        control.write_text(control.read_text().split("functions")[0])
        assert start_solver(path).wait() == 0, solver_log(path).read_text()[-2000:]
        if not solver.step:
            start = read_initial_field(path).modes.on_lattice((n,) * 3, offset=0.0)
            solver.set_velocity(start)
            solver.advance(steps)
            assert np.std(solver.velocity - start) > np.std(start)
            assert time > 0.5 * solver.statistics()["turnover_time"]
        # nodes of the fine grid are the centres of the coarse ones
        every = n // count
        exact = solver.velocity[:, every // 2 :: every, every // 2 :: every, every // 2 :: every]
        errors.append(np.std(read_velocity(path, f"{time:g}", (count,) * 3) - exact) / np.std(exact))
    assert np.log2(errors[0] / errors[1]) > order - 0.7, errors


@pytest.mark.parametrize(
    "old, new, message",
    [
        ("variance 0.05", "variance -1", "variance = -1 must be positive"),
        ("timeScale 0.5", "timeScale 0", "timeScale = 0 must be positive"),
        ("variance 0.05;", "", "variance"),
        ("cutoff 2.8284271247461903", "cutoff 0.5", "must be at least 1"),
        ("cutoff 2.8284271247461903", "cutoff 4", "must not exceed 3 at 12 cells"),
        ("seed 4", "seed -1", "must not be negative"),
        ("seed 4", "sead 4", "unknown entry 'sead'"),
    ],
)
def test_wrong_entries_are_named(tmp_path, old, new, message):
    path = prepare(tmp_path / "case", steps=1)
    assert old in entry()
    (path / "constant/fvOptions").write_text(HEADER + entry().replace(old, new))
    assert start_solver(path).wait() != 0
    text = fatal_message(solver_log(path))
    assert message in text and "fvOptions" in text


def test_a_box_that_is_no_cube_is_refused(tmp_path):
    path = prepare(tmp_path / "case", steps=1, prepared=False)
    mesh = path / "system/blockMeshDict"
    text = mesh.read_text()
    for corner in set(re.findall(r"\([^()]*\$width\)", text)):
        text = text.replace(corner, corner.replace("$width)", "7)"))
    mesh.write_text(text)
    utility(path, "blockMesh")
    shutil.copytree(path / "0.orig", path / "0")
    assert start_solver(path).wait() != 0
    assert "forces a periodic cube: its sides are" in fatal_message(solver_log(path))


def test_another_shell_than_the_stored_one_is_refused(tmp_path):
    path = prepare(tmp_path / "case", steps=1)
    solve(path)
    (path / "constant/fvOptions").write_text(HEADER + entry().replace(f"cutoff {CUTOFF!r}", "cutoff 2"))
    set_entry(path / "system/controlDict", "endTime", repr(2 * STEP))
    assert start_solver(path).wait() != 0
    assert "the stored force has 46 modes, this one 16" in fatal_message(solver_log(path))
