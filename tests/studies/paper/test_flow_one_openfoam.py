"""Flow I in OpenFOAM: it begins with the spectral solver's field and force, and continues."""

import numpy as np
import pytest

from gbm_plugin.output.tables import read_forcing
from gbm_plugin.spectral.presets import PRESETS
from gbm_plugin.statistics.series import TimeSeries
from gbm_plugin.studies.paper import flow_one, flow_one_openfoam

from conftest import DEFAULT_CASE

pytestmark = pytest.mark.openfoam


def test_it_begins_where_the_spectral_solver_is_and_continues(tmp_path):
    coarse = PRESETS["flow_I"].solver(cells=14, time_step=0.1)
    coarse.set_velocity(flow_one.random_velocity(14, rms=0.12))
    coarse.advance(4)
    np.savez(tmp_path / "start.npz", **coarse.state())
    words = dict(folder=tmp_path / "case", out=tmp_path / "flow", start=tmp_path / "start.npz", cells=16)
    words |= dict(time_step=0.1, every=0.2, settle=0.0)
    flow_one_openfoam.run(DEFAULT_CASE, end=1.2, **words)
    result = flow_one_openfoam.run(DEFAULT_CASE, end=2.4, **words)

    table = read_forcing(tmp_path / "case")
    np.testing.assert_allclose(table["Time"], 0.1 * np.arange(25), atol=1e-9)
    energetics = coarse.energetics()
    assert table["k"][0] == pytest.approx(
        energetics["kinetic_energy"], rel=1e-2
    )  # but for discrete divergence
    assert table["power"][0] == pytest.approx(energetics["power"], rel=1e-2)
    # the force goes on as the spectral solver's does
    for _ in range(24):
        coarse.forcing.advance(0.1)
    text = (tmp_path / "case/2.4/uniform/eswaranPope").read_text()
    assert f"draws           {int(coarse.forcing.state()['draws'])};" in text
    first = coarse.forcing.state()["amplitudes"][0].real
    assert f"({' '.join(f'{x:.17g}' for x in first)})" in text
    series = TimeSeries.read(tmp_path / "flow.csv")
    np.testing.assert_allclose(series["time"], 0.2 * np.arange(1, 13), atol=1e-9)
    assert {"dissipation", "power"} <= {row["quantity"] for row in result["rows"]}
    assert len([p for p in (tmp_path / "case").iterdir() if p.name[0].isdigit() and p.name != "0.orig"]) <= 3
