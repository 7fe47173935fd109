"""Writing fibers to HDF5 while a run goes on. The layout of the file is described in docs/files.md."""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import h5py
import numpy as np
from numpy.typing import ArrayLike

from ..files import created
from .transaction import FileFullError, Transaction

SCHEMA_VERSION = 1
_CHUNK_BYTES = (16 * 1024, 4 * 1024 * 1024)  # small records share a chunk, huge ones are divided
_FORMAT = ("v110", "v110")  # HDF5 1.10: its index of appended chunks never has to be rebalanced


@dataclass(frozen=True)
class FamilyRecord:
    """One family of equal fibers: what a reader needs to know about it.

    radius is the bead radius a [m]; bending_stiffness K^b [N m²], one number or one per fiber; model holds
    the words of the fiber model (mobility, integrator, curvatureLaw, ...).
    """

    name: str
    count: int
    beads: int
    radius: float
    bending_stiffness: ArrayLike
    seed: int | None = None
    model: Mapping[str, str] = field(default_factory=dict)

    def __post_init__(self) -> None:
        where = f"family {self.name!r}"
        if not self.name or "/" in self.name or self.name == ".":
            raise ValueError(f"{where}: the name must be one word without a slash")
        if self.count < 1 or self.beads < 2:
            raise ValueError(
                f"{where}: count {self.count}, beads {self.beads}; allowed are count >= 1, beads >= 2"
            )
        if not (np.isfinite(self.radius) and self.radius > 0):
            raise ValueError(f"{where}: radius is {self.radius}; allowed is a finite number > 0")
        stiffness = np.asarray(self.bending_stiffness, dtype=float)
        allowed = np.isfinite(stiffness) & (stiffness >= 0)
        if stiffness.shape not in ((), (self.count,)) or not allowed.all():
            raise ValueError(
                f"{where}: bending_stiffness must be one number >= 0 or {self.count} of them, "
                f"not an array of shape {stiffness.shape} with minimum {stiffness.min(initial=np.inf):g}"
            )

    @property
    def shape(self) -> tuple[int, int, int]:
        """Shape of one record, (F, N, 3)."""
        return self.count, self.beads, 3

    @property
    def links_shape(self) -> tuple[int, int]:
        """Shape of one record of a value of each link, (F, N−1)."""
        return self.count, self.beads - 1


class Recorder:
    """Appends the positions of fiber families, and where asked for the tension of links, to a new HDF5 file.

    Every append is one transaction: whenever the process dies, and when the disk fills, all earlier records
    stay readable. No handle on the file is kept between appends, so others may read it at any time.

    box_origin, box_size: (3,) [m]; dynamic_viscosity [Pa s]; density [kg/m³]; dictionaries: text of the
    case's dictionaries by file name; tension: whether each record has it. Raises FileExistsError if the file
    exists, FileFullError (an OSError) if there is no room for it, ValueError for values that are not allowed.
    """

    def __init__(
        self,
        path: Path | str,
        families: Sequence[FamilyRecord],
        *,
        box_origin: ArrayLike,
        box_size: ArrayLike,
        dynamic_viscosity: float,
        density: float,
        dictionaries: Mapping[str, str],
        program_version: str,
        tension: bool = False,
    ) -> None:
        self.path = Path(path)
        self.families = tuple(families)
        self.tension = tension
        names = [family.name for family in self.families]
        if not names or len(set(names)) != len(names):
            raise ValueError(f"{self.path}: families are {names}; at least one and no name twice is allowed")
        scene = {
            "box_origin": (np.asarray(box_origin, dtype=float), "m"),
            "box_size": (np.asarray(box_size, dtype=float), "m"),
            "viscosity": (np.float64(dynamic_viscosity), "Pa s"),
            "density": (np.float64(density), "kg/m^3"),
        }
        for name, (value, _) in scene.items():
            shape = (3,) if name.startswith("box") else ()
            positive = name == "box_origin" or np.all(value > 0)
            if value.shape != shape or not np.all(np.isfinite(value)) or not positive:
                raise ValueError(
                    f"{self.path}: {name} is {value}; allowed are finite values, shape {shape}, > 0"
                )
        self._last: tuple[int, float] | None = None
        self._closed = False
        self._create(scene, dictionaries, program_version)

    def _create(self, scene: dict, dictionaries: Mapping[str, str], program_version: str) -> None:
        if self.path.exists():
            raise FileExistsError(f"{self.path} exists and is not overwritten; move it away or delete it")
        self.path.parent.mkdir(parents=True, exist_ok=True)
        draft = self.path.with_name(f".{self.path.name}.{os.getpid()}")  # the file appears complete
        try:
            created(draft, "wb").close()
            with Transaction(draft, writable=True) as changes:
                with h5py.File(changes, "w", libver=_FORMAT) as file:
                    self._write_header(file, scene, dictionaries, program_version)
                changes.publish()
            draft.replace(self.path)
        except FileFullError as error:
            raise FileFullError(error.errno, f"{self.path} not created: {error.strerror}") from None
        finally:
            draft.unlink(missing_ok=True)

    def _write_header(self, file, scene: dict, dictionaries: Mapping[str, str], program_version: str) -> None:
        file.attrs["schema_version"] = SCHEMA_VERSION
        file.attrs["program"] = "gbm_plugin"
        file.attrs["program_version"] = program_version
        for name, (value, unit) in scene.items():
            file.create_dataset(name, data=value).attrs["units"] = unit
        for name, text in dictionaries.items():
            file.create_dataset(f"dictionaries/{name}", data=text)
        _growing(file, "step", (), np.int64, "1")
        _growing(file, "time", (), np.float64, "s")
        for number, family in enumerate(self.families):
            group = file.create_group(f"families/{family.name}")
            group.attrs["number"] = number
            group.attrs["seed"] = h5py.Empty("i8") if family.seed is None else family.seed
            group.create_group("model").attrs.update(family.model)
            stiffness = np.asarray(family.bending_stiffness, dtype=float)
            group.create_dataset("bending_stiffness", data=stiffness).attrs["units"] = "N m^2"
            group.create_dataset("radius", data=float(family.radius)).attrs["units"] = "m"
            _growing(group, "positions", family.shape, np.float64, "m")
            if self.tension:
                _growing(group, "tension", family.links_shape, np.float64, "N")

    def append(
        self,
        step: int,
        time: float,
        positions: Sequence[ArrayLike],
        tension: Sequence[ArrayLike] | None = None,
    ) -> None:
        """Add one record: positions[i] (F, N, 3) [m] of family i, unwrapped, at `time` [s], flow step `step`;
        tension[i] (F, N−1) [N] of its links, in a file that has it.

        Raises ValueError for another shape or a time or step that does not advance, FloatingPointError for a
        value that is not finite, FileFullError (an OSError) if there is no room; the file then holds all
        earlier records and the call may be repeated.
        """
        if self._closed:
            raise ValueError(f"{self.path}: the recorder is closed")
        step, time = int(step), float(time)
        self._check_place(step, time)
        if (tension is not None) != self.tension:
            raise ValueError(
                f"{self.path}: tension goes with every record of a file made with it, and with no other"
            )
        values = {
            "positions": self._checked(step, time, "positions", positions, [f.shape for f in self.families])
        }
        if tension is not None:
            values["tension"] = self._checked(
                step, time, "tension", tension, [f.links_shape for f in self.families]
            )
        try:
            with Transaction(self.path, writable=True) as changes:
                with h5py.File(changes, "r+", libver=_FORMAT) as file:
                    rows = file["time"].shape[0]
                    for name, arrays in values.items():
                        for family, array in zip(self.families, arrays, strict=True):
                            _append(file[f"families/{family.name}/{name}"], rows, array)
                    _append(file["step"], rows, step)
                    _append(file["time"], rows, time)
                changes.publish()
        except FileFullError as error:
            kept = "no record" if self._last is None else f"all records up to step {self._last[0]}"
            raise FileFullError(
                error.errno,
                f"{self.path}: step {step}, time {time:g} s, not recorded: {error.strerror}; {kept} kept",
            ) from None
        self._last = step, time

    def _check_place(self, step: int, time: float) -> None:
        where = f"step {step}, time {time:g} s"
        if not np.isfinite(time):
            raise FloatingPointError(f"{where}: the time is not finite")
        if self._last is not None and (step <= self._last[0] or time <= self._last[1]):
            raise ValueError(f"{where} does not come after step {self._last[0]}, time {self._last[1]:g} s")

    def _checked(
        self, step: int, time: float, name: str, values: Sequence[ArrayLike], shapes
    ) -> list[np.ndarray]:
        where = f"step {step}, time {time:g} s"
        if len(values) != len(self.families):
            raise ValueError(f"{where}: {len(values)} arrays of {name} for {len(self.families)} families")
        arrays = [np.asarray(array, dtype=float) for array in values]
        for family, array, shape in zip(self.families, arrays, shapes, strict=True):
            if array.shape != shape:
                raise ValueError(
                    f"{where}: {name} of family {family.name!r}: shape {array.shape}, not {shape}"
                )
            broken = ~np.isfinite(array.reshape(len(array), -1)).all(axis=1)
            if broken.any():
                raise FloatingPointError(
                    f"{where}: {name} of fiber {int(broken.argmax())} of family {family.name!r}: not finite"
                )
        return arrays

    def close(self) -> None:
        """End the recording; everything is in the file already."""
        self._closed = True

    def __enter__(self) -> Recorder:
        return self

    def __exit__(self, *_) -> None:
        self.close()


def _growing(group, name: str, shape: tuple[int, ...], dtype: type, unit: str) -> None:
    """An empty dataset (0, *shape) that grows along its first axis."""
    smallest, largest = _CHUNK_BYTES
    size = 8 * int(np.prod(shape))
    if size > largest:  # divide along the fibers, evenly
        pieces = -(-size // largest)
        chunk = (1, -(-shape[0] // pieces), *shape[1:])
    else:
        chunk = (max(smallest // size, 1), *shape)
    dataset = group.create_dataset(name, (0, *shape), dtype, chunks=chunk, maxshape=(None, *shape))
    dataset.attrs["units"] = unit


def _append(dataset, row: int, value) -> None:
    dataset.resize(row + 1, axis=0)
    dataset[row] = value
