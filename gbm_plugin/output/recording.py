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

__all__ = ["FamilyRecord", "Positions", "RecordedFamily", "Recorder", "Recording", "open_recording"]


class Positions:
    """Positions (S, F, N, 3) [m] of one family, read from the files when indexed: by slices and whole numbers,
    times also by an array of them or of truth values."""

    def __init__(self, parts: list[tuple[h5py.Dataset, int]]) -> None:
        """parts: datasets in the order of time, and how many of the first records of each count."""
        self._parts = parts
        self._starts = np.cumsum([0] + [count for _, count in parts])
        self.shape = (int(self._starts[-1]), *parts[0][0].shape[1:])
        self.dtype = np.dtype(np.float64)
        self.ndim = 4

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
            return self._parts[part][0][(int(rows - self._starts[part]), *rest)]
        runs = np.split(rows, np.flatnonzero(np.diff(rows) != 1) + 1) if len(rows) else []
        pieces = [
            dataset[(slice(max(run[0] - start, 0), min(run[-1] + 1 - start, count)), *rest)]
            for run in runs
            for (dataset, count), start in zip(self._parts, self._starts[:-1], strict=True)
            if run[0] < start + count and run[-1] >= start
        ]
        empty = np.empty((0, *np.empty((1, *self.shape[1:]))[(slice(None), *rest)].shape[1:]))
        return np.concatenate(pieces) if pieces else empty

    def __array__(self, dtype=None, copy=None) -> NDArray[np.float64]:
        return np.asarray(self[:], dtype=dtype)


@dataclass(frozen=True)
class RecordedFamily(FamilyRecord):
    """A recorded family: its FamilyRecord and its positions (S, F, N, 3) [m]."""

    positions: Positions = None


class Recording:
    """One run's fibers, read from one file or from the parts that its restarts wrote.

    times (S,) [s]; steps (S,); families by name; box_origin, box_size (3,) [m]; metadata: schema_version,
    program, program_version, dynamic_viscosity [Pa s], density [kg/m³], dictionaries (text by file name).
    Usable as a context manager; positions are read from the open files.
    """

    def __init__(self, parts: list[_Part]) -> None:
        self._parts = parts
        last = parts[-1]
        counts = kept([part.times for part in parts])
        self.paths = [path for part in parts for path in part.paths]
        self.times = np.concatenate([part.times[:count] for part, count in zip(parts, counts, strict=True)])
        self.steps = np.concatenate([part.steps[:count] for part, count in zip(parts, counts, strict=True)])
        self.box_origin = last.files[0].file["box_origin"][()]
        self.box_size = last.files[0].file["box_size"][()]
        self.metadata = last.files[0].metadata()
        self.families = {
            name: RecordedFamily(
                **vars(record),
                positions=Positions(
                    [(part.positions(name), count) for part, count in zip(parts, counts, strict=True)]
                ),
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

    def positions(self, name: str) -> h5py.Dataset | _Joined:
        datasets = [file.file[f"families/{name}/positions"] for file in self.files]
        return datasets[0] if len(datasets) == 1 else _Joined(datasets)

    def close(self) -> None:
        for file in self.files:
            file.close()


class _Joined:
    """Datasets (S, F, N, 3) of several files as one, their fibers one after the other."""

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
    """One open file."""

    def __init__(self, path: Path) -> None:
        self.path = path
        for attempt in range(1, ATTEMPTS + 1):
            self._changes = Transaction(path, writable=False)
            try:
                # a file that was left in the middle of a change is read through its journal
                self.file = h5py.File(self._changes if self._changes.recovered else path, "r")
                break
            except OSError as error:  # perhaps a run has changed it while it was opened
                self._changes.close()
                if attempt == ATTEMPTS:
                    raise ValueError(f"{path} is not a fiber recording: {error}") from None
                time.sleep(PAUSE)
        version = self.file.attrs.get("schema_version")
        if version != SCHEMA_VERSION:
            self.close()
            raise ValueError(f"{path} has schema_version {version}; this program reads {SCHEMA_VERSION}")
        self.times = self.file["time"][()]
        self.steps = self.file["step"][()]
        groups = sorted(self.file["families"].items(), key=lambda item: item[1].attrs["number"])
        self.families = {name: self._family(name, group) for name, group in groups}

    @staticmethod
    def _family(name: str, group: h5py.Group) -> FamilyRecord:
        _, count, beads, _ = group["positions"].shape
        seed = group.attrs["seed"]
        stiffness = group["bending_stiffness"][()]
        return FamilyRecord(
            name,
            count,
            beads,
            float(group["radius"][()]),
            float(stiffness) if np.ndim(stiffness) == 0 else stiffness,
            None if isinstance(seed, h5py.Empty) else int(seed),
            dict(group["model"].attrs),
        )

    def metadata(self) -> dict:
        values = dict(self.file.attrs)
        values["schema_version"] = int(values["schema_version"])
        # attributes of Recording, and the names in the file
        for name, dataset in (("dynamic_viscosity", "viscosity"), ("density", "density")):
            values[name] = float(self.file[dataset][()])
        texts = {}

        def collect(name: str, node) -> None:
            if isinstance(node, h5py.Dataset):
                texts[name] = node.asstr()[()]

        if "dictionaries" in self.file:
            self.file["dictionaries"].visititems(collect)
        values["dictionaries"] = texts
        return values

    def close(self) -> None:
        self.file.close()
        self._changes.close()


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
