"""Point forces in the solver: spread by the transpose of sampling, and what suspensions of rods do to a flow."""

import itertools

import numpy as np
import pytest

from gbm_plugin import Fibers
from gbm_plugin.fiber import Group, Stepper
from gbm_plugin.spectral import SpectralSolver

from .fields import nodes, noise


def free_loads(count):
    """Places, and forces and torques of no sum: the solver leaves out what would move the whole fluid."""
    random = np.random.default_rng(3)
    force, torque = random.standard_normal((2, count, 3))
    return random.uniform(-5, 8, (count, 3)), force - force.mean(axis=0), torque


@pytest.mark.parametrize("word", ["trilinear", "cubic", "quintic", "exact"])
@pytest.mark.parametrize("precision", ["double", "single"])
def test_spreading_is_the_transpose_of_sampling(word, precision):
    """Σ F·u + T·½∇×u of the sampled flow is ∫ f·u, whatever the interpolation."""
    solver = SpectralSolver(16, 0.01, box=3.0, time_step=0.01, interpolation=word, precision=precision)
    solver.set_velocity(noise(16))
    x, force, torque = free_loads(200)
    velocity, rotation = solver.sample(x, 0.0, "rotation")
    solver.set_point_forces(x, force, torque)
    given = (force * velocity).sum() + (torque * rotation).sum()
    size = np.abs(force * velocity).sum()
    assert (
        abs(solver.energetics()["exchange"] * 3.0**3 - given)
        < (1e-13 if precision == "double" else 1e-6) * size
    )
    k, density = solver.exchange_spectrum()
    assert density.sum() * k[1] == pytest.approx(solver.energetics()["exchange"], rel=1e-5)
    # and the solver's own slope gains it
    budget = solver.energy_budget()
    assert abs(budget["transfer"]) < (1e-12 if precision == "double" else 1e-4)


def test_a_couple_spins_the_fluid_as_two_forces_do():
    """The far field of a torque is that of a pair of opposite forces d apart, F d = T, whose symmetric part is taken
    away by the pair turned by 90 degrees."""
    solver = SpectralSolver(32, 0.01, time_step=0.01, interpolation="exact")
    d, centre = 0.01, np.array([1.0, 2.0, 3.0])
    arms = np.array([[1, 0, 0], [-1, 0, 0], [0, 1, 0], [0, -1, 0]]) * d / 2
    turned = np.cross([0, 0, 1], arms)
    solver.set_point_forces(centre + arms, turned / (2 * (d / 2) ** 2) / 2)
    pairs = solver.operators.to_physical(solver._points)
    solver.set_point_forces(centre[None], np.zeros((1, 3)), np.array([[0.0, 0.0, 1.0]]))
    couple = solver.operators.to_physical(solver._points)
    assert np.abs(pairs - couple).max() < 1e-3 * np.abs(couple).max()


def test_threads_change_no_bit():
    """Each thread adds to layers of its own, in the order of the points."""
    x, force, torque = free_loads(20_000)
    found = []
    for threads in (1, 3):
        solver = SpectralSolver(16, 0.01, box=3.0, time_step=0.01, interpolation="cubic", threads=threads)
        solver.set_point_forces(x, force, torque)
        found.append(solver._points)
    np.testing.assert_array_equal(*found)


def test_no_points_no_change():
    flows = []
    for forces in (None, np.zeros((1, 3))):
        solver = SpectralSolver(8, 0.01, time_step=0.01)
        solver.set_velocity(noise(8))
        solver.set_point_forces(np.zeros((1, 3)), forces)
        solver.advance(5)
        flows.append(solver.coefficients)
    np.testing.assert_array_equal(*flows)


def test_bad_points_are_refused():
    solver = SpectralSolver(8, 0.01, time_step=0.01)
    with pytest.raises(ValueError, match="2 forces at 1 positions"):
        solver.set_point_forces(np.zeros((1, 3)), np.zeros((2, 3)))
    with pytest.raises(ValueError, match="must be finite"):
        solver.set_point_forces(np.zeros((1, 3)), np.full((1, 3), np.nan))


ICOSAHEDRON = np.array([(0, 1, g) for g in (1, -1)]) * (1, 1, (1 + 5**0.5) / 2)
# its six axes: isotropic up to fourth order
AXES = np.concatenate([np.roll(ICOSAHEDRON, turn, axis=1) for turn in range(3)])


def suspension(beads, length, places, axes):
    """Rods along each of the axes at each of so many places along z."""
    axes = axes / np.linalg.norm(axes, axis=1, keepdims=True)
    s = length / beads * (np.arange(beads) - (beads - 1) / 2)
    rods = s[:, None] * axes[:, None]
    shift = np.zeros((places, 1, 1, 3))
    shift[..., 2] = 2 * np.pi * (np.arange(places) / places)[:, None, None]
    return (rods + shift).reshape(-1, beads, 3)


def damping(beads, length, wave, axes=AXES, integrator="implicit"):
    """ν_f/ν of a weak Kolmogorov flow u_x = sin kz, from the decay of the mode in the solver with and without rods; the
    same of what they make of u_y; and how many they are in a volume."""
    nu, step, decayed = 1.0, 1e-3, []
    for coupled in (False, True):
        solver = SpectralSolver(16, nu, time_step=step, interpolation="exact")
        start = np.zeros((3, 16, 16, 16))
        start[0] = np.sin(wave * nodes(16)[2])
        solver.set_velocity(start)
        fibers = Fibers(suspension(beads, length, 5, axes), 1e4 * length**4, 1.0)
        stepper = Stepper(fibers, 0.0, integrator=integrator)
        for _ in range(3):
            if coupled:
                velocity, rotation = solver.sample(fibers.positions, solver.time, "rotation")
                stepper.observe(0.0, velocity, rotation)
                r = stepper.reaction(step)
                solver.set_point_forces(fibers.positions, r.force, r.torque)
            solver.advance(1)
        along, across, _ = solver.coefficients[:, 0, 0, wave]
        decayed.append(-np.log(2 * abs(along)))
    turned = -(across / along).real / (nu * wave**2 * solver.time)
    return decayed[1] / decayed[0] - 1, turned, fibers.count / (2 * np.pi) ** 3


def theory(beads, length, number_density):
    """(2π/15) n a³ N(N² − 1), and what the rotational drag ζ_r = 8πμa³ N of beads on a rod adds to ζ = 6πμa Σ s²: a rod
    that turns with p × E·p/(1 + ζ_r/ζ) leaves (2/15 + 1/5 ζ_r/(ζ + ζ_r)) ζ of a random strain, instead of 2/15 ζ.
    Where N is odd, beads that turn a little against their neighbours have N − 1/N times 8πμa³."""
    a = length / (2 * beads)
    limit = 2 * np.pi / 15 * number_density * a**3 * beads * (beads**2 - 1)
    ratio = 4 / (beads**2 - 1) * (1 - beads % 2 / beads**2)
    return limit, limit * (1 + 1.5 * ratio / (1 + ratio))


@pytest.mark.parametrize("beads", [2, 5, 20])
def test_rods_damp_a_weak_kolmogorov_flow_as_theory_says(beads):
    found, turned, density = damping(beads, 0.05, 1)
    limit, chain = theory(beads, 0.05, density)
    assert found == pytest.approx(chain, rel=2e-3)
    assert found > 1.005 * limit
    assert abs(turned) < 1e-9 * found


@pytest.mark.parametrize("axis", [(1, 2, 3), (1, 0, 1)])
def test_aligned_rods_damp_and_turn_it_by_their_tensor(axis):
    """σ = n ζ [(p·E·p) pp + q ((E·p)⊥ p + p (E·p)⊥)/2], q = ζ_r/(ζ + ζ_r), ζ and ζ_r as in `theory`."""
    beads, length = 20, 0.05
    found, turned, density = damping(beads, length, 1, axes=np.array([axis]))
    p = np.array(axis) / np.linalg.norm(axis)
    strain = np.zeros((3, 3))
    strain[0, 2] = strain[2, 0] = 0.5
    stretched = strain @ p
    across = stretched - (p @ stretched) * p
    ratio = 4 / (beads**2 - 1)
    dipole = (p @ stretched) * np.outer(p, p)
    dipole += ratio / (1 + ratio) * (np.outer(across, p) + np.outer(p, across)) / 2
    zeta = 2 * np.pi * (length / (2 * beads)) ** 3 * beads * (beads**2 - 1)
    along_x, along_y, _ = density * zeta * dipole[:, 2]
    assert found == pytest.approx(along_x, rel=3e-3)
    assert turned == pytest.approx(along_y, rel=3e-3, abs=1e-6 * along_x)


def test_longer_rods_damp_less():
    """(kL)² corrections lower ν_f: a rod feels the mean strain along itself. Twice the length, four times that."""
    lost = []
    for length in (0.4, 0.8):
        found, _, density = damping(12, length, 2, integrator="ab3")
        lost.append(1 - found / theory(12, length, density)[1])
    assert lost[0] > 0
    assert lost[1] / lost[0] == pytest.approx(4, rel=0.15)


def two_way(step, end, integrator):
    """A flow and the places of beads after a time, with fibers that take a good part of its energy."""
    solver = SpectralSolver(
        8, 0.02, time_step=step, interpolation="exact"
    )  # smooth in space, and so along paths
    solver.set_velocity(noise(8))
    families = [Fibers.straight(20, 8, 1.2, k, 0.02, box=6.28, seed=2) for k in (1e-3, 1e-5)]
    options = {} if integrator == "ab3" else {"tolerance": 1e-8}
    group = Group([Stepper(f, 0.0, integrator, **options) for f in families])

    def observe():
        group.observe(group.time, *solver.sample(group.positions, solver.time, "rotation"))

    observe()
    for _ in range(round(end / step)):
        r = group.reaction(step)
        solver.set_point_forces(group.positions, r.force, r.torque)
        solver.advance(1)
        group.advance(step)
        observe()
        while group.provisional:
            group.correct()
            observe()
    return solver.velocity, group.positions.copy()


@pytest.mark.parametrize("integrator", ["ab3", "implicit"])
def test_the_order_in_time_is_two(integrator):
    """Two, of the first steps, which hold the forces, and of implicit fibers."""
    ends = [two_way(0.04 / 2**n, 0.32, integrator) for n in range(4)]
    for quantity in zip(*ends, strict=True):
        changes = [np.abs(b - a).max() for a, b in itertools.pairwise(quantity)]
        assert np.log2(changes[-2] / changes[-1]) > 1.85, changes


def test_the_push_of_points_is_no_blow_up():
    """From rest, turned round in every step and let go: energy that a force gave, not the scheme."""
    solver = SpectralSolver(8, 0.01, time_step=0.1)
    for n in range(6):
        solver.set_point_forces([[1.0, 2.0, 3.0]], [[5.0 * (-1) ** n, 0, 0]])
        solver.advance()
    solver.set_point_forces(None, None)
    solver.advance(3)
