"""The statistics that a run gathers of its fibers, postProcessing/fibers/<start>/statistics.h5: docs/files.md has the
layout. Of a run that went on the newest file has all since they began."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import h5py
import numpy as np

from ..case.layout import numbered
from ..case.share import WHOLE, Share, shared_files
from ..files import replacement
from ..statistics.running import Running, merged

STEM, SUFFIX = "statistics", ".h5"
SCHEMA_VERSION = 1


@dataclass(frozen=True)
class Gathered:
    """The statistics of every family, their times (S,) [s] and the time between samples [s]."""

    times: np.ndarray
    families: dict[str, Running]

    @property
    def spacing(self) -> float:
        return float(np.diff(self.times).mean()) if len(self.times) > 1 else np.nan


def statistics_name(share: Share = WHOLE) -> str:
    """The file of a daemon."""
    return share.name(STEM, SUFFIX)


def write_statistics(path: Path, times: Sequence[float], families: Mapping[str, Running]) -> None:
    """The file, in place of what was there, at once."""
    with replacement(path) as part, h5py.File(part, "w") as file:
        file.attrs["schema_version"] = SCHEMA_VERSION
        file.create_dataset("time", data=np.array(times, float)).attrs["units"] = "s"
        for number, (name, running) in enumerate(families.items()):
            group = file.create_group(f"families/{name}")
            group.attrs.update(number=number, fibers=running.fibers, beads=running.beads, lags=running.lags)
            group.attrs.update(radius=running.radius)
            for key, values in running.state().items():
                group[key] = values


def read_statistics(folder: Path | str) -> Gathered:
    """Of the newest start in a folder postProcessing/fibers, the files of all daemons as one. FileNotFoundError where
    there are none, ValueError where they cannot be read."""
    starts = [shared_files(start, STEM, SUFFIX) for start in numbered(Path(folder)).values()]
    paths = next((files for files in reversed(starts) if files), None)
    if not paths:
        raise FileNotFoundError(
            f"no {STEM}{SUFFIX} in {folder}/<start time>/: constant/fiberProperties asks for it, statistics {{ }}"
        )
    try:
        parts = [_read(path) for path in paths]
    except (OSError, KeyError, TypeError, RuntimeError) as error:
        raise ValueError(f"{paths[0]} cannot be read: {error}") from None
    times = min((times for times, _ in parts), key=len)
    if any(len(other) != len(times) for other, _ in parts):
        raise ValueError(
            f"{paths[0]} and its partners are not of one time: they were read while they were written"
        )
    families = {}
    for name in parts[0][1]:
        own = [part[name] for _, part in parts]
        count = sum(attributes["fibers"] for attributes, _ in own)
        first = own[0][0]
        running = Running(int(count), int(first["beads"]), float(first["radius"]), int(first["lags"]))
        running.restore(merged([state for _, state in own], slice(None)))
        families[name] = running
    return Gathered(times, families)


def _read(path: Path) -> tuple[np.ndarray, dict[str, tuple[dict, dict]]]:
    with h5py.File(path, "r") as file:
        if file.attrs.get("schema_version") != SCHEMA_VERSION:
            raise ValueError(
                f"{path} has schema_version {file.attrs.get('schema_version')}; {SCHEMA_VERSION} is read"
            )
        groups = sorted(file["families"].items(), key=lambda item: int(item[1].attrs["number"]))
        return file["time"][()], {name: (dict(group.attrs), _arrays(group)) for name, group in groups}


def _arrays(group: h5py.Group) -> dict[str, np.ndarray]:
    return {f"{kind}/{key}": data[()] for kind, inner in group.items() for key, data in inner.items()}
