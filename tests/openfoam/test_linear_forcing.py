"""linearForcing in the packaged pimpleFoam, against what the equations say."""

from __future__ import annotations

import numpy as np
import pytest

from gbm_plugin.output.tables import read_dat

from conftest import HEADER, make_case, set_entry, start_solver

pytestmark = pytest.mark.openfoam

A, NU, CELLS = 0.5, 0.01, 16
UNIFORM = "((0 0 0) (0.3 -0.2 0.1) (0 0 0))"
SHEAR = "((0 2 0) (0 0 0) (-1 0 0))"  # u_x = sin 2y: an exact solution, as u . grad u = 0
CONSTANT_A = f"linearForcing {{ type linearForcing; mode constantCoefficient; A {A}; }}"
STOCK = f"""lundgren {{ type vectorSemiImplicitSource; selectionMode all; volumeMode specific;
    injectionRateSuSp {{ U ((0 0 0) {A}); }} }}"""


def run(path, modes: str, fv_options: str, time_step: float = 0.02, steps: int = 50, **options):
    """A run without fibers."""
    make_case(
        path,
        cells=CELLS,
        steps=steps,
        time_step=time_step,
        write_every=steps,
        fv_options=fv_options,
        initial=f"field modes; modes ({modes});",
        application="pimpleFoam",
        **options,
    )
    control = path / "system/controlDict"
    control.write_text(control.read_text().split("functions")[0])
    solver = start_solver(path)
    assert solver.wait() == 0, (path / "log.pimpleFoam").read_text()[-2000:]
    return path


def table(path):
    return read_dat(path / "postProcessing/linearForcing", "linearForcing.dat")


def mean_velocity(path, time: str):
    import fluidfoam

    u = fluidfoam.readfield(str(path), time, "U", verbose=False)
    return u.mean(axis=1) if u.ndim == 2 and u.shape[1] > 1 else u.ravel()


def test_the_mean_does_not_grow(tmp_path):
    """Under A u it would grow as e^{At}: the stock source shows it, on the same field; ours removes it."""
    modes = f"{SHEAR} {UNIFORM}"
    stock = mean_velocity(run(tmp_path / "stock", modes, STOCK), "1")
    np.testing.assert_allclose(stock, np.exp(A) * np.array([0.3, -0.2, 0.1]), rtol=1e-3)
    ours = run(tmp_path / "ours", modes, CONSTANT_A)
    assert np.abs(mean_velocity(ours, "1")).max() < 1e-12
    rows = table(ours)
    mean = np.stack([rows["meanUx"], rows["meanUy"], rows["meanUz"]])
    assert np.abs(mean[:, 1:]).max() < 1e-10 * rows["uPrime"].min()


def test_a_mode_grows_at_the_discrete_rate(tmp_path):
    """k ~ exp 2(A - nu k_h^2)t, with the eigenvalue k_h^2 of the discrete Laplacian, to the order of `backward`."""
    h = 2 * np.pi / CELLS
    rate = 2 * (A - NU * (2 / h * np.sin(h)) ** 2)
    errors = []
    for steps in (25, 50):
        rows = table(run(tmp_path / str(steps), SHEAR, CONSTANT_A, time_step=1 / steps, steps=steps))
        errors.append(abs(np.log(rows["k"][-1] / rows["k"][0]) / rate - 1))
    assert errors[1] < 2e-4
    assert np.log2(errors[0] / errors[1]) > 1.7


def test_dissipation_three_ways(tmp_path):
    """Of one mode of the initial field: nu k^2 u^2 with the two discrete wavenumbers, and the budget."""
    rows = table(run(tmp_path / "case", SHEAR, CONSTANT_A))
    h = 2 * np.pi / CELLS
    assert rows["Time"][0] == 0 and rows["Time"][-1] == pytest.approx(1)
    assert rows["k"][0] == pytest.approx(0.25, rel=1e-12)
    squares = {"epsilonLaplacian": (2 / h * np.sin(h)) ** 2, "epsilonGradient": (np.sin(2 * h) / h) ** 2}
    for column, square in squares.items():
        np.testing.assert_allclose(rows[column], 2 * NU * square * rows["k"], rtol=1e-9)
    # the budget closes to the order of the scheme, once its first, implicit Euler, step is over
    middle = 0.5 * (rows["epsilonLaplacian"][1:] + rows["epsilonLaplacian"][:-1])
    np.testing.assert_allclose(rows["epsilonBudget"][5:], middle[4:], rtol=2e-3)
    np.testing.assert_allclose(rows["power"], 2 * A * rows["k"], rtol=1e-9)
    epsilon, u = rows["epsilonLaplacian"], rows["uPrime"]
    np.testing.assert_allclose(rows["eta"], (NU**3 / epsilon) ** 0.25, rtol=1e-9)
    np.testing.assert_allclose(rows["ReLambda"], u**2 * np.sqrt(15 / (NU * epsilon)), rtol=1e-9)


def test_constant_power(tmp_path):
    """dk/dt = P - 2 nu k_h^2 k: k(t) = k_inf + (k_0 - k_inf) e^{-ct}, c = 2 nu k_h^2."""
    power = 0.1
    option = f"linearForcing {{ type linearForcing; mode constantPower; power {power}; }}"
    h = 2 * np.pi / CELLS
    c = 2 * NU * (2 / h * np.sin(h)) ** 2
    errors = []
    for steps in (25, 50):
        rows = table(run(tmp_path / str(steps), SHEAR, option, time_step=1 / steps, steps=steps))
        exact = power / c + (0.25 - power / c) * np.exp(-c * rows["Time"])
        errors.append(np.abs(rows["k"] - exact).max())
        np.testing.assert_allclose(rows["power"], power, rtol=1e-9)
    assert errors[1] < 2e-4
    assert np.log2(errors[0] / errors[1]) > 1.7


def test_a_restart_continues_the_forcing(tmp_path):
    """Constant power extrapolates k: its history is in <time>/uniform/linearForcing."""
    option = "linearForcing { type linearForcing; mode constantPower; power 0.1; }"
    whole = run(tmp_path / "whole", SHEAR, option, steps=20)
    parts = run(tmp_path / "parts", SHEAR, option, steps=10)
    set_entry(parts / "system/controlDict", "endTime", "0.4")
    assert start_solver(parts).wait() == 0
    a, b = table(whole), table(parts)
    np.testing.assert_allclose(b["Time"], a["Time"], atol=1e-12)
    # `backward` keeps the velocity before the last one, which OpenFOAM writes as U_0
    np.testing.assert_allclose(b["k"], a["k"], rtol=1e-9)
    np.testing.assert_allclose(b["epsilonBudget"], a["epsilonBudget"], rtol=1e-6)


@pytest.mark.parametrize(
    "option, message",
    [
        ("linearForcing { type linearForcing; mode constantPower; }", "power"),
        ("linearForcing { type linearForcing; mode constantPower; power 1; A 1; }", "does not go with mode"),
        ("linearForcing { type linearForcing; mode steady; power 1; }", "constantCoefficient"),
        ("linearForcing { type linearForcing; mode constantPower; power -1; }", "must not be negative"),
        (
            "linearForcing { type linearForcing; mode constantPower; power 1; pwoer 1; }",
            "unknown entry 'pwoer'",
        ),
    ],
)
def test_wrong_entries_are_named(tmp_path, option, message):
    from gbm_plugin.case.openfoam import fatal_message

    path = make_case(tmp_path / "case", cells=4, steps=1, initial="field ABC;", application="pimpleFoam")
    (path / "constant/fvOptions").write_text(HEADER + option)
    assert start_solver(path).wait() != 0
    text = fatal_message(path / "log.pimpleFoam")
    assert message in text and "fvOptions" in text


@pytest.mark.parametrize("application", ["pimpleFoam", "boxFoam"])
def test_a_list_of_equal_velocities_has_nothing_to_force(application, tmp_path):
    """Which no reader of the case sees: A = P/2k would amplify its rounding."""
    power = "linearForcing { type linearForcing; mode constantPower; power 1; }"
    make_case(
        tmp_path / "case",
        cells=8,
        steps=2,
        fv_options=power,
        initial=f"field modes; modes ({UNIFORM});",
        application=application,
    )
    control = tmp_path / "case/system/controlDict"
    control.write_text(control.read_text().split("functions")[0])
    assert start_solver(tmp_path / "case").wait() != 0
    assert "nothing to force at time" in (tmp_path / f"case/log.{application}").read_text()
