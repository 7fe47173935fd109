import csv
import json
import shutil

import numpy as np
import pytest

from gbm_plugin.case.mesh import box_mesh
from gbm_plugin.output import field
from gbm_plugin.output.recording import Recorder, open_recording
from gbm_plugin.report.paraview import write_series
from gbm_plugin.report.report import report

from fake_case import (
    BLOCK_MESH,
    bent_fibers,
    make_case,
    random_flow,
    write_forcing_table,
    write_mesh,
    write_velocity,
)
from sample_records import BOX, FAMILIES, SCENE, records

needs_mesh = pytest.mark.skipif(BLOCK_MESH is None, reason="OpenFOAM's blockMesh is not installed")
FIGURES = ["end_to_end", "energy", "fibers", "spectrum"]


@pytest.fixture(scope="module")
def case(tmp_path_factory):
    return make_case(tmp_path_factory.mktemp("run") / "case", cells=16)


def read_csv(path):
    with path.open(newline="", encoding="utf-8") as file:
        names, *rows = csv.reader(file)
    return dict(zip(names, np.array(rows, dtype=float).T, strict=True))


@needs_mesh
@pytest.mark.openfoam
def test_whole_report(case):
    key = report(case)
    folder = case / "report"
    assert key["not_drawn"] == []
    for name in FIGURES:
        assert (folder / f"{name}.png").read_bytes().startswith(b"\x89PNG")
        assert (folder / f"{name}.pdf").read_bytes().startswith(b"%PDF")
    text = (folder / "report.json").read_text()
    assert json.loads(text, parse_constant=lambda word: pytest.fail(word)) == key
    assert set(key["files"]) == {path.name for path in folder.iterdir() if path.is_file()} - {"report.json"}

    # the flow: known formulas of the synthetic tables, of the restart from where both exist
    assert key["flow"]["time"] == pytest.approx([0.02, 2.0])
    assert key["flow"]["numerical_dissipation_fraction"] == pytest.approx(0.03, abs=1e-12)
    times = np.arange(1.02, 2.001, 0.02)
    k = 0.5 + 0.08 * np.sin(1.3 * times) + 0.02 * np.sin(7.1 * times)
    assert key["flow"]["kinetic_energy"] == pytest.approx(k.mean(), rel=1e-12)
    assert np.all(np.diff(read_csv(folder / "flow.csv")["Time"]) > 0)

    # the spectrum: all energy is found, and Parseval says how much there is
    velocity = random_flow(16)
    assert key["spectrum"]["time"] == 2 and key["spectrum"]["cells"] == [16, 16, 16]
    assert key["spectrum"]["kinetic_energy"] == pytest.approx(
        0.5 * (velocity**2).sum(axis=0).mean(), rel=1e-10
    )
    assert read_csv(folder / "spectrum.csv")["k [rad/m]"][-1] == pytest.approx(8)

    # the fibers: against a direct evaluation
    table = read_csv(folder / "fibers.csv")
    chains = bent_fibers(0.05 * np.arange(41), 12, 20, 0.05, 0.7, 1)
    ratio = (((chains[:, :, -1] - chains[:, :, 0]) ** 2).sum(axis=-1) / 1.9**2).mean(axis=1)
    np.testing.assert_allclose(table["stiff: <R^2>/(2a(N-1))^2"], ratio, rtol=1e-10)
    assert key["fibers"]["records"] == 41
    assert key["fibers"]["families"]["stiff"]["R2_over_length2_mean"] == pytest.approx(
        ratio[20:].mean() * 0.95**2, rel=1e-10
    )
    assert key["fibers"]["families"]["soft"]["worst_link_length_error"] < 1e-12


@needs_mesh
@pytest.mark.openfoam
def test_velocity_has_x_fastest_and_the_mesh_its_cells(case):
    cells, origin, size = box_mesh(case)
    assert cells == (16, 16, 16)
    np.testing.assert_allclose(origin, 0, atol=1e-12)
    np.testing.assert_allclose(size, BOX, rtol=1e-5)
    assert field.latest_time(case, "U") == "2"
    np.testing.assert_allclose(field.read_velocity(case, "2", cells), random_flow(16), atol=1e-12)


@needs_mesh
def test_mesh_that_is_not_a_uniform_box_is_refused(tmp_path):
    write_mesh(tmp_path, 4)
    file = tmp_path / "constant/polyMesh/points"
    text = file.read_text()
    inner = next(line for line in text.splitlines() if line.startswith("(1.57"))
    file.write_text(text.replace(inner, inner.replace("1.57", "1.27")))
    with pytest.raises(ValueError, match="not one block of equal cells"):
        box_mesh(tmp_path)


def test_vorticity_of_an_abc_flow_converges_at_second_order():
    """For A = B = C = 1 the vorticity is the velocity itself."""
    errors = []
    for n in (16, 32):
        x, y, z = np.meshgrid(*[(np.arange(n) + 0.5) * BOX / n] * 3, indexing="ij")
        u = np.stack([np.sin(z) + np.cos(y), np.sin(x) + np.cos(z), np.sin(y) + np.cos(x)])
        magnitude = np.sqrt((u**2).sum(axis=0))
        errors.append(np.abs(field.vorticity_magnitude(u, np.full(3, BOX)) - magnitude).max())
    assert np.log2(errors[0] / errors[1]) == pytest.approx(2, abs=0.05)


def test_only_fibers(tmp_path):
    path = tmp_path / "postProcessing/fibers/0/fibers.h5"
    with Recorder(path, FAMILIES, **SCENE) as recorder:
        recorder.append(0, 0.0, records(0))
    key = report(tmp_path)
    assert {"end_to_end.png", "fibers.png", "fibers.csv"} <= set(key["files"])
    assert key["flow"] is None and key["spectrum"] is None
    assert len(key["not_drawn"]) == 2 and "no table of a forcing" in key["not_drawn"][0]


def test_one_fiber_has_no_standard_error_and_json_no_nan(tmp_path):
    family = FAMILIES[0].__class__("one", 1, 2, 0.5, 1.0)
    with Recorder(tmp_path / "postProcessing/fibers/0/fibers.h5", [family], **SCENE) as recorder:
        recorder.append(0, 0.0, [np.array([[[0.0, 0, 0], [1, 0, 0]]])])
    report(tmp_path)
    text = (tmp_path / "report/report.json").read_text()
    assert "NaN" not in text and "Infinity" not in text


def test_missing_column_is_said_and_nan_averages_are_null(tmp_path):
    write_forcing_table(tmp_path, 0, np.arange(0.1, 1.01, 0.1))
    file = tmp_path / "postProcessing/linearForcing/0/linearForcing.dat"
    lines = [line.split("\t") for line in file.read_text().splitlines()]
    names = lines[0]
    for row in lines[1:]:
        row[names.index("eta")] = "nan"
    at = names.index("epsilonGradient")
    file.write_text("".join("\t".join(row[:at] + row[at + 1 :]) + "\n" for row in lines))
    key = report(tmp_path)
    assert "epsilonGradient: no such column in the table of the forcing" in key["not_drawn"]
    assert key["flow"]["kolmogorov_length"] is None and "dissipation_gradient" not in key["flow"]
    assert json.loads((tmp_path / "report/report.json").read_text())["flow"]["kolmogorov_length"] is None


def test_nothing_to_report(tmp_path):
    with pytest.raises(FileNotFoundError, match="no case at"):
        report(tmp_path / "absent")
    with pytest.raises(FileNotFoundError, match="nothing to report"):
        report(tmp_path)
    assert list(tmp_path.iterdir()) == []


@needs_mesh
@pytest.mark.openfoam
def test_decomposed_case_is_read(case, tmp_path):
    """U only in processor folders: put together by the cells' addresses."""
    copy = tmp_path / "case"
    shutil.copytree(case, copy)
    velocity = random_flow(16)
    whole = (copy / "2/U").read_text()
    rows = velocity.transpose(0, 3, 2, 1).reshape(3, -1).T
    shutil.rmtree(copy / "2")
    owner = np.random.default_rng(0).integers(0, 2, size=len(rows))
    for rank in range(2):
        mine = np.flatnonzero(owner == rank)
        folder = copy / f"processor{rank}"
        (folder / "constant/polyMesh").mkdir(parents=True)
        for name in ("points", "owner", "neighbour", "faces", "boundary"):
            shutil.copy(copy / "constant/polyMesh" / name, folder / "constant/polyMesh" / name)
        (folder / "constant/polyMesh/cellProcAddressing").write_text(
            "FoamFile\n{\n version 2.0;\n format ascii;\n class labelList;\n object cellProcAddressing;\n}\n"
            f"{len(mine)}\n(\n" + "\n".join(map(str, mine)) + "\n)\n"
        )
        write_velocity(folder, "2", velocity)
        values = "\n".join("({:.15g} {:.15g} {:.15g})".format(*row) for row in rows[mine])
        head, tail = whole[: whole.index("\n4096\n")], whole[whole.index("\n)\n;") :]
        (folder / "2/U").write_text(f"{head}\n{len(mine)}\n(\n{values}{tail}")
    assert field.latest_time(copy, "U") == "2"
    np.testing.assert_allclose(field.read_velocity(copy, "2", (16, 16, 16)), velocity, atol=1e-12)


@needs_mesh
@pytest.mark.openfoam
def test_restarted_run_gives_one_series(case, tmp_path):
    with open_recording(case / "postProcessing/fibers") as recording:
        np.testing.assert_allclose(recording.times, 0.05 * np.arange(41), atol=1e-12)
        path = write_series(recording, tmp_path, wrapped=True)
    assert path.read_text().count("<DataSet") == 41
