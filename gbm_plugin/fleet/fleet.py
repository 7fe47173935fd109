"""All families of a scene as one: flat bead arrays outside, one stepper for each family inside."""

from __future__ import annotations

import io
import json
import logging
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from ..arrays import check_arrays, read_arrays
from ..case.feedback import cell_size, removes_own
from ..case.layout import STATE_FILE, fiber_state
from ..case.scene import Family, Scene
from ..case.share import WHOLE, Share, all_shares
from ..case.solver import face_values
from ..errors import CaseError, PredictionError, StateError
from ..fiber import Fibers, Group, Reaction, Stepper, merged_states, prepare
from ..fiber.state import check_state, forms
from ..files import replaced
from ..sampling import gradient_of
from ..statistics.fibers import end_to_end_squared_ratio
from .own import CENTRAL2, CENTRAL6, SHELLS, Mesh, OwnDisturbance, kernels
from .own import prepare as prepare_own

log = logging.getLogger(__name__)

# prediction gap over the rms velocity at the beads: worth a word, and too much to go on with; and how far it may have
# carried a bead in a step, over its width
GAP_WARNING, GAP_LIMIT = 0.1, 1.0
CARRIED_WARNING, CARRIED_LIMIT = 0.01, 0.05
REPULSION_STRONG = 0.3  # rate times step: it then adds to the gap what its overlaps are

HEADER = {
    "signature": ("U", ()),
    "step": ("i", ()),
    "time": ("f", ()),
}  # of a state file, beside the families
OWN = "own_disturbance"  # of a family, in a state file
MOST_NUMBERS = 96  # of an array for each bead: its own disturbance has up to 78
SMALL = 1 << 16  # arrays of so many bytes are read, whatever they are


def prepare_kernels(families: Sequence[Family], feedback: bool = False) -> None:
    """All that these families will call is compiled when this returns: in a step somebody waits."""
    for options in {tuple(f.model.motion.items()) for f in families}:
        prepare(feedback, **dict(options))
    if feedback:
        prepare_own()


class Fleet(Group):
    """The fibers of a scene on their way through time, one family after the other."""

    def __init__(self, families: Sequence[Family], steppers: Sequence[Stepper], share: Share = WHOLE):
        super().__init__(steppers, [family.name for family in families])
        self.families = tuple(families)
        self.share = share
        self._step_length = 0.0
        self._own: dict[str, OwnDisturbance] = {}  # by family, of those whose beads must not feel it
        self._reaction: Reaction | None = None

    @classmethod
    def seeded(
        cls, scene: Scene, box_min, box_max, time: float, share: Share = WHOLE, cut: float | None = None
    ) -> Fleet:
        """New fibers, at random places and orientations in the box unless the case gives their positions.

        share: whose part of the families the scene has; their fibers are those that they are in the whole. cut: largest
        wavenumber that a spectral flow resolves, over π/Δx; None: the flow is the case's solver.
        """
        size = np.subtract(box_max, box_min)
        steppers = []
        for f in scene.families:
            made_of = (f.bending_stiffness, scene.dynamic_viscosity)
            positions = f.positions
            if positions is None:
                straight = Fibers.straight(f.total, f.beads, f.length, *made_of, box=size, seed=f.seed)
                positions = straight.positions + box_min
            try:
                fibers = Fibers(positions, *made_of, **f.model.material).part(
                    slice(f.first, f.first + f.count)
                )
            except ValueError as error:
                raise CaseError(f"family {f.name} in constant/fiberProperties: {error}") from None
            steppers.append(Stepper(fibers, time, **f.model.motion))
        fleet = cls(scene.families, steppers, share)
        for f in scene.families:
            if removes_own(scene, f):
                own = kernels(_mesh(scene, size, cut), scene.kinematic_viscosity, scene.density)
                drag = 6 * np.pi * scene.dynamic_viscosity * f.radius
                beads = f.count * f.beads
                fleet._own[f.name] = OwnDisturbance(own, scene.kinematic_viscosity, drag, beads)
        return fleet

    @property
    def sizes(self) -> list[tuple[int, int, int]]:
        """Fibers, beads of each, and number of the first fiber, of each family."""
        return [(f.count, f.beads, f.first) for f in self.families]

    def observe(self, time: float, velocity: np.ndarray, extra: np.ndarray | None) -> None:
        """As that of Group, without what beads find of themselves where that is removed."""
        if self._own:
            own = self.own_motion
            velocity = velocity - own[:, 0]
            if extra is not None:
                extra = extra - (own[:, 1] if extra.ndim == 2 else gradient_of(own[:, 1]))
        super().observe(time, velocity, extra)

    @property
    def own_motion(self) -> np.ndarray:
        """(B, 2, 3) velocity and rotation that beads find of themselves in the flow, where these are removed; 0
        elsewhere [m/s, 1/s]."""
        motion = np.zeros((self.beads, 2, 3))
        for family, part in zip(self.families, self.split(motion.reshape(-1, 6)), strict=True):
            if own := self._own.get(family.name):
                part.reshape(-1, 2, 3)[:] = own.motion
        return motion

    def reaction(self, time_step: float) -> Reaction:
        self._reaction = super().reaction(time_step)
        return self._reaction

    def advance(self, time_step: float) -> None:
        self._step_length = time_step
        if self._own:
            loads = (self.split(self._reaction.force), self.split(self._reaction.torque))
            for family, force, torque in zip(self.families, *loads, strict=True):
                if own := self._own.get(family.name):
                    own.advance(force.reshape(-1, 3), torque.reshape(-1, 3), time_step)
        super().advance(time_step)

    @property
    def prediction_gap(self) -> float:
        """Largest rms over a fiber of |predicted - received| ambient velocity [m/s]."""
        return float(max(np.max(s.prediction_gap, initial=0.0) for s in self.steppers))

    def check_prediction(self, velocity: np.ndarray, step: int) -> tuple[float, float]:
        """The prediction gap [m/s], and where it matters its ratio to the rms of the sampled velocity (B, 3), else 0:
        an error that no estimate inside the fibers sees. PredictionError where it is of the flow's order.

        It matters where beads are carried wrong by a part of their width: a flow at rest, or one that has just begun
        to move, is foreseen badly and harmlessly.
        """
        rms = float(np.sqrt(3 * np.mean(velocity**2)))
        gap = self.prediction_gap
        if self.carried_wrong <= CARRIED_WARNING or gap <= GAP_WARNING * rms:
            return gap, 0.0
        if gap > GAP_LIMIT * rms and self.carried_wrong > CARRIED_LIMIT:
            raise PredictionError(
                f"step {step}: the flow at a fiber was predicted with an error of {gap:g} m/s, more than its rms "
                f"of {rms:g} m/s: the time step is too long for {self._what_moves()}"
            )
        return gap, gap / rms if rms > 0 else np.inf

    @property
    def carried_wrong(self) -> float:
        """How far the prediction gap may have carried a bead in the last step, over its width."""
        pairs = zip(self.families, self.steppers, strict=True)
        return self._step_length * float(
            max(np.max(s.prediction_gap, initial=0.0) / (2 * f.radius) for f, s in pairs)
        )

    def _what_moves(self) -> str:
        """What a step must resolve."""
        strong = [f for f in self.families if f.model.repulsion * self._step_length > REPULSION_STRONG]
        if not strong:
            return "this flow"
        return ", ".join(f"the repulsion {f.model.repulsion:g} of family {f.name}" for f in strong) + (
            f" (times deltaT {self._step_length:g} it must stay well below 1), or for this flow"
        )

    def end_to_end_ratio(self) -> list[float]:
        """<R^2>/L^2 of each family, L = 2a(N - 1) between the end beads' centres."""
        pairs = zip(self.families, self.by_family, strict=True)
        return [float(end_to_end_squared_ratio(x, family.radius).mean()) for family, x in pairs]

    def _signature(self) -> str:
        return json.dumps([[f.name, f.total, f.beads, f.length] for f in self.families])

    def save(self, folder: Path, step: int, time: float) -> None:
        """Write the whole state into a time folder; the file appears only when it is complete. OSError names it."""
        arrays = {
            f"{family.name}/{key}": value
            for family, stepper in zip(self.families, self.steppers, strict=True)
            for key, value in stepper.state().items()
        }
        for family in self.families:
            if own := self._own.get(family.name):
                arrays[f"{family.name}/{OWN}"] = own.state().reshape(family.count, family.beads, -1, 6)
        buffer = io.BytesIO()
        np.savez(buffer, signature=self._signature(), step=step, time=time, **arrays)
        path = folder / STATE_FILE
        path = path.with_name(self.share.name(path.stem, path.suffix))
        path.parent.mkdir(parents=True, exist_ok=True)
        with replaced(path, "wb", durable=True) as file:
            file.write(buffer.getbuffer())

    def restore(self, folder: Path) -> None:
        """Continue from the state in a time folder, whatever daemons shared it. StateError where it is of other
        fibers or unreadable."""
        self._positions = None
        paths = fiber_state(folder)
        if not paths:
            raise StateError(f"{folder} holds no complete fiber state")
        shares = all_shares(len(paths))
        states = [self._read_state(path, share) for path, share in zip(paths, shares, strict=True)]
        for family, stepper in zip(self.families, self.steppers, strict=True):
            end = family.first + family.count
            parts = [share.part(family.total) for share in shares]
            # only the files that hold some of these fibers: a part of a family has its own sub-steps
            held = [n for n, part in enumerate(parts) if part.start < end and family.first < part.stop]
            own = [_of_family(states[n], family.name) for n in held]
            offset = parts[held[0]].start
            try:
                part = slice(family.first - offset, end - offset)
                stepper.restore(merged_states(own, part))
                disturbance = self._own.get(family.name)
                if disturbance and not any(OWN in o for o in own):
                    log.info(
                        "family %s: its own disturbance begins here, where feedback or its removal does",
                        family.name,
                    )
                elif disturbance:
                    disturbance.restore(
                        np.concatenate([o[OWN] for o in own])[part].reshape(-1, *own[0][OWN].shape[2:])
                    )
            except (KeyError, ValueError) as error:
                raise StateError(f"the fiber state {paths[held[0]]} cannot be read: {error}") from None

    def _read_state(self, path: Path, share: Share) -> dict[str, np.ndarray]:
        """The arrays of the file of a daemon, checked."""
        try:
            keys = [*forms(1, 2), OWN]
            names = [*HEADER, *(f"{family.name}/{key}" for family in self.families for key in keys)]
            state = read_arrays(path, names, 8 * MOST_NUMBERS * self._largest + SMALL)
            check_arrays(state, HEADER)
            signature = str(state["signature"])
        except ValueError as error:
            raise StateError(f"the fiber state {path} cannot be read: {error}") from None
        if signature != self._signature():
            raise StateError(
                f"{path} holds the families {signature} (name, count, beads, length), "
                f"constant/fiberProperties says {self._signature()}: "
                "restore the dictionary, or start afresh"
            )
        for family in self.families:
            part = share.part(family.total)
            try:
                own = _of_family(state, family.name)
                check_state(own, part.stop - part.start, family.beads)
                if OWN in own and family.name in self._own:
                    form = ("f", (part.stop - part.start, family.beads, range(SHELLS, SHELLS + 4), 6))
                    check_arrays(own, {OWN: form})
            except ValueError as error:
                raise StateError(
                    f"the fiber state {path} cannot be read: family {family.name}: {error}"
                ) from None
        return state

    @property
    def _largest(self) -> int:
        """Beads of the largest family."""
        return max(family.total * family.beads for family in self.families)


def _mesh(scene: Scene, size, cut: float | None) -> Mesh:
    """How the flow sees a bead: a spectral one up to `cut`, or the case's solver."""
    cell, box = cell_size(scene), float(np.prod(size)) ** (1 / 3)
    if cut is not None:
        return Mesh(scene.interpolation, cell, box, cut)
    if scene.application == "boxFoam":  # without the fastest mode of an even number of cells
        return Mesh(scene.interpolation, cell, box, 1 - cell / box, CENTRAL6)
    return Mesh(scene.interpolation, cell, box, 1.0, CENTRAL2, face_values(scene.case))


def _of_family(state: dict[str, np.ndarray], name: str) -> dict[str, np.ndarray]:
    prefix = f"{name}/"
    return {key.removeprefix(prefix): value for key, value in state.items() if key.startswith(prefix)}
