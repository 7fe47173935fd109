"""constantViscosity: the viscous force of a divergence-free flow, without the term that vanishes."""

from __future__ import annotations

import subprocess

import fluidfoam
import numpy as np
import pytest

from gbm_plugin.case.openfoam import command, environment, fatal_message
from gbm_plugin.output.tables import read_dat

from conftest import HEADER, make_case, set_entry, start_solver

pytestmark = pytest.mark.openfoam

NU = 0.01
FORCING = "linearForcing { type linearForcing; mode constantCoefficient; A 0; }"  # its statistics alone
MODELS = {"ours": "constantViscosity", "stock": "Stokes"}
PISO = "PISO { nCorrectors 2; pRefCell 0; pRefValue 0; }\n"


def prepare(path, model: str = "ours", **options):
    """A case without fibers and force."""
    make_case(path, fv_options=FORCING, application="pimpleFoam", **options)
    control = path / "system/controlDict"
    control.write_text(control.read_text().split("functions")[0])
    (path / "constant/turbulenceProperties").write_text(
        HEADER + f"simulationType laminar; laminar {{ laminarModel {MODELS[model]}; }}\n"
    )
    return path


def log_of(path, application: str = "pimpleFoam") -> str:
    done = subprocess.run(command(application, path), env=environment(), capture_output=True, text=True)
    assert done.returncode == 0, done.stdout[-2000:] + done.stderr[-2000:]
    return done.stdout


@pytest.mark.parametrize("application", ["pimpleFoam", "pisoFoam"])
def test_a_mode_decays_with_the_eigenvalue_of_the_laplacian(tmp_path, application):
    """u_x = sin 2y is an exact solution: each step of implicit Euler divides it by 1 + nu k_h^2 dt."""
    cells, time_step, steps = 16, 0.1, 10
    path = prepare(
        tmp_path / "case",
        cells=cells,
        steps=steps,
        time_step=time_step,
        initial="field modes; modes (((0 2 0) (0 0 0) (-1 0 0)));",
    )
    schemes = path / "system/fvSchemes"
    text = schemes.read_text()
    head, _, rest = text.partition("ddtSchemes")
    schemes.write_text(head + "ddtSchemes { default Euler; }\n" + rest[rest.index("}") + 1 :])
    with (path / "system/fvSolution").open("a") as file:
        file.write(PISO)
    assert "laminar stress model constantViscosity" in log_of(path, application)
    h = 2 * np.pi / cells
    k = read_dat(path / "postProcessing/linearForcing", "linearForcing.dat")["k"]
    factor = 1 + NU * (2 / h * np.sin(h)) ** 2 * time_step
    np.testing.assert_allclose(k, 0.25 * factor ** (-2.0 * np.arange(steps + 1)), rtol=1e-9)


def test_the_stock_model_differs_by_the_order_of_the_mesh(tmp_path):
    """The term left out is zero but for the error of the mesh, at least second order. It is nearly a gradient, which
    the pressure takes: so the velocity differs by less still. Ours needs no scheme for it."""
    initial = "field random; spectrum table; table ((1 0.1) (2 0.1)); seed 1;"
    run = {"steps": 10, "time_step": 0.05, "write_every": 10, "initial": initial}
    sizes = (16, 24)
    differences = {"U": [], "p": []}
    for cells in sizes:
        fields = {}
        for model in MODELS:
            path = prepare(tmp_path / f"{model}{cells}", model, cells=cells, **run)
            set_entry(path / "constant/transportProperties", "nu", "0.1")
            if model == "ours":
                set_entry(path / "system/fvSchemes", "div((nuEff*dev2(T(grad(U)))))", "none")
            log_of(path)
            fields[model] = {
                name: fluidfoam.readfield(str(path), "0.5", name, verbose=False) for name in "Up"
            }
        for name, values in differences.items():
            ours, stock = fields["ours"][name], fields["stock"][name]
            values.append(np.linalg.norm(ours - stock) / np.linalg.norm(stock))
    for name, (coarse, fine) in differences.items():
        assert 1e-7 < fine < 2e-3, (name, coarse, fine)
        assert np.log(coarse / fine) / np.log(sizes[1] / sizes[0]) > 1.8, (name, coarse, fine)


def test_another_fluid_is_refused(tmp_path):
    path = prepare(tmp_path / "case", cells=4, steps=1, initial="field ABC;")
    (path / "constant/transportProperties").write_text(
        HEADER + "transportModel CrossPowerLaw; CrossPowerLawCoeffs { nu0 0.1; nuInf 0.01; m 1; n 1; }\n"
    )
    assert start_solver(path).wait() != 0
    message = fatal_message(path / "log.pimpleFoam")
    assert "transportModel 'CrossPowerLaw'" in message and "constantViscosity" in message
    assert "transportProperties" in message
