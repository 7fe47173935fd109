"""Fiber recordings: written by Recorder, read by open_recording."""

from __future__ import annotations

import re
import time
from collections.abc import Iterable
from dataclasses import dataclass, replace
from pathlib import Path

import h5py
import numpy as np
from numpy.typing import NDArray

from ..case.layout import numbered
from ..case.share import all_shares, shared_files
from .recorder import SCHEMA_VERSION, FamilyRecord, Recorder
from .restarts import kept
from .transaction import Transaction

ATTEMPTS, PAUSE = 4, 0.02  # to open a file that a run is adding to [s]
SMALL, DENSITY = 64 << 20, 100  # a dataset may have so many bytes, or so many times those of its file

__all__ = ["FamilyRecord", "RecordedFamily", "Recorder", "Recording", "Records", "open_recording"]


class Records:
    """Values (S, ...) of one family at all times, read from the files when indexed: by slices and whole numbers,
    times also by an array of them or of truth values."""

    def __init__(self, parts: list[tuple[h5py.Dataset, int]]) -> None:
        """parts: datasets in the order of time, and how many of the first records of each count."""
        self._parts = parts
        self._starts = np.cumsum([0] + [count for _, count in parts])
        self.shape = (int(self._starts[-1]), *parts[0][0].shape[1:])
        self.dtype = np.dtype(np.float64)
        self.ndim = len(self.shape)

    def __len__(self) -> int:
        return self.shape[0]

    def __getitem__(self, key) -> NDArray[np.float64]:
        key = key if isinstance(key, tuple) else (key,)
        if any(k is Ellipsis for k in key):
            at = next(i for i, k in enumerate(key) if k is Ellipsis)
            key = key[:at] + (slice(None),) * (self.ndim - len(key) + 1) + key[at + 1 :]
        rows, rest = np.arange(len(self))[key[0]] if key else np.arange(len(self)), key[1:]
        if np.ndim(rows) == 0:
            part = int(np.searchsorted(self._starts, rows, side="right")) - 1
            return _finite(self._parts[part][0][(int(rows - self._starts[part]), *rest)])
        runs = np.split(rows, np.flatnonzero(np.diff(rows) != 1) + 1) if len(rows) else []
        pieces = [
            dataset[(slice(max(run[0] - start, 0), min(run[-1] + 1 - start, count)), *rest)]
            for run in runs
            for (dataset, count), start in zip(self._parts, self._starts[:-1], strict=True)
            if run[0] < start + count and run[-1] >= start
        ]
        empty = np.empty((0, *np.empty((1, *self.shape[1:]))[(slice(None), *rest)].shape[1:]))
        return _finite(np.concatenate(pieces)) if pieces else empty

    def __array__(self, dtype=None, copy=None) -> NDArray[np.float64]:
        return np.asarray(self[:], dtype=dtype)


def _finite(values: NDArray) -> NDArray:
    """The recorder writes no others."""
    if not np.isfinite(values).all():
        raise ValueError("a recording holds values that are not finite: it was damaged")
    return values


@dataclass(frozen=True)
class RecordedFamily(FamilyRecord):
    """A recorded family: its FamilyRecord, its positions (S, F, N, 3) [m], and the tension (S, F, N−1) [N] of its
    links, None where a part of the run was recorded without."""

    positions: Records = None
    tension: Records | None = None


class Recording:
    """One run's fibers, read from one file or from the parts that its restarts wrote.

    times (S,) [s]; steps (S,); families by name; box_origin, box_size (3,) [m]; metadata: schema_version,
    program, program_version, dynamic_viscosity [Pa s], density [kg/m³], dictionaries (text by file name), of the last
    part; starts: first time and dictionaries of each part.
    Usable as a context manager; positions are read from the open files.
    """

    def __init__(self, parts: list[_Part]) -> None:
        self._parts = parts
        last = parts[-1]
        counts = kept([part.times for part in parts])
        self.paths = [path for part in parts for path in part.paths]
        self.times = np.concatenate([part.times[:count] for part, count in zip(parts, counts, strict=True)])
        self.steps = np.concatenate([part.steps[:count] for part, count in zip(parts, counts, strict=True)])
        self.box_origin = last.files[0].box_origin
        self.box_size = last.files[0].box_size
        self.metadata = last.files[0].metadata
        self.starts = [
            (part.times[0], part.files[0].metadata["dictionaries"]) for part in parts if len(part.times)
        ]
        self.families = {
            name: RecordedFamily(
                **vars(record),
                positions=_records(parts, counts, name, "positions"),
                tension=_records(parts, counts, name, "tension") if all(p.tension for p in parts) else None,
            )
            for name, record in last.families.items()
        }

    def close(self) -> None:
        for part in self._parts:
            part.close()

    def __enter__(self) -> Recording:
        return self

    def __exit__(self, *_) -> None:
        self.close()


def _records(parts: list[_Part], counts: list[int], name: str, kind: str) -> Records:
    return Records([(part.records(name, kind), count) for part, count in zip(parts, counts, strict=True)])


class _Part:
    """What one run wrote from its start on: a file, or one of each daemon that shared the fibers."""

    def __init__(self, paths: list[Path]) -> None:
        self.paths = paths
        self.files: list[_File] = []
        try:
            for path in paths:
                self.files.append(_File(path))
        except BaseException:
            self.close()
            raise
        first = self.files[0]
        complete = min(len(file.times) for file in self.files)  # a kill leaves some with one record more
        self.times, self.steps = first.times[:complete], first.steps[:complete]
        self.families = first.families
        self.tension = all(file.tension for file in self.files)
        for file in self.files[1:]:
            if not np.array_equal(file.steps[:complete], self.steps) or list(file.families) != list(
                self.families
            ):
                self.close()
                raise ValueError(
                    f"{file.path} and {first.path} are not of one run: their steps or families differ"
                )
        if len(self.files) > 1:
            self.families = {name: self._joined(name) for name in self.families}

    def _joined(self, name: str) -> FamilyRecord:
        records = [file.families[name] for file in self.files]
        stiffness = records[0].bending_stiffness
        if np.ndim(stiffness):
            stiffness = np.concatenate([record.bending_stiffness for record in records])
        return replace(records[0], count=sum(record.count for record in records), bending_stiffness=stiffness)

    def records(self, name: str, kind: str) -> h5py.Dataset | _Joined:
        datasets = [file.file[f"families/{name}/{kind}"] for file in self.files]
        return datasets[0] if len(datasets) == 1 else _Joined(datasets)

    def close(self) -> None:
        for file in self.files:
            file.close()


class _Joined:
    """Datasets (S, F, ...) of several files as one, their fibers one after the other."""

    def __init__(self, datasets: list[h5py.Dataset]) -> None:
        self._datasets = datasets
        shapes = [dataset.shape for dataset in datasets]
        self.shape = (min(s[0] for s in shapes), sum(s[1] for s in shapes), *shapes[0][2:])

    def __getitem__(self, key: tuple) -> NDArray[np.float64]:
        times, *rest = key
        whole = isinstance(times, slice)
        values = np.concatenate([dataset[times] for dataset in self._datasets], axis=1 if whole else 0)
        return values[(slice(None), *rest) if whole else tuple(rest)]


class _File:
    """One open file, whose layout was checked (docs/files.md)."""

    def __init__(self, path: Path) -> None:
        self.path = path
        for attempt in range(1, ATTEMPTS + 1):
            self._changes = Transaction(path, writable=False)
            self.file: h5py.File | None = None
            try:
                # a file that was left in the middle of a change is read through its journal
                self.file = h5py.File(self._changes if self._changes.recovered else path, "r")
                self._read()
                return
            except UnknownVersion:
                self.close()
                raise
            except (OSError, RuntimeError, KeyError, ValueError, TypeError, AttributeError) as error:
                self.close()  # perhaps a run has changed it while it was opened
                if attempt == ATTEMPTS:
                    raise ValueError(f"{path} is not a fiber recording: {error}") from None
                time.sleep(PAUSE)

    def _read(self) -> None:
        version = self.file.attrs.get("schema_version")
        if version != SCHEMA_VERSION:
            raise UnknownVersion(
                f"{self.path} has schema_version {version}; this program reads {SCHEMA_VERSION}"
            )
        most = max(SMALL, DENSITY * self.path.stat().st_size)  # what it may hold, compressed or not [bytes]
        self.times = _numbers(self.file, "time", 1, most)
        self.steps = _numbers(self.file, "step", 1, most)
        increasing = all((np.diff(values) > 0).all() for values in (self.times, self.steps))
        if len(self.steps) != len(self.times) or not increasing:
            raise ValueError(f"its {len(self.times)} times or {len(self.steps)} steps do not increase")
        self.box_origin, self.box_size = (
            _numbers(self.file, name, 1, most) for name in ("box_origin", "box_size")
        )
        if self.box_origin.shape != (3,) or self.box_size.shape != (3,) or not (self.box_size > 0).all():
            raise ValueError(f"the box {self.box_origin}, {self.box_size} is none")
        groups = _children(self.file, "families")
        if not groups:
            raise ValueError("it has no families")
        groups = sorted(groups.items(), key=lambda item: int(item[1].attrs["number"]))
        self.families = {name: self._family(name, group, most) for name, group in groups}
        self.tension = all("tension" in group for _, group in groups)
        self.metadata = self._metadata(most)

    def _family(self, name: str, group: h5py.Group, most: int) -> FamilyRecord:
        positions = _dataset(group, "positions", 4, most)
        _, count, beads, _ = positions.shape
        if positions.shape[::3] != (len(self.times), 3):
            raise ValueError(
                f"family {name} has positions of shape {positions.shape} at {len(self.times)} times"
            )
        if "tension" in group:
            shape = _dataset(group, "tension", 3, most).shape
            if shape != (len(self.times), count, beads - 1):
                raise ValueError(f"family {name} has a tension of shape {shape} at {len(self.times)} times")
        seed = group.attrs["seed"]
        stiffness = _numbers(group, "bending_stiffness", None, most)
        model = dict(_child(group, "model", h5py.Group).attrs)
        if not all(isinstance(word, str) for word in model.values()):
            raise ValueError(f"family {name} has a model that is not in words")
        return FamilyRecord(
            name,
            count,
            beads,
            float(_numbers(group, "radius", 0, most)),
            float(stiffness) if np.ndim(stiffness) == 0 else stiffness,
            None if isinstance(seed, h5py.Empty) else int(seed),
            model,
        )

    def _metadata(self, most: int) -> dict:
        values = dict(self.file.attrs)
        values["schema_version"] = int(values["schema_version"])
        # attributes of Recording, and the names in the file
        for name, dataset in (("dynamic_viscosity", "viscosity"), ("density", "density")):
            values[name] = float(_numbers(self.file, dataset, 0, most))
            if not values[name] > 0:
                raise ValueError(f"{dataset} is {values[name]}")
        texts = {}

        def collect(name: str, node) -> None:
            if isinstance(node, h5py.Dataset):
                texts[name] = node.asstr()[()]

        if "dictionaries" in self.file:
            _child(self.file, "dictionaries", h5py.Group).visititems(collect)
        values["dictionaries"] = texts
        return values

    def close(self) -> None:
        if self.file is not None:
            self.file.close()
        self._changes.close()


class UnknownVersion(ValueError):
    """A recording of another program version."""


def _child(group: h5py.Group, name: str, kind: type):
    """What a group itself holds under a name: not by a link to elsewhere, in this file or in another."""
    if not isinstance(group.get(name, getlink=True), h5py.HardLink):
        raise ValueError(f"'{name}' is not in it")
    node = group[name]
    if not isinstance(node, kind):
        raise ValueError(f"'{name}' is no {kind.__name__.lower()}")
    return node


def _children(group: h5py.Group, name: str) -> dict[str, h5py.Group]:
    inner = _child(group, name, h5py.Group)
    return {child: _child(inner, child, h5py.Group) for child in inner}


def _dataset(group: h5py.Group, name: str, dimensions: int | None, most: int) -> h5py.Dataset:
    """A dataset of numbers whose values are in this file, and which is not larger than the file can hold."""
    found = _child(group, name, h5py.Dataset)
    if found.dtype.kind not in "fiu" or found.is_virtual or found.external:
        raise ValueError(f"'{name}' holds no numbers of its own")
    if found.shape is None or (dimensions is not None and found.ndim != dimensions):
        raise ValueError(f"'{name}' has shape {found.shape}")
    if found.nbytes > most:
        raise ValueError(f"'{name}' has shape {found.shape}, which is more than the file holds")
    return found


def _numbers(group: h5py.Group, name: str, dimensions: int | None, most: int) -> NDArray:
    values = _dataset(group, name, dimensions, most)[()]
    if not np.isfinite(values).all():
        raise ValueError(f"'{name}' is not finite")
    return values


def _by_start(folder: Path) -> list[list[Path]]:
    """The files of each start time in a folder postProcessing/fibers, in their order."""
    found = (shared_files(path, "fibers", ".h5") for path in numbered(folder).values())
    return [files for files in found if files]


def _with_partners(path: Path) -> list[list[Path]]:
    """The files of a run of which this is one: itself, or those of all daemons that shared the fibers."""
    match = re.fullmatch(r"(.*)\.\d+of(\d+)(\.\w+)", path.name)
    if match is None:
        return [[path]]
    stem, of, suffix = match.groups()
    partners = [path.with_name(share.name(stem, suffix)) for share in all_shares(int(of))]
    missing = [p.name for p in partners if not p.is_file()]
    if missing:
        raise ValueError(f"{path} holds a part of the fibers; {', '.join(missing)} beside it is missing")
    return [partners]


def open_recording(paths: Path | str | Iterable[Path | str]) -> Recording:
    """Open a recording: one file, a folder ``postProcessing/fibers`` of a case, or a list of files.

    The files of a list are the parts of one run; where their times overlap, the one that starts later counts.
    Raises FileNotFoundError if there is none, ValueError if one is not a recording, has another schema
    version, or holds other families than the rest.
    """
    paths = [paths] if isinstance(paths, (str, Path)) else list(paths)
    files = []
    for path in map(Path, paths):
        files += _by_start(path) if path.is_dir() else _with_partners(path)
    files = [list(shared) for shared in dict.fromkeys(map(tuple, files))]
    if not files:
        raise FileNotFoundError(f"no fiber recording ({', '.join(map(str, paths)) or 'an empty list'})")
    parts: list[_Part] = []
    try:
        for shared in files:
            parts.append(_Part(shared))
        first = parts[0]
        for part in parts[1:]:
            shapes = [{name: family.shape for name, family in p.families.items()} for p in (first, part)]
            if shapes[0] != shapes[1]:
                raise ValueError(
                    f"{part.paths[0]} holds families {shapes[1]}, {first.paths[0]} {shapes[0]}: not one run"
                )
    except BaseException:
        for part in parts:
            part.close()
        raise
    filled = [part for part in parts if len(part.times)]
    for part in parts:
        if filled and part not in filled:
            part.close()
    return Recording(sorted(filled, key=lambda part: part.times[0]) or parts[-1:])
