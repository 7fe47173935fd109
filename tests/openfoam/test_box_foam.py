"""boxFoam against exact solutions and conservation laws."""

from __future__ import annotations

import itertools
import re

import fluidfoam
import numpy as np
import pytest

from gbm_plugin.case.initial import write_velocity
from gbm_plugin.case.openfoam import utility
from gbm_plugin.output.tables import read_dat

from box_cases import box_case, centres, divergence, laplacian_symbol, run, velocity

pytestmark = pytest.mark.openfoam

WIND = np.array([0.7, -0.4, 0.3])
A, B, C = 1.0, 0.8, 0.6
ABC = f"""((0 0 0) ({WIND[0]} {WIND[1]} {WIND[2]}) (0 0 0)) ((0 0 1) (0 {A} 0) ({-A} 0 0))
    ((1 0 0) (0 0 {B}) (0 {-B} 0)) ((0 1 0) ({C} 0 0) (0 0 {-C}))"""
SHEAR = "((0 2 0) (0 0 0) (-1 0 0))"  # u_x = sin 2y: u . grad u = 0, also for differences


def abc_in_the_wind(x: np.ndarray, time: float, nu: float) -> np.ndarray:
    """An Arnold-Beltrami-Childress flow that a uniform wind carries away while it decays: an exact solution of the
    Navier-Stokes equations, with the pressure -|u - wind|^2/2."""
    x, y, z = x - WIND[:, None, None, None] * time
    u = (
        A * np.sin(z) + C * np.cos(y),
        B * np.sin(x) + A * np.cos(z),
        C * np.sin(y) + B * np.cos(x),
    )
    return np.exp(-nu * time) * np.stack(u)


@pytest.mark.parametrize("order", [2, 4, 6])
def test_order_in_space(tmp_path, order):
    """Velocity and pressure of an exact solution, to the order of the differences."""
    nu, time = 0.05, 0.6
    errors = []
    for n in (10, 20):
        path = box_case(
            tmp_path / str(n),
            order=order,
            nu=nu,
            cells=n,
            steps=60,
            time_step=time / 60,
            initial=f"field modes; modes ({ABC});",
        )
        run(path)
        exact = abc_in_the_wind(centres(n), time, nu)
        u = velocity(path, "0.6", n) - WIND[:, None, None, None]
        p = fluidfoam.readscalar(str(path), "0.6", "p", verbose=False).reshape(n, n, n, order="F")
        head = -0.5 * (exact**2).sum(axis=0)
        errors.append((np.abs(u - exact).max(), np.abs(p - (head - head.mean())).max()))
    observed = np.log2(np.divide(*errors))
    assert np.all(observed > order - 0.35), (observed, errors)
    assert errors[1][0] < {2: 0.1, 4: 3e-3, 6: 1.5e-4}[order]


def test_order_in_time(tmp_path):
    """Convection and forcing: the differences between runs with halved steps fall eightfold, from the first step on."""
    force = "linearForcing { type linearForcing; mode constantPower; power 0.1; }"
    u = []
    for steps in (20, 40, 80):
        path = box_case(
            tmp_path / str(steps), cells=12, steps=steps, time_step=1 / steps, fv_options=force,
            initial="field random; kineticEnergy 0.5; peakWavenumber 2; maxWavenumber 3;",
        )  # fmt: skip
        run(path)
        u.append(velocity(path, "1", 12))
    coarse, fine = (np.abs(b - a).max() for a, b in itertools.pairwise(u))
    assert 2.7 < np.log2(coarse / fine) < 3.6
    assert fine < 2e-3


@pytest.mark.parametrize("order", [2, 4, 6])
def test_viscosity_is_exact(tmp_path, order):
    """A wave decays by its eigenvalue of the second difference, in one step that no explicit scheme would survive; and
    with a linear force to third order at e^{(A - nu k"^2) t}."""
    n, h, nu = 16, 2 * np.pi / 16, 1.0
    k2 = laplacian_symbol(2 * h, order) / h**2
    path = box_case(
        tmp_path / "decay",
        order=order,
        nu=nu,
        cells=n,
        steps=1,
        time_step=0.5,
        initial=f"field modes; modes ({SHEAR});",
    )
    run(path)
    u = velocity(path, "0.5", n)
    np.testing.assert_allclose(u[0], np.exp(-nu * k2 * 0.5) * np.sin(2 * centres(n)[1]), atol=1e-14)
    assert np.abs(u[1:]).max() < 1e-15


def test_energy_and_momentum(tmp_path):
    """Without viscosity the differences conserve both: momentum to rounding, and of the energy only the time scheme
    loses some, with the third power of the step."""
    n, mean = 12, (0.3, -0.2, 0.1)
    losses = []
    for steps in (20, 40):
        path = box_case(tmp_path / str(steps), nu=1e-30, cells=n, steps=steps, time_step=2 / steps)
        rng = np.random.default_rng(5)
        noise = rng.standard_normal((3, n, n, n)) / 3
        write_velocity(path / "0.orig/U", path / "0/U", noise - noise.mean(axis=(1, 2, 3), keepdims=True))
        start = tmp_path / f"start{steps}"
        # the solver's own projection of the noise: one step that is nearly none
        make = box_case(start, nu=1e-30, cells=n, steps=1, time_step=1e-12)
        write_velocity(
            make / "0.orig/U",
            make / "0/U",
            noise + np.reshape(mean, (3, 1, 1, 1)) - noise.mean(axis=(1, 2, 3), keepdims=True),
        )
        run(make)
        u0 = velocity(make, "1e-12", n)
        write_velocity(path / "0.orig/U", path / "0/U", u0)
        run(path)
        u = velocity(path, "2", n)
        np.testing.assert_allclose(u.mean(axis=(1, 2, 3)), mean, atol=1e-14)
        losses.append((u0**2).mean() - (u**2).mean())
        assert np.abs(u - u0).max() > 0.3  # it is another flow by now
    assert 2.5 < np.log2(losses[0] / losses[1]) < 3.7, losses
    assert abs(losses[1]) < 2e-2 * (u0**2).mean()


@pytest.mark.parametrize("order", [2, 4, 6])
def test_divergence_and_checkerboards(tmp_path, order):
    """From white noise: what is kept is divergence-free for the differences, has none of the modes that they do not
    see, and fluxes add up to zero in OpenFOAM's own operator."""
    n = 12
    path = box_case(tmp_path / "case", order=order, cells=n, steps=4, time_step=0.01)
    write_velocity(
        path / "0.orig/U", path / "0/U", np.random.default_rng(2).standard_normal((3, n, n, n)) / 3
    )
    log = run(path)
    u = velocity(path, "0.04", n)
    rms = np.sqrt((u**2).mean())
    assert np.abs(divergence(u, order, 2 * np.pi / n)).max() < 1e-13 * rms * n
    modes = np.fft.fftn(u, axes=(1, 2, 3)) / n**3
    for axis in (1, 2, 3):
        assert np.abs(np.take(modes, n // 2, axis)).max() < 1e-16
    assert rms > 0.1
    local = [float(x) for x in re.findall(r"sum local = (\S+),", log)]
    assert len(local) == 4 and max(local) < 1e-15
    utility(path, "postProcess", "-func", "div(phi)", "-latestTime")
    assert np.abs(fluidfoam.readscalar(str(path), "0.04", "div(phi)", verbose=False)).max() < 1e-12 * n * rms


def test_the_budget_closes(tmp_path):
    """dk/dt = P - epsilon of the solver's own Laplacian, to the third order of the time scheme; the residual of
    epsilon itself, and not that of a remainder."""
    force = "linearForcing { type linearForcing; mode constantPower; power 0.05; }"
    residuals = []
    for steps in (10, 20):
        path = box_case(tmp_path / str(steps), cells=16, steps=steps, time_step=0.8 / steps, fv_options=force)
        run(path)
        rows = read_dat(path / "postProcessing/linearForcing", "linearForcing.dat")
        assert len(rows["Time"]) == steps + 1 and rows["Time"][-1] == pytest.approx(0.8)
        # Simpson's rule is of fourth order
        weights = np.r_[1, np.tile([4, 2], steps // 2)[:-1], 1] * 0.8 / steps / 3
        residuals.append(
            abs(rows["k"][-1] - rows["k"][0] - weights @ (rows["power"] - rows["epsilonLaplacian"]))
        )
        np.testing.assert_allclose(rows["epsilonBudget"][3:], rows["epsilonLaplacian"][3:], rtol=5e-2)
    assert residuals[1] < 1e-4 * 0.25 and np.log2(residuals[0] / residuals[1]) > 2.5, residuals
