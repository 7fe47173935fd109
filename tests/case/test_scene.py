"""A case is read as it is written: defaults, overrides, units, macros."""

from __future__ import annotations

import math
import shutil

import numpy as np
import pytest

from gbm_plugin.case.initial import read_initial_field
from gbm_plugin.case.scene import Coupling, Forcing, Model, read_scene
from gbm_plugin.errors import CaseError

from conftest import DEFAULT_CASE, HEADER


@pytest.fixture
def case(tmp_path):
    path = tmp_path / "case"
    for folder in ("0.orig", "constant", "system"):
        shutil.copytree(DEFAULT_CASE / folder, path / folder, ignore=shutil.ignore_patterns("polyMesh"))
    return path


def fibers(case, text: str):
    (case / "constant/fiberProperties").write_text(HEADER + text)
    return read_scene(case)


ONE = "families { a { count 2; beads 5; length 1; bendingStiffness 0; } }"


def test_defaults(case):
    scene = fibers(case, ONE)
    assert scene.coupling == Coupling("socket", 120.0, "127.0.0.1", 0)
    assert (scene.density, scene.record_interval, scene.interpolation) == (1.0, 10, "trilinear")
    family = scene.families[0]
    assert family.model == Model(
        integrator="auto", mobility="freeDrain", bending_torque="consistent", curvature_law="sine"
    )
    assert (family.seed, family.shape, family.positions) == (1, "straight", None)
    assert family.bending_stiffness == 0 and family.radius == pytest.approx(0.1)


def test_words_of_all_families_and_of_one(case):
    scene = fibers(
        case,
        """rho 2; integrator implicit; tolerance 1e-3; curvatureLaw discreteRod;
        families
        {
            a { count 1; beads 2; length 1; bendingStiffness 1; }
            b { count 1; beads 2; length 1; bendingStiffness 1; integrator auto; curvatureLaw sine; tolerance 1e-5; }
        }""",
    )
    a, b = (f.model for f in scene.families)
    assert a == Model(integrator="implicit", curvature_law="discreteRod", tolerance=1e-3)
    assert b == Model(integrator="auto", tolerance=1e-5)
    assert scene.dynamic_viscosity == pytest.approx(2 * scene.kinematic_viscosity)


def test_stiffness_from_youngs_modulus_and_length_from_radius(case):
    """K^b = E pi d^4/64 of a round cross-section; L = 2 a N."""
    family = fibers(case, "families { a { count 1; beads 10; radius 0.05; youngModulus 7; } }").families[0]
    assert family.length == pytest.approx(1.0) and family.radius == pytest.approx(0.05)
    assert family.bending_stiffness == pytest.approx(7 * math.pi * 0.1**4 / 64, rel=1e-14)


def test_families_keep_their_order(case):
    text = "".join(f"{n} {{ count 1; beads 2; length 1; bendingStiffness 1; }}" for n in ("z", "a", "m"))
    assert [f.name for f in fibers(case, f"families {{ {text} }}").families] == ["z", "a", "m"]


def test_macros_keep_every_digit(case):
    mesh = case / "system/blockMeshDict"
    mesh.write_text(mesh.read_text().replace("($n $n $n)", "(24 24 24)"))
    scene = read_scene(case)
    assert scene.box == (2 * np.pi,) * 3  # $width of blockMeshDict
    assert scene.cells == (24, 24, 24) and scene.origin == (0, 0, 0)


def test_box_that_is_moved_and_scaled(case):
    mesh = case / "system/blockMeshDict"
    text = mesh.read_text().replace("scale   1;", "scale   0.5;").replace("(0      ", "(-1      ")
    mesh.write_text(text.replace("($n $n $n)", "(4 5 6)"))
    scene = read_scene(case)
    assert scene.cells == (4, 5, 6)
    assert scene.origin == (-0.5, 0, 0)
    assert scene.box == pytest.approx((0.5 + np.pi, np.pi, np.pi))


def test_mesh_of_several_blocks_is_openfoams_business(case):
    mesh = case / "system/blockMeshDict"
    block = "hex (0 1 2 3 4 5 6 7) ($n $n $n) simpleGrading (1 1 1)"
    mesh.write_text(mesh.read_text().replace(block, f"{block}\n    {block}"))
    assert read_scene(case).box is None


@pytest.mark.parametrize(
    "text, expected",
    [
        ("f { type linearForcing; mode constantPower; power 0.1; }", ("linearForcing", "constantPower", 0.1)),
        (
            "f { type linearForcing; mode constantCoefficient; A 2; }",
            ("linearForcing", "constantCoefficient", 2.0),
        ),
        (
            "f { type linearForcing; linearForcingCoeffs { mode constantPower; power 3; } }",
            ("linearForcing", "constantPower", 3.0),
        ),
        (
            "f { type eswaranPope; variance 2e-3; timeScale 3; cutoff 2; }",
            ("eswaranPope", None, 2e-3),
        ),
        ("f { type linearForcing; active no; mode constantPower; power 0.1; }", None),
        ("other { type meanVelocityForce; }", None),
    ],
)
def test_forcing(case, text, expected):
    (case / "constant/fvOptions").write_text(HEADER + text)
    forcing = read_scene(case).forcing
    if expected is None:
        assert forcing is None
    else:
        kind, mode, strength = expected
        assert isinstance(forcing, Forcing) and (forcing.name, forcing.type) == ("f", kind)
        assert forcing.values.get("mode") == mode and strength in forcing.values.values()


def test_two_forcings_are_one_too_many(case):
    one = "{ type linearForcing; mode constantPower; power 0.1; }"
    (case / "constant/fvOptions").write_text(HEADER + f"a {one} b {one}")
    with pytest.raises(CaseError, match="more than one active forcing"):
        read_scene(case)


def test_viscosity_with_dimensions(case):
    path = case / "constant/transportProperties"
    path.write_text(HEADER + "transportModel Newtonian;\nnu [0 2 -1 0 0 0 0] 2.5e-3;\n")
    assert read_scene(case).kinematic_viscosity == 2.5e-3
    path.write_text(HEADER + "transportModel Newtonian;\nnu nu [0 2 -1 0 0 0 0] 2.5e-4;\n")
    assert read_scene(case).kinematic_viscosity == 2.5e-4


def test_positions_from_a_file(case):
    x = np.zeros((3, 4, 3))
    x[:, :, 0] = 0.2 * np.arange(4)
    np.save(case / "constant/x.npy", x)
    scene = fibers(case, 'families { a { shape file; positions "constant/x.npy"; bendingStiffness 1; } }')
    family = scene.families[0]
    assert (family.count, family.beads) == (3, 4)
    assert family.length == pytest.approx(0.8)
    np.testing.assert_array_equal(family.positions, x)


def test_initial_field_kinds(case):
    path = case / "system/initialFieldDict"
    cells = (12, 12, 12)
    for text, energy in (
        ("field random; kineticEnergy 0.3; maxWavenumber 4;", 0.3),
        ("field random; spectrum table; table ((1 0.1) (3 0.2));", 0.3),
        ("field taylorGreenVortex; velocity 2;", 0.125 * 4),  # <u^2>/2 = U^2/8
        ("field ABC; A 1; B 2; C 3;", 7.0),  # (A^2 + B^2 + C^2)/2
        ("field modes; modes (((0 1 0) (0 0 0) (-1 0 0)));", 0.25),  # sin(y)
    ):
        path.write_text(HEADER + text)
        u = read_initial_field(case).modes.on_lattice(cells)
        assert 0.5 * (u**2).sum(axis=0).mean() == pytest.approx(energy, rel=1e-12), text


@pytest.mark.parametrize(
    "text, expected",
    [
        ("field wavy;", "'wavy'; allowed: random modes taylorGreenVortex ABC"),
        ("field random; kineticEnergy -1;", "'kineticEnergy'.*greater than 0"),
        ("field random; kineticEnergy 1; peak 3;", "unknown entry 'peak'"),
        ("field random; spectrum table; table (1 2);", "list of .shell energy."),
        ("field modes; modes (((1 0 0) (1 0 0) (0 0 0)));", "not perpendicular"),
        ("field modes; modes (((0.5 0 0) (0 1 0) (0 0 0)));", "whole numbers"),
        ("field modes; modes 3;", "must be a list"),
    ],
)
def test_initial_field_that_is_none(case, text, expected):
    (case / "system/initialFieldDict").write_text(HEADER + text)
    with pytest.raises(CaseError, match=expected):
        read_initial_field(case)
