"""Only what a scene needs: by count of calls, bytes and lines of logs, beside a scene that does need it."""

from __future__ import annotations

import re
from collections import Counter

import pytest

from gbm_plugin.case.layout import results
from gbm_plugin.case.scene import read_scene
from gbm_plugin.coupling import daemon
from gbm_plugin.coupling.channel import Channel
from gbm_plugin.coupling.message import Kind
from gbm_plugin.fiber import Fibers, Stepper, ab3, implicit
from gbm_plugin.flow import ABC
from gbm_plugin.output.recording import open_recording
from gbm_plugin.report.paraview import write_series
from gbm_plugin.run.spectral import run_spectral
from gbm_plugin.spectral import SpectralSolver
from gbm_plugin.statistics import fibers as shape

from conftest import gbm, make_case, run_case, set_entry, start_solver

STEPS = 5
SOFT = "soft { count 4; beads 6; length 1.2; bendingStiffness 1e-6; seed 3; }"
STRAINED = "soft { count 4; beads 6; length 1.2; bendingStiffness 1e-6; mobility rpy; strainCoupling yes; }"
BEADS = 24


@pytest.fixture
def counted(monkeypatch):
    """Counts the calls of a method, function or property, under its name or that of an argument."""
    calls: Counter = Counter()

    def count(owner, name, key=lambda *_: None):
        there = owner[name] if isinstance(owner, dict) else owner.__dict__[name]
        function = there.fget if isinstance(there, property) else there

        def counting(*arguments, **named):
            calls[key(*arguments, **named) or name] += 1
            return function(*arguments, **named)

        if isinstance(owner, dict):
            monkeypatch.setitem(owner, name, counting)
        else:
            monkeypatch.setattr(owner, name, property(counting) if isinstance(there, property) else counting)

    calls.of = count
    return calls


def move(integrator, mobility="freeDrain", stiffness=1e-6, steps=8):
    """A coupled run of one family in a steady flow, a sample in each step; the stepper at its end."""
    fibers = Fibers.straight(4, 6, 1.2, stiffness, 1e-2, box=6.28, seed=3)
    tolerance = None if integrator == "ab3" else 1e-2
    stepper = Stepper(fibers, integrator=integrator, mobility=mobility, tolerance=tolerance)
    flow = ABC(0.2, 0.15, 0.1)
    for _ in range(steps):
        stepper.observe(stepper.time, *flow.sample(stepper.positions, stepper.time, stepper.need))
        stepper.advance(0.02)
    return stepper


@pytest.mark.parametrize("integrator", ["ab3", "implicit"])
def test_no_rpy_in_free_drain(counted, integrator):
    counted.of(ab3.ADVANCE, "rpy")
    counted.of(implicit.ATTEMPT, "rpy")
    move(integrator)
    assert not counted
    move(integrator, "rpy")
    assert counted["rpy"] >= 8


@pytest.mark.parametrize("module", [ab3, implicit])
def test_room_for_a_matrix_of_the_beads_with_rpy_alone(module):
    """Rows of scratch grow with the beads in free drain, with their square in RPY."""
    for mobility, straight in (("freeDrain", True), ("rpy", False)):
        short, longer, longest = (module.scratch_rows(mobility, beads) for beads in (10, 20, 40))
        assert (longest - longer == 2 * (longer - short)) is straight


@pytest.mark.parametrize("integrator", ["ab3", "auto"])
def test_no_sub_step_where_one_step_will_do(counted, integrator):
    """At 0.02, eq. (10) is 16 for the soft fibers, and 1.6e-3 for the stiff ones."""
    counted.of(implicit.ATTEMPT, "freeDrain")
    soft = move(integrator).report()
    assert soft["substeps"] == soft["steps"] == 8 and not counted
    stiff = move(integrator, stiffness=1e-2).report()
    assert stiff["substeps"] > stiff["steps"] if integrator == "ab3" else counted["freeDrain"] >= 8


def spectral(tmp_path, families=SOFT, fibers="", forcing=""):
    """A run of the other engine in this process, on 16^3."""
    case = make_case(tmp_path / "case", steps=STEPS, write_every=STEPS, families=families, prepared=False)
    properties, options = case / "constant/fiberProperties", case / "constant/fvOptions"
    properties.write_text(properties.read_text().replace("recordInterval 1;", f"recordInterval 1; {fibers}"))
    options.write_text(options.read_text().replace("mode ", f"{forcing} mode ", 1))
    assert run_spectral(read_scene(case))
    return case


def needed(*arguments, **named):
    return named.get("need", arguments[-1])


def test_what_is_sampled(tmp_path, counted):
    counted.of(SpectralSolver, "sample", needed)
    spectral(tmp_path / "a")
    assert set(counted) == {"rotation"} and counted["rotation"] > STEPS
    spectral(tmp_path / "b", STRAINED)
    assert counted["gradient"] > STEPS


def test_no_curvature_or_tension_in_a_run_that_records_none(tmp_path, counted):
    counted.of(shape, "curvature")
    counted.of(Fibers, "curvature")
    counted.of(Stepper, "tension")
    case = spectral(tmp_path / "a")
    assert not counted
    spectral(tmp_path / "b", fibers="record (tension);")
    assert counted == {"tension": STEPS + 1}
    with open_recording(results(case / "spectral")) as recording:
        write_series(recording, tmp_path)
    assert counted["curvature"] > 0


def test_no_statistics_of_a_flow_without_a_table(tmp_path, counted):
    counted.of(SpectralSolver, "energetics")
    case = spectral(tmp_path / "a", forcing="writeToFile no;")
    assert counted["energetics"] == 1  # of the state that is written
    assert not list(case.glob("spectral/postProcessing/linearForcing/*/*.dat"))
    spectral(tmp_path / "b")
    assert counted["energetics"] == 1 + STEPS + 1


@pytest.mark.openfoam
@pytest.mark.parametrize("families, numbers", [(SOFT, 6), (STRAINED, 12)])
def test_bytes_from_openfoam(tmp_path, monkeypatch, families, numbers):
    """Velocity and rotation, 6 numbers a bead; with the gradient in place of the rotation 12. The daemon of a real run
    in this process, which counts what comes."""
    case = make_case(
        tmp_path / "case", steps=STEPS, families=families, application="boxFoam", interpolation="cubic"
    )
    received: Counter = Counter()

    def receive(self, *most, original=Channel.receive):
        message = original(self, *most)
        received[message.kind] += 1
        received["bytes"] += len(message.payload) if message.kind is Kind.SAMPLE else 0
        return message

    monkeypatch.setattr(Channel, "receive", receive)
    solver = start_solver(case)
    try:
        daemon.serve(case)
        assert solver.wait(60) == 0
    finally:
        solver.kill()
    corrected = 2  # samples of provisional steps at the start
    assert received[Kind.SAMPLE] == STEPS + 1 + corrected
    assert received["bytes"] == received[Kind.SAMPLE] * BEADS * numbers * 8


@pytest.mark.openfoam
def test_boxfoam_computes_no_pressure_that_nobody_asked_for(tmp_path):
    def run(name, entry=""):
        case = make_case(
            tmp_path / name, steps=STEPS, write_every=STEPS, families=SOFT, application="boxFoam"
        )
        control = case / "system/controlDict"
        control.write_text(control.read_text() + entry)
        run_case(case)
        return case, (case / "log.boxFoam").read_text().count("Computing p and phi")

    written, computed = run("a")
    assert computed == 1 and {"U", "p", "phi"} <= {p.name for p in (written / "0.1").iterdir()}
    alone, none = run("b", "writePressure no;")
    assert none == 0 and not {"p", "phi"} & {p.name for p in (alone / "0.1").iterdir()}
    set_entry(alone / "system/controlDict", "endTime", "0.2")  # a restart needs neither
    run_case(alone)
    assert "Continuing from the state" in (alone / "log.boxFoam").read_text()


@pytest.mark.openfoam
def test_pimplefoam_sums_up_no_dissipation_without_a_table(tmp_path):
    """It needs grad(U), which nothing else does: a case without a scheme for it runs where there is no table."""

    def run(name, entry=""):
        case = make_case(tmp_path / name, steps=STEPS, families=SOFT, application="pimpleFoam")
        options, schemes = case / "constant/fvOptions", case / "system/fvSchemes"
        options.write_text(options.read_text().replace("mode ", f"{entry} mode ", 1))
        text, count = re.subn(r"(gradSchemes\s*\{\s*default\s+)[^;]*;", r"\1none;", schemes.read_text())
        assert count == 1
        schemes.write_text(text)
        return case, gbm("run", case)

    case, done = run("a", "writeToFile no;")
    assert done.returncode == 0, done.stderr
    assert not list(case.glob("postProcessing/linearForcing/*/*.dat"))
    _, done = run("b")
    assert done.returncode == 1 and "grad(U)" in done.stderr
