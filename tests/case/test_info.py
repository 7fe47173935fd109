"""`gbm info`: the numbers that tell whether the model holds, against their definitions; the verdicts; one screen."""

from __future__ import annotations

import json
from dataclasses import replace

import numpy as np
import pytest

from gbm_plugin.case import cost as cost_module
from gbm_plugin.case.check import notes
from gbm_plugin.case.cost import cost
from gbm_plugin.case.expected import expected
from gbm_plugin.case.info import describe, figures
from gbm_plugin.case.layout import SPECTRAL
from gbm_plugin.case.new import PRESETS, new_case
from gbm_plugin.case.scene import read_scene
from gbm_plugin.case.solver import SPECTRAL_COURANT, TRUNCATED
from gbm_plugin.case.verdict import verdicts
from gbm_plugin.cli import main
from gbm_plugin.fiber import ab3, implicit
from gbm_plugin.simd import LANES
from gbm_plugin.spectral.modes import Modes
from gbm_plugin.spectral.solver import STABLE

from conftest import gbm, make_case, set_entry


@pytest.fixture
def path(tmp_path):
    families = "one { count 2; beads 20; length 2; bendingStiffness 1e-5; }"
    power = "linearForcing { type linearForcing; mode constantPower; power 0.0015; }"
    path = make_case(tmp_path / "case", cells=128, prepared=False, families=families, fv_options=power)
    set_entry(path / "constant/transportProperties", "nu", "0.001")
    return path


def judged(path, **changes):
    scene = replace(read_scene(path), **changes)
    return {v.name: v for v in verdicts(scene, expected(scene))}


def test_flow_one_of_the_paper(path):
    """Flow I: eta = 0.0286 (table 1), and d/eta = 3.5 of its fibers, which are d = 0.1 wide."""
    result = figures(read_scene(path))
    family = result["families"]["one"]
    assert result["flow"]["kolmogorov_length"] == pytest.approx(0.0286, rel=2e-3)
    assert family["diameter"] == pytest.approx(0.1)
    assert family["diameter_over_eta"] == pytest.approx(3.5, rel=5e-3)
    assert family["persistence_length"] == pytest.approx(
        (1e-5) ** 0.25 / (1e-3 * 1.5e-3) ** 0.125
    )  # eq. (15)
    assert family["time_step_limit"] == pytest.approx(1e-3 * 0.1**4 / 1e-5)  # eq. (10)
    assert result["flow"]["cell_size"] == pytest.approx(2 * np.pi / 128)


def test_the_command_says_them(path, tmp_path):
    done = gbm("info", path, "--json", tmp_path / "figures.json")
    assert done.returncode == 0, done.stderr
    assert "eta 0.029 m" in done.stdout and "eps 0.0015 m2/s3 (the power)" in done.stdout
    assert json.loads((tmp_path / "figures.json").read_text())["families"]["one"]["sub_steps"] == 2


@pytest.mark.parametrize("preset", PRESETS)
def test_it_is_one_screen(tmp_path, preset):
    """80 columns, at most 45 lines; what is not good says what to change."""
    result = figures(read_scene(new_case(tmp_path / "mycase", preset)))
    lines = describe(result).splitlines()
    assert max(map(len, lines)) <= 80 and len(lines) <= 45
    assert all(v["change"] for v in result["verdicts"] if v["grade"] != "good")
    # whose flow is the other engine's, or whose fibers are the paper's: as wide and as limp
    if not preset.startswith(("flow-II", "flow-I-families")):
        assert all(v["grade"] != "wrong" for v in result["verdicts"])


def test_verdicts_and_the_line_to_change(path):
    """Each is wrong where the number says so, and good once the line that it names is changed."""
    found = judged(path)
    assert found["d/eta"].grade == "doubtful" and found["dx/eta"].grade == "good"
    coarse = judged(path, cells=(40, 40, 40))["dx/eta"]
    assert coarse.grade == "wrong" and coarse.value == pytest.approx(2 * np.pi / 40 / 0.0286, rel=2e-3)
    cells = int(coarse.change.split()[1])
    assert judged(path, cells=(cells,) * 3)["dx/eta"].grade == "good"
    assert judged(path, cells=(cells - 4,) * 3)["dx/eta"].grade == "doubtful"
    late = judged(path, time_step=0.5)["dt/tau_eta"]
    assert late.value == pytest.approx(0.5 / np.sqrt(1e-3 / 1.5e-3)) and late.grade == "wrong"
    assert judged(path, time_step=float(late.change.split()[1]))["dt/tau_eta"].grade == "good"
    fast = judged(path, application="boxFoam", time_step=0.1)["Courant"]
    assert fast.grade == "wrong"
    step = float(fast.change.split()[1])
    assert judged(path, application="boxFoam", time_step=step)["Courant"].grade == "good"


@pytest.mark.parametrize(
    "entry, name, grade",
    [
        ("length 8", "d/eta", "wrong"),
        ("length 8", "L/box", "wrong"),
        ("length 4", "L/box", "doubtful"),
        ("length 2; integrator implicit", "sub-steps", "good"),
    ],
)
def test_what_a_family_is_told(path, entry, name, grade):
    fibers = path / "constant/fiberProperties"
    fibers.write_text(fibers.read_text().replace("length 2", entry))
    assert judged(path)[name].grade == grade


def test_too_stiff_for_ab3_and_too_soft_for_its_beads(path):
    fibers = path / "constant/fiberProperties"
    text = fibers.read_text()
    fibers.write_text(text.replace("1e-5", "1"))
    verdict = judged(path)["sub-steps"]
    assert verdict.grade == "doubtful" and "integrator auto" in verdict.change
    fibers.write_text(text.replace("1e-5", "1e-9"))
    assert judged(path)["l_p/2a"].grade == "wrong"


def test_a_wrong_number_is_noted_when_it_runs(path):
    set_entry(path / "system/controlDict", "deltaT", "0.5")
    said = notes(read_scene(path))
    assert any(
        n.startswith("dt/tau_eta is 0.612, wrong") and n.endswith("change to deltaT 0.22 (controlDict)")
        for n in said
    )


def test_dissipation_of_each_forcing(path):
    """Given by constantPower; u'^3/eps = 0.19 box with a coefficient; by Eswaran & Pope about that of Flow I; from the
    initial field without any: nu times its enstrophy at least."""
    options = path / "constant/fvOptions"
    head = options.read_text().partition("linearForcing")[0]
    assert expected(read_scene(path)).dissipation == 0.0015
    options.write_text(f"{head}f {{ type linearForcing; mode constantCoefficient; A 0.1; }}")
    flow = expected(read_scene(path))
    assert flow.dissipation == pytest.approx(3 * 0.1 * flow.velocity**2)
    assert flow.velocity**3 / flow.dissipation == pytest.approx(0.19 * 2 * np.pi)
    options.write_text(f"{head}f {{ type eswaranPope; variance 5.53e-7; timeScale 7.65; cutoff 3.4641; }}")
    assert expected(read_scene(path)).dissipation == pytest.approx(0.0015, rel=0.2)
    options.unlink()
    set_entry(path / "constant/transportProperties", "nu", "10")
    (path / "system/initialFieldDict").write_text("FoamFile { } field ABC; A 1; B 1; C 1;")
    flow = expected(read_scene(path))
    assert flow.dissipation == pytest.approx(10 * 3)  # nu <omega^2>, curl u = u
    assert flow.velocity == pytest.approx(1)
    assert 3 < flow.speed <= 3 * 2**0.5 * 1.01


def test_a_flow_that_nothing_tells_of_is_not_judged(path):
    (path / "constant/fvOptions").unlink()
    (path / "system/initialFieldDict").unlink()
    result = figures(read_scene(path))
    assert result["flow"]["kolmogorov_length"] is None
    assert {v["name"] for v in result["verdicts"]} == {"sub-steps", "L/box"}
    assert "its scales are not judged" in describe(result)


def test_what_is_done_and_why(path):
    """A choice and its reason for each, and what nothing asks for."""
    fibers = path / "constant/fiberProperties"
    fibers.write_text(
        fibers.read_text().replace("integrator ab3;", "integrator auto; record (tension);")
        .replace("length 2;", "length 2; mobility rpy; strainCoupling yes;")
    )  # fmt: skip
    result = figures(read_scene(path))
    family, sampling = result["computes"][-2:]
    assert "RPY" in family["how"] and "strain" in family["how"] and family["why"] == "auto: eq. (10) asks 2"
    assert "gradient" in sampling["how"] and sampling["why"] == "one: strainCoupling"
    assert result["exchanges"]["how"].startswith("960 B out, 3.84 kB back")  # 40 beads: 24 and 96 bytes each
    assert result["left_out"] == ["repulsion", "statistics on the fly", "feedback"]
    assert any("tension" in item["how"] for item in result["stores"])


def test_the_estimate_follows_the_work(path, monkeypatch):
    """Twice the steps, twice the time but for the start; cells, beads and sub-steps each in proportion."""
    scene = read_scene(path)
    scene = replace(scene, application="boxFoam", write_interval=np.inf)
    once, twice = (cost(replace(scene, end_time=t), slower=1.0) for t in (4.0, 8.0))
    for part in ("flow", "solver"):
        assert getattr(twice, part) == pytest.approx(2 * getattr(once, part))
    mesh = replace(scene, application="pimpleFoam", end_time=4.0)  # which waits for its coupling
    assert once.coupling == 0 and cost(mesh, slower=1.0).coupling == pytest.approx(once.solver - once.flow)
    assert twice.start == once.start
    assert cost(replace(scene, end_time=4.0), slower=3.0).flow == pytest.approx(3 * once.flow)
    large = cost(replace(scene, cells=(256, 256, 256), end_time=4.0), slower=1.0)
    assert large.flow == pytest.approx(8 * once.flow, rel=0.05)
    assert cost(replace(scene, application="icoFoam"), slower=1.0).total is None
    monkeypatch.setattr(cost_module.os, "sched_getaffinity", lambda _: {0})  # a core for both sides
    stiff = replace(scene.families[0], bending_stiffness=1.0, count=1000)
    softer = replace(stiff, bending_stiffness=0.5)
    hard, half = (
        cost(replace(scene, families=(f,), end_time=4.0), slower=1.0).fibers for f in (stiff, softer)
    )
    assert hard == pytest.approx(2 * half, rel=0.01)


def test_the_other_engine(path):
    """One process, which hides nothing; k_max is 2/3 of that of the nodes, AB3 is stable to 0.34."""
    set_entry(path / "constant/fiberProperties", "interpolation", "cubic")
    own = replace(read_scene(path), end_time=4.0, write_interval=np.inf)
    scene = replace(own, application=SPECTRAL)
    assert STABLE["ab3"] == SPECTRAL_COURANT
    assert pytest.approx(2 * Modes(600, 1.0).cut / 600, rel=1e-2) == TRUNCATED
    once, twice = (cost(replace(scene, end_time=t), slower=1.0) for t in (4.0, 8.0))
    assert once.total == pytest.approx(once.solver + once.daemon + once.start + once.writing)
    assert twice.fibers == pytest.approx(2 * once.fibers) and twice.coupling == pytest.approx(
        2 * once.coupling
    )
    start = 6 * cost_module.MODES * 128**3  # two steps of four right-hand sides
    assert 2 * once.flow - twice.flow == pytest.approx(start)
    larger = cost(replace(scene, cells=(256,) * 3), slower=1.0)
    assert larger.flow == pytest.approx(8 * once.flow, rel=0.05)
    result = figures(scene)
    assert (
        result["exchanges"]["how"].startswith("nothing") and "spectral/<time>" in result["stores"][0]["how"]
    )
    assert max(map(len, describe(result).splitlines())) <= 80
    found = {v["name"]: v for v in result["verdicts"]}
    fine = judged(path, application=SPECTRAL, cells=(128,) * 3)["dx/eta"]  # good for boxFoam
    cells = int(fine.change.split()[1])
    assert fine.grade == "doubtful" and cells == pytest.approx(128 * fine.value / (2 * np.pi / 4.5), abs=2)
    assert "0.34" in found["Courant"]["asked"]


def test_the_other_engine_by_the_command(path):
    set_entry(path / "constant/fiberProperties", "interpolation", "cubic")
    done = gbm("info", path, "--flow", "spectral")
    assert done.returncode == 0 and "--flow spectral" in done.stdout, done.stderr
    assert done.stdout.count("pseudo-spectral") == 1
    set_entry(path / "constant/fiberProperties", "interpolation", "cellPoint")
    done = gbm("info", path, "--flow", "spectral")
    assert done.returncode == 1 and "allowed: trilinear cubic quintic exact" in done.stderr


@pytest.mark.parametrize("integrator, module", [("ab3", ab3), ("implicit", implicit)])
def test_what_hydrodynamic_interactions_take(path, integrator, module):
    """N^3 a fiber, and eight at once; memory of the kernels' own scratch, to a tenth."""
    scene = read_scene(path)
    model = replace(scene.families[0].model, integrator=integrator)
    fibers = replace(scene.families[0], beads=500, count=8, bending_stiffness=0.0, model=model)

    def taken(**changes):
        family = replace(fibers, **changes)
        return cost(replace(scene, families=(family,)), slower=1.0)

    drained, coupled = (taken(model=replace(model, mobility=word)) for word in ("freeDrain", "rpy"))
    rows = module.scratch_rows("rpy", 500) - module.scratch_rows("freeDrain", 500)
    cores = len(cost_module.os.sched_getaffinity(0))
    assert coupled.memory - drained.memory == pytest.approx(cores * rows * LANES * 8, rel=0.1)
    fibers = replace(fibers, model=replace(model, mobility="rpy"))
    assert taken(count=1).daemon == pytest.approx(coupled.daemon, rel=1e-3)
    assert taken(count=9).daemon == pytest.approx(2 * coupled.daemon, rel=1e-3)
    assert taken(beads=1000).daemon == pytest.approx(8 * coupled.daemon, rel=0.1)


def test_fibers_that_outlast_the_patience_of_the_solver(path):
    """Dense systems of 500 beads take longer than it waits, and are judged good with the timeout that is named."""
    fibers = path / "constant/fiberProperties"
    text = fibers.read_text().replace("integrator ab3;", "integrator implicit; coupling { timeout 10; }")
    fibers.write_text(text.replace("beads 20;", "beads 500; mobility rpy;"))
    scene = read_scene(path)
    (found,) = cost_module.patience(scene, cost(scene, slower=1.0))
    assert found.grade == "wrong" and found.value > 10
    longer = replace(scene.coupling, timeout=float(found.change.split()[1]))
    patient = replace(scene, coupling=longer)
    assert not cost_module.patience(patient, cost(patient, slower=1.0))
    assert not cost_module.patience(replace(scene, application=SPECTRAL), cost(scene, slower=1.0))


def test_it_takes_a_moment(path, capsys):
    """The measurement of the machine is repeated transforms, and nothing that needs compiled kernels."""
    assert main(["info", str(path)]) == 0
    assert "on this machine, idle" in capsys.readouterr().out
    assert 0.05 < cost_module.machine() < 50
