"""What OpenFOAM samples at beads, against an independent evaluation of the fields that it writes."""

from __future__ import annotations

import fluidfoam
import numpy as np
import pytest
from scipy.interpolate import KroghInterpolator

from gbm_plugin.case.openfoam import utility

from conftest import divide, set_entry
from probe import probe

pytestmark = pytest.mark.openfoam

BOX = 2 * np.pi
CELLS = 16


def special_positions(rng) -> np.ndarray:
    """Inside, on faces, edges and corners of cells and of ranks, on the box's faces, and boxes away."""
    h = BOX / CELLS
    inside = rng.uniform(-BOX, 2 * BOX, (40, 3))
    faces = rng.integers(-CELLS, 2 * CELLS, (20, 3)) * h
    centres = (rng.integers(-CELLS, 2 * CELLS, (20, 3)) + 0.5) * h
    box = np.array([(0, 0, 0), (BOX, BOX, BOX), (BOX, 0, 1.0), (0.5, BOX, BOX), (-BOX, 0.1, BOX / 2)])
    nearly = np.nextafter(np.array([(0.0, 0, 0), (BOX, BOX, BOX), (BOX / 2, BOX / 2, BOX / 2)]), -1)
    return np.concatenate([inside, faces, centres, box, nearly])


def trilinear(field: np.ndarray, positions: np.ndarray) -> np.ndarray:
    """Values (components, n, n, n) at cell centres, interpolated in the periodic box; by loops over corners."""
    x = positions * (CELLS / BOX) - 0.5
    low = np.floor(x).astype(int)
    w = x - low
    total = 0.0
    for corner in np.ndindex(2, 2, 2):
        index = tuple((low + corner).T % CELLS)
        weight = np.prod(np.where(corner, w, 1 - w), axis=1)
        total = total + weight[:, None] * field[(slice(None), *index)].T
    return total


def read(case, time: str, name: str, components: int) -> np.ndarray:
    """A written field by fluidfoam, (components, n, n, n), x first."""
    values = fluidfoam.readfield(str(case), time, name, verbose=False)
    return values.reshape(components, CELLS, CELLS, CELLS).transpose(0, 3, 2, 1)


@pytest.fixture(scope="module")
def positions():
    return special_positions(np.random.default_rng(5))


def test_velocity_and_rotation_are_those_of_the_written_fields(case, positions):
    path = case(steps=10, write_every=10)
    _, samples = probe(path, positions)
    time, velocity, rotation = samples[10]
    assert time == pytest.approx(0.2)
    utility(path, "postProcess", "-func", "vorticity", "-time", "0.2")
    u = read(path, "0.2", "U", 3)
    omega = read(path, "0.2", "vorticity", 3)
    gradients = [
        (np.roll(u, -1, axis=1 + d) - np.roll(u, 1, axis=1 + d)) * CELLS / (2 * BOX) for d in range(3)
    ]
    assert min(np.abs(g).max(axis=(1, 2, 3)).min() for g in gradients) > 0.1  # none of the nine vanishes
    # 12 digits are written
    np.testing.assert_allclose(velocity, trilinear(u, positions), atol=1e-11)
    np.testing.assert_allclose(rotation, 0.5 * trilinear(omega, positions), atol=1e-11)


@pytest.mark.parametrize("scheme, below", [("cubic", 1), ("quintic", 2)])
def test_lagranges_polynomials(case, positions, scheme, below):
    """Values and derivatives by scipy's polynomials through the cells around each bead, along each direction."""
    path = case(application="pimpleFoam", steps=1, interpolation=scheme)
    near = np.arange(-below, below + 2)
    _, samples = probe(path, positions, need="gradient")
    u = read(path, "0", "U", 3)
    _, velocity, gradient = samples[0]
    x = np.mod(positions, BOX) * (CELLS / BOX) - 0.5
    low = np.floor(x).astype(int)
    for bead in range(0, len(positions), 7):
        block = u[np.ix_(range(3), *((low[bead, d] + near) % CELLS for d in range(3)))]

        def along(values, place, derivative):
            polynomial = KroghInterpolator(near.astype(float), np.moveaxis(values, -1, 0))
            return polynomial.derivative(place) if derivative else polynomial(place)

        for derivative in (None, 0, 1, 2):
            values = block
            for d in (2, 1, 0):
                values = along(values, x[bead, d] - low[bead, d], derivative == d)
            if derivative is None:
                np.testing.assert_allclose(velocity[bead], values, atol=1e-12)
            elif bead < 40:  # at cell centres derivatives jump, and rounding chooses the side
                np.testing.assert_allclose(gradient[bead, :, derivative], values * CELLS / BOX, atol=1e-11)


@pytest.mark.parametrize("scheme, order", [("trilinear", 2), ("cubic", 4), ("quintic", 6)])
def test_order_of_the_interpolation(case, scheme, order):
    """Velocity of a field of modes |m| <= 2, at its own points; its gradient has an order of 2 or 3."""
    points = np.random.default_rng(3).uniform(0, BOX, (200, 3))
    errors = []
    for cells in (16, 32):
        path = case(
            str(cells), application="pimpleFoam", steps=1, cells=cells, interpolation=scheme, initial=ABC
        )
        _, samples = probe(path, points, need="gradient")
        _, velocity, gradient = samples[0]
        exact, slope = abc_flow(points)
        errors.append([np.abs(velocity - exact).max(), np.abs(gradient - slope).max()])
    found = np.log2(np.divide(*errors))
    assert abs(found[0] - order) < 0.35, errors
    assert found[1] > {2: 1.7, 4: 2.7, 6: 4.7}[order], errors


ABC = "field modes; modes (((0 0 2) (0 1 0) (-1 0 0)) ((1 0 0) (0 0 1) (0 -1 0)) ((0 2 0) (1 0 0) (0 0 -1)));"


def abc_flow(x: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The field of ABC, Re a exp(i m.x), and its gradient du_i/dx_j."""
    (sx, sy, sz), (cx, cy, cz) = (f(x * (1, 2, 2)).T for f in (np.sin, np.cos))
    u = np.stack([sz + cy, cz + sx, cx + sy], axis=-1)
    gradient = np.zeros((len(x), 3, 3))
    gradient[:, 0, 2], gradient[:, 0, 1] = 2 * cz, -2 * sy
    gradient[:, 1, 2], gradient[:, 1, 0] = -2 * sz, cx
    gradient[:, 2, 0], gradient[:, 2, 1] = -sx, 2 * cy
    return u, gradient


def test_gradient_on_the_wire_is_du_i_dx_j(case):
    """Simple shear u_x = sin(y): only [0, 1] is there, cos(y) to the second order of central differences."""
    path = case(steps=1, fv_options="", initial="field modes; modes (((0 1 0) (0 0 0) (-1 0 0)));")
    points = np.random.default_rng(1).uniform(0, BOX, (30, 3))
    _, samples = probe(path, points, need="gradient")
    _, velocity, gradient = samples[0]
    h = BOX / CELLS
    np.testing.assert_allclose(velocity[:, 0], np.sin(points[:, 1]), atol=0.5 * h**2 / 4)
    np.testing.assert_allclose(gradient[:, 0, 1], np.cos(points[:, 1]), atol=h**2)
    others = np.delete(gradient.reshape(-1, 9), 1, axis=1)
    assert np.abs(others).max() < 1e-12


@pytest.mark.parametrize("scheme", ["trilinear", "cubic"])
@pytest.mark.parametrize(
    "division", [(2, (1, 1, 2)), (4, (2, 2, 1)), (3, None)], ids=["slabs", "columns", "manual"]
)
def test_samples_do_not_depend_on_the_decomposition(case, positions, division, scheme):
    """The fields are the same at step 0, so that samples agree to rounding, points on rank faces included."""
    ranks, n = division
    options = {"application": "pimpleFoam", "steps": 1, "interpolation": scheme}
    serial, parallel = (case(name, **options) for name in ("serial", "parallel"))
    divide(parallel, ranks, n)
    _, expected = probe(serial, positions)
    _, found = probe(parallel, positions, ranks=ranks)
    np.testing.assert_allclose(found[0][1], expected[0][1], atol=1e-14)
    np.testing.assert_allclose(found[0][2], expected[0][2], atol=1e-13)


def test_a_rank_may_own_no_bead(case):
    path = case(steps=1, application="pimpleFoam")
    divide(path, 4, (1, 1, 4))
    _, samples = probe(path, np.full((3, 3), 0.3), ranks=4)
    assert np.ptp(samples[0][1], axis=0).max() == 0


@pytest.mark.parametrize("scheme", ["cell", "cellPoint", "cellPointFace", "pointMVC"])
def test_openfoams_own_schemes(case, positions, scheme):
    """Each is second order or, for `cell`, first order: near the trilinear values, and the same on two ranks."""
    path, parallel = (
        case("serial", application="pimpleFoam", steps=1, interpolation=scheme),
        case("parallel", application="pimpleFoam", steps=1, interpolation=scheme),
    )
    divide(parallel, 2, (1, 1, 2))
    inside = positions[:40]
    _, samples = probe(path, inside)
    _, on_two = probe(parallel, inside, ranks=2)
    u = read(path, "0", "U", 3)
    distance = np.abs(samples[0][1] - trilinear(u, inside)).max()
    assert distance < (0.6 if scheme == "cell" else 0.2) * np.abs(u).max()
    if (
        scheme != "cellPointFace"
    ):  # whose tetrahedra differ beside the boundary between ranks, in OpenFOAM itself
        np.testing.assert_allclose(on_two[0][1], samples[0][1], atol=1e-12)


def test_a_mesh_of_unequal_cells_is_searched(case):
    """Graded cells: trilinear is refused, cellPoint reproduces a field that is linear in the interior."""
    path = case(application="pimpleFoam", steps=1, interpolation="cellPoint", prepared=False)
    mesh = path / "system/blockMeshDict"
    mesh.write_text(mesh.read_text().replace("simpleGrading (1 1 1)", "simpleGrading (3 1 0.5)"))
    (path / "system/initialFieldDict").unlink()
    (path / "0.orig").rename(path / "0")
    utility(path, "blockMesh")
    points = np.random.default_rng(2).uniform(0, BOX, (50, 3))
    set_entry(path / "0/U", "internalField", "uniform (1 2 3)")
    (path / "constant/fvOptions").unlink()
    _, samples = probe(path, points)
    np.testing.assert_allclose(samples[0][1], np.tile([1.0, 2.0, 3.0], (50, 1)), atol=1e-12)
