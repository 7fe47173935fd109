"""Hard cases of the fiber model: stiffness, numbers of beads, steps, folds, flows, places, histories.

Fibers are d = 0.1 thick and L = 2 long (N = 20) in a fluid of μ = 0.01 where nothing else is said; flows have rates of
1/s, so that l_p = (K/μS)^(1/4). `off` is an error over the bound that a case allows itself.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager

import numpy as np
from numpy.typing import NDArray

from ...fiber import Fibers, Stepper, ab3, simulate
from ...flow import ABC, LinearFlow, TaylorGreen, from_array, from_function
from .case import Case, Found

MU, DIAMETER, BEADS = 0.01, 0.1, 20
SHEAR = LinearFlow([[0, 1, 0], [0, 0, 0], [0, 0, 0]])
REST = LinearFlow(np.zeros((3, 3)))
STIFF, SOFT = 1e-3, 1e-6
LOST = "ab3 loses fiber|changes too fast for a step"
NO_BINORMAL = "collinear links have no binormal, so that an exact fold feels no moment"


def chain(links: Sequence, diameter: float = DIAMETER) -> NDArray:
    """(F, N, 3) bead centres about the origin from link directions (F, N−1, 3)."""
    links = np.asarray(links, dtype=float)
    links = links / np.linalg.norm(links, axis=2, keepdims=True)
    beads = np.concatenate([np.zeros((len(links), 1, 3)), np.cumsum(diameter * links, axis=1)], axis=1)
    return beads - beads.mean(axis=1, keepdims=True)


def bent(count: int = 2, beads: int = BEADS, diameter: float = DIAMETER, bend: float = 0.3) -> NDArray:
    """Smoothly bent, out of plane."""
    random = np.random.default_rng(0)
    turns = bend * random.standard_normal((count, beads - 1, 3))
    return chain(np.cumsum(turns, axis=1) + random.standard_normal((count, 1, 3)), diameter)


def crooked(count: int = 2, beads: int = BEADS) -> NDArray:
    """Kinked random walks."""
    return chain(np.cumsum(np.random.default_rng(0).standard_normal((count, beads - 1, 3)), axis=1))


def straight(direction: Sequence[float] = (1, 0, 0), beads: int = BEADS) -> NDArray:
    return chain(np.broadcast_to(np.asarray(direction, float), (1, beads - 1, 3)))


def hairpin(angle: float = np.pi, beads: int = 11) -> NDArray:
    """Two straight halves."""
    half, turned = (beads - 1) // 2, (np.cos(angle), np.sin(angle), 0)
    return chain([[(1, 0, 0)] * half + [turned] * half])


def polygon(corners: int) -> NDArray:
    """A closed ring: its last bead lies on its first."""
    turn = 2 * np.pi * np.arange(corners) / corners
    return chain([np.stack([np.cos(turn), np.sin(turn), 0 * turn], axis=1)])


def zigzag(beads: int = 11) -> NDArray:
    """Folded at every joint."""
    return chain([[((-1.0) ** n, 0, 0) for n in range(beads - 1)]])


def moved(
    shapes: NDArray, stiffness: float, flow, step: float, steps: int = 10, law: str = "sine", **options
) -> Found:
    """What became of fibers of these shapes."""
    fibers = Fibers(shapes, stiffness, MU, curvature_law=law)
    path = simulate(fibers, flow, step, steps * step, **options)
    found = judged(fibers, path.positions[-1])
    return found | {"sub_steps": path.report["substeps"] / steps, "step_over_eq10": _over_limit(fibers, step)}


def judged(fibers: Fibers, last: NDArray) -> Found:
    """Length and energy at the end."""
    spacing = np.linalg.norm(np.diff(last, axis=1), axis=2)
    energy = fibers.bending_energy.max()
    found = {"beads": fibers.beads, "finite": bool(np.isfinite(last).all())}
    found["length_error"] = float(np.abs(spacing / (2 * fibers.radius) - 1).max())
    if energy > 0 and found["finite"]:
        links = np.diff(last, axis=1) / spacing[..., None]
        after = Fibers(
            chain(links), fibers.bending_stiffness, fibers.viscosity, curvature_law=fibers.curvature_law
        )
        found["energy"] = float(after.bending_energy.max() / energy)
    return found


def _over_limit(fibers: Fibers, step: float) -> float:
    return step * float(fibers.bending_stiffness.max()) / (fibers.viscosity * (2 * fibers.radius) ** 4)


def march(stepper: Stepper, flow, steps: Sequence[float]) -> Iterator[NDArray]:
    """Positions after each step of a coupled run: one sample of the flow a step."""

    def sample() -> None:
        stepper.observe(
            stepper.time, *flow.sample(stepper.positions, stepper.time, stepper.need)
        )  # as in a run

    sample()
    for step in steps:
        stepper.advance(step)
        while stepper.provisional:
            sample()
            stepper.correct()
        sample()
        yield stepper.positions


def relaxed(law: str, integrator: str, times: float) -> Found:
    """Crooked fibers at rest, in steps of so many times eq. (10): growth, of the energy within any step."""
    fibers = Fibers(crooked(), STIFF, MU, curvature_law=law)
    step = times * MU * DIAMETER**4 / STIFF
    stepper = Stepper(fibers, integrator=integrator)
    energies, found = [fibers.bending_energy], {}
    for beads in march(stepper, REST, [step] * 5):
        found = judged(fibers, beads)
        now = Fibers(chain(np.diff(beads, axis=1)), STIFF, MU, curvature_law=law)
        energies.append(now.bending_energy)
    growth = np.diff(energies, axis=0).max() / energies[0].max()
    return found | {
        "growth": float(growth),
        "sub_steps": stepper.report()["substeps"] / 5,
        "step_over_eq10": times,
    }


@contextmanager
def _no_limit():
    usual = ab3.stable_step
    ab3.stable_step = lambda *_: np.inf
    try:
        yield
    finally:
        ab3.stable_step = usual


def largest_explicit_step(mobility: str, law: str) -> Found:
    """By bisection: the longest sub-step, over eq. (10), in which ab3 lets a bent fiber relax. growth: whether eq. (10)
    is within it."""
    fibers = Fibers(bent(1, bend=0.1), STIFF, MU, curvature_law=law)
    unit = MU * DIAMETER**4 / STIFF

    def stable(times: float) -> bool:
        stepper = Stepper(fibers, integrator="ab3", mobility=mobility)
        try:
            *_, last = march(stepper, REST, [times * unit] * 150)
        except (ValueError, FloatingPointError):
            return False
        return judged(fibers, last)["energy"] < 1

    low, high = 0.5, 8.0
    with _no_limit():
        for _ in range(7):
            middle = 0.5 * (low + high)
            low, high = (middle, high) if stable(middle) else (low, middle)
    return {"largest_step_over_eq10": low, "off": 1 / low}


def ends_where(positions: NDArray, expected: NDArray, bound: float) -> Found:
    """off: distance from where they should be, over the bound on it, in fiber lengths."""
    length = DIAMETER * positions.shape[-2]
    return {"off": float(np.abs(positions - expected).max() / length / bound)}


def periodic(field=None) -> Callable:
    """An ABC flow on a grid, trilinear, in a box of 2π."""
    x = np.moveaxis(np.indices((16, 16, 16)), 0, -1) * 2 * np.pi / 16
    values = ABC(0.3, 0.4, 0.5).sample(x, 0, "velocity")[0]
    return from_array(np.moveaxis(values, -1, 0), 2 * np.pi, interpolation="trilinear")


def boxes_away(boxes: int) -> Found:
    """The same fibers so many boxes away move the same, but for rounding."""
    flow, fibers = periodic(), Fibers(bent(), 1e-4, MU)
    away = Fibers(bent() + 2 * np.pi * boxes, 1e-4, MU)
    here, there = (simulate(f, flow, 0.1, 2.0).positions[-1] for f in (fibers, away))
    return judged(fibers, there) | ends_where(there - 2 * np.pi * boxes, here, 1e-8 * boxes)


def across_each_step() -> Found:
    """A wind of one box a step, under which the fibers must move as without it: u(x) repeats itself."""
    flow, wind = periodic(), np.array([2 * np.pi / 0.05, 0, 0])

    class Windy:
        def sample(self, x, t, need):
            velocity, extra = flow.sample(x - wind * t, t, need)
            return velocity + wind, extra

    fibers, results = Fibers(bent(), 1e-4, MU), []
    for carrier in (flow, Windy()):
        *_, last = march(Stepper(fibers, integrator="implicit"), carrier, [0.05] * 20)
        results.append(last)
    return judged(fibers, results[1]) | ends_where(results[1] - wind, results[0], 1e-8)


def longer_than_the_box() -> Found:
    """Three boxes long, on the grid and in closed form, which differ by the grid's error."""
    shapes = bent(1, 200, 6 * np.pi / 200, 0.02)
    fibers = Fibers(shapes, 1e-2, MU)
    on_grid = simulate(fibers, periodic(), 0.1, 1.0).positions[-1]
    exact = simulate(fibers, ABC(0.3, 0.4, 0.5), 0.1, 1.0).positions[-1]
    return judged(fibers, on_grid) | {"off": float(np.abs(on_grid - exact).max() / (6 * np.pi) / 0.01)}


def coincident() -> Found:
    """Three fibers in one place stay in one place, to the last bit: they do not see each other."""
    fibers = Fibers(np.repeat(bent(1), 3, axis=0), 1e-4, MU)
    last = simulate(fibers, SHEAR, 0.1, 2.0, mobility="rpy").positions[-1]
    return judged(fibers, last) | {"off": 0.0 if (last == last[0]).all() else np.inf}


def jumping(factor: float, integrator: str) -> Found:
    """A shear that jumps within a step."""

    def gradient(x, t):
        g = np.zeros((*x.shape, 3))
        g[..., 0, 1] = factor if t > 0.35 else 1.0
        return g

    flow = from_function(lambda x, t: (gradient(x, t) @ x[..., None])[..., 0], gradient=gradient)
    return moved(bent(), 1e-4, flow, 0.1, integrator=integrator)


def changed_steps(integrator: str, steps: Sequence[float], restart: bool, flow=None) -> Found:
    """One coupled step after the other of other lengths; through a state where it is a restart. off: over 1 % of L."""
    flow = flow or ABC(0.3, 0.4, 0.5)
    fibers = Fibers(bent(), 1e-4, MU)
    stepper = Stepper(fibers, integrator=integrator)
    for length in steps:
        *_, last = march(stepper, flow, [length])
        if restart:
            again = Stepper(fibers, integrator=integrator)
            again.restore(stepper.state())
            stepper = again
    exact = simulate(fibers, flow, 0.01, sum(steps), tolerance=1e-5).positions[-1]
    return judged(fibers, last) | ends_where(last, exact, 1e-2)


def whirled(integrator: str, turn: float = 0.1, turns: float = 8) -> Found:
    """A short fiber on its way round a vortex in rigid rotation ω, in coupled steps of ωΔt = turn: it drifts inward
    at c ω (ωΔt)³, c = 3/8 for ab3, whose amplification of e^(iωt) is 1 − 3/8 (ωΔt)⁴, and 5/16 for the midpoint rule of
    implicit over a quadratic in time. off: deviation of c, over 10 %."""
    flow = LinearFlow([[0, -1, 0], [1, 0, 0], [0, 0, 0]])
    fibers = Fibers(chain([[(0, 0, 1)] * 5], 0.02) + np.array([1.0, 0, 0]), 1e-9, MU)
    count = round(2 * np.pi * turns / turn)
    *_, last = march(Stepper(fibers, integrator=integrator), flow, [turn] * count)
    constant = -np.log(np.linalg.norm(last.mean(axis=1)[0, :2])) / (count * turn**4)
    theory = {"ab3": 3 / 8, "implicit": 5 / 16}[integrator]
    return judged(fibers, last) | {
        "drift": float(constant),
        "off": float(abs(constant / theory - 1) / 0.1),
    }


def many_steps(steps: int, integrator: str = "ab3") -> Found:
    """Two fibers of six beads in a cellular flow."""
    fibers = Fibers(bent(2, 6), 1e-4, MU)
    *_, last = march(Stepper(fibers, integrator=integrator), TaylorGreen(np.pi, 1.0), [0.02] * steps)
    return judged(fibers, last)


def many_sub_steps(steps: int) -> Found:
    """A stiff fiber, straightened and turned by ab3, 1e5 sub-steps in each of its steps."""
    fibers = Fibers(bent(2, 6), MU * DIAMETER**4 * 1e6, MU)
    *_, last = march(Stepper(fibers, integrator="ab3"), SHEAR, [0.1] * steps)
    return judged(fibers, last) | {"sub_steps": 1e5}


def rotates_as_a_rod() -> Found:
    """l_p/L = 1000, straight, in shear. off: bending, in end-to-end distance, over 1e-6."""
    fibers = Fibers(straight((0, 1, 0)), MU * (1e3 * 2) ** 4, MU)
    last = simulate(fibers, SHEAR, 0.1, 1.0).positions[-1]
    end_to_end = float(np.linalg.norm(last[0, -1] - last[0, 0])) / (DIAMETER * (BEADS - 1))
    return judged(fibers, last) | {"off": abs(end_to_end - 1) / 1e-6}


def _stiffnesses() -> list[Case]:
    cases = []
    for ratio in (0, 1e-3, 1e-2, 0.1, 1, 30, 1e3):
        stiffness = MU * (2 * ratio) ** 4
        for name in ("auto", "implicit", "ab3"):
            if name == "ab3" and ratio > 0.1:
                continue
            cases.append(Case(
                "stiffness", f"l_p/L = {ratio:g}, bent, in shear, {name}",
                lambda k=stiffness, name=name: moved(bent(), k, SHEAR, 0.1, integrator=name),
            ))  # fmt: skip
    cases += [
        Case("stiffness", "K = 4e-16, rpy", lambda: moved(bent(), 4e-16, SHEAR, 0.1, mobility="rpy")),
        Case("stiffness", "l_p/L = 1000, straight, in shear: a rod", rotates_as_a_rod),
        Case(
            "stiffness", "l_p/L = 30 with ab3 in steps of 0.1",
            lambda: moved(bent(), MU * 60**4, SHEAR, 0.1, integrator="ab3"), "take the implicit integrator",
        ),
        Case(
            "stiffness", "K = 1e60, bent", lambda: moved(bent(), 1e60, SHEAR, 0.1),
            "too stiff for so bent a shape", "a fiber so stiff must start straight",
        ),
        Case("stiffness", "K = 1e300", lambda: moved(bent(), 1e300, SHEAR, 0.1), "cannot be computed with"),
    ]  # fmt: skip
    squeeze = LinearFlow(np.diag([-1.0, 1, 0]))
    for number in (1e2, 1e6, 1e10):
        for name in ("auto", "ab3"):
            cases.append(Case(
                "Sp", f"Sp = {number:.0e} in compression, {name}",
                lambda sp=number, name=name: moved(
                    bent(bend=0.1), MU * 16 / sp, squeeze, 0.1, 30, integrator=name
                ),
            ))  # fmt: skip
    return cases


def _beads() -> list[Case]:
    cases = []
    for n in (2, 3, 200, 500):
        for law in ("sine", "discreteRod"):
            cases.append(Case(
                "beads", f"N = {n}, {law}, auto",
                lambda n=n, law=law: moved(bent(1, n, 2 / n, 0.05), 1e-6, SHEAR, 0.1, 2, law, integrator="auto"),
            ))  # fmt: skip
    for n in (2, 3, 20):
        cases.append(
            Case("beads", f"N = {n}, rpy", lambda n=n: moved(bent(1, n), 1e-4, SHEAR, 0.1, 2, mobility="rpy"))
        )
    for n in (200, 500):
        cases.append(Case(
            "beads", f"N = {n}, rpy, ab3, one step", note="its cost grows as N³, its memory as N²",
            act=lambda n=n: moved(bent(1, n, 0.01, 0.02), 0, SHEAR, 0.01, 1, integrator="ab3", mobility="rpy"),
            slow=True,
        ))  # fmt: skip
    return cases


def _steps() -> list[Case]:
    cases = []
    for law in ("sine", "discreteRod"):
        for times in (1e-3, 1, 1e2, 1e4):
            for name in ("ab3", "implicit", "auto"):
                cases.append(Case(
                    "step", f"{times:g} × eq. (10), crooked, at rest, {law}, {name}",
                    lambda law=law, name=name, times=times: relaxed(law, name, times),
                    slow=name == "ab3" and times > 100,
                ))  # fmt: skip
    for mobility in ("freeDrain", "rpy"):
        cases.append(Case(
            "step", f"longest stable sub-step of ab3, {mobility}",
            lambda mobility=mobility: largest_explicit_step(mobility, "sine"), slow=mobility == "rpy",
        ))  # fmt: skip
    return cases


def _folds() -> list[Case]:
    shapes = {
        "hairpin folded to π": hairpin(),
        "hairpin folded to π − 1e-3": hairpin(np.pi - 1e-3),
        "folded at every joint": zigzag(),
        "closed ring of 20": polygon(20),
        "closed square": polygon(4),
    }
    cases = []
    for law in ("sine", "discreteRod"):
        for name, shape in shapes.items():
            exact = "π" in name[-1:] or "every" in name
            for mobility in ("freeDrain", "rpy"):
                note = NO_BINORMAL if exact else ""
                if "closed" in name and mobility == "rpy":
                    note = (
                        "beads in one place have one mobility and move as one; repulsion does not part them"
                    )
                elif law == "sine" and "hairpin" in name:
                    note = "beyond 90° the law weakens, and holds no fold open: discreteRod does"
                cases.append(Case(
                    "fold", f"{name}, in shear, {law}, {mobility}",
                    lambda s=shape, law=law, m=mobility: moved(s, 1e-4, SHEAR, 0.05, 10, law, mobility=m), note=note,
                ))  # fmt: skip
    for name in ("hairpin folded to π", "hairpin folded to π − 1e-3"):
        cases.append(Case(
            "fold", f"{name}, discreteRod, ab3",
            lambda s=shapes[name]: moved(s, 1e-4, REST, 0.01, 2, "discreteRod", integrator="ab3"),
            "take the implicit integrator", "its stiffness grows as 1/cos²(θ/2)",
        ))  # fmt: skip
    for strain in (False, True):
        cases.append(Case(
            "fold", f"hairpin of beads that coincide, repelled, rpy{' with strain' * strain}",
            lambda strain=strain: moved(
                hairpin(), 1e-4, SHEAR, 0.05, 10, mobility="rpy", strain_coupling=strain, repulsion=5.0
            ),
        ))  # fmt: skip
    return cases


def _flows() -> list[Case]:
    still = "an equilibrium, if an unstable one: a bend of rounding would have to grow"
    compression = LinearFlow(np.diag([-1.0, 1, 0]))
    cases = []
    for direction, name in (((1, 0, 0), "stretched"), ((0, 1, 0), "compressed")):
        cases.append(Case(
            "flow", f"on the stagnation point of Taylor–Green, {name}",
            lambda d=direction: moved(straight(d), SOFT, TaylorGreen(np.pi, 1.0), 0.05, 100), note=still,
        ))  # fmt: skip
    for tilt in (0, 1e-12):
        cases.append(Case(
            "flow", f"along compression, tilted by {tilt:g}",
            lambda tilt=tilt: moved(straight((1, tilt, 0)), SOFT, compression, 0.05, 100),
            note=still if not tilt else "buckles",
        ))  # fmt: skip
    strong = LinearFlow([[0, 1e3, 0], [0, 0, 0], [0, 0, 0]])
    cases += [
        Case("flow", "shear of 1000 a step, auto",
             lambda: moved(bent(), 1e-4, strong, 1.0, 1, integrator="auto"), slow=True),
        Case("flow", "shear of 100 a step, auto",
             lambda: moved(bent(), 1e-4, strong, 0.1, 1, integrator="auto")),
        Case("flow", "shear of 1000 a step, ab3",
             lambda: moved(bent(), 1e-4, strong, 1.0, 1, integrator="ab3"), LOST),
        Case("flow", "stretched by e^300",
             lambda: moved(bent() + np.array([1.0, 0, 0]), 1e-4, LinearFlow(np.diag([100.0, -50, -50])), 1.0, 3),
             "from the origin", "double precision resolves beads up to 4e9 diameters away"),
        Case("flow", "velocities of 1e300", lambda: moved(bent(), 1e-4, LinearFlow(1e300 * SHEAR.gradient), 0.1, 1),
             "jumps|no finite|too fast|needs steps"),
    ]  # fmt: skip
    for factor in (2.0, 100.0, -1.0):
        cases += [
            Case("jump", f"the flow jumps by a factor {factor:g}, {name}",
                 lambda f=factor, n=name: jumping(f, n), LOST if refused else None)
            for name, refused in (("auto", False), ("implicit", False), ("ab3", factor == 100))
        ]  # fmt: skip
    return cases


def _places() -> list[Case]:
    return [
        Case("place", "1000 boxes away", lambda: boxes_away(1000)),
        Case("place", "across the periodic boundary in every step", across_each_step),
        Case("place", "three boxes long, N = 200", longer_than_the_box),
        Case("place", "three fibers in one place, rpy", coincident),
    ]


def _histories() -> list[Case]:
    varied = [0.05] * 4 + [0.005, 0.05, 0.0005, 0.05, 0.1, 0.01] * 2
    restarted = [5e-5] * 4 + [0.05] * 10
    cases = []
    for name in ("ab3", "implicit", "auto"):
        cases += [
            Case("Δt", f"changed between any two steps, {name}", lambda n=name: changed_steps(n, varied, False)),
            Case("Δt", f"1000 times longer after a restart, {name}",
                 lambda n=name: changed_steps(n, restarted, True)),
            Case("Δt", f"1000 times longer after a restart, trilinear flow, {name}",
                 lambda n=name: changed_steps(n, restarted, True, periodic())),
        ]  # fmt: skip
    cases += [
        Case("long", f"8 turns of a captured fiber, {name}: its drift inward", lambda n=name: whirled(n),
             note=f"c ω(ωΔt)³ of a coupled run, c = {c}")
        for name, c in (("ab3", "3/8"), ("implicit", "5/16"))
    ]  # fmt: skip
    return [
        *cases,
        Case("long", "10⁶ steps", lambda: many_steps(1_000_000), slow=True),
        Case("long", "10⁶ sub-steps", lambda: many_sub_steps(10), slow=True),
    ]


CASES = [*_stiffnesses(), *_beads(), *_steps(), *_folds(), *_flows(), *_places(), *_histories()]
