"""`gbm report --film`: fibers and flow in motion, a PNG per frame and, where ffmpeg is, an MP4."""

from __future__ import annotations

import shutil
import subprocess
from collections.abc import Callable, Iterable, Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ..case.layout import time_folders, velocity_file
from ..files import replaced
from ..output.field import read_velocity, vorticity_magnitude
from ..output.recording import Recording
from .picture import Choice, fibers_picture, largest_curvature
from .style import styled

DPI = 120
RATE = 15  # frames a second
FOLDER = "film"


def write_film(
    recording: Recording,
    case: Path,
    cells: tuple[int, int, int] | None,
    frames: int = 60,
    families: Sequence[str] = ("*",),
    fibers: int | None = None,
    since: float | None = None,
    progress: Callable[[Iterable, int, str], Iterable] = lambda work, *_: work,
) -> list[Path]:
    """Write CASE/report/film/frame_*.png of so many equally spaced records, and film.mp4; returns what was written.

    The vorticity on the faces is that of the latest field that was stored until then (of none, no faces). cells: of
    the mesh, None for one that is no box. Colours mean the same in all frames. ValueError where there is nothing to
    show or a family is not there.
    """
    if frames < 1 or (fibers is not None and fibers < 1):
        raise ValueError(f"a film has at least one frame and one fiber, not {frames} and {fibers}")
    rows = np.flatnonzero(recording.times >= (recording.times[0] if since is None else since))
    if not len(rows):
        raise ValueError(f"no record from t = {since:g} on: a film needs some")
    rows = rows[np.unique(np.linspace(0, len(rows) - 1, frames).round().astype(int))]
    fields = _Fields(case, cells, recording)
    some = [fields.at(recording.times[row]) for row in rows[:: max(1, len(rows) // 3)]]
    known = [float(np.percentile(f[0], 99.8)) for f in some if f is not None]
    choice = Choice(families, fibers)
    tops = {
        f.name: largest_curvature(f.positions[rows[:: max(1, len(rows) // 8)]], f.radius)
        for f in choice.of(recording)
    }
    choice = Choice(families, fibers, tops, max(known, default=None))
    folder = case / "report" / FOLDER
    folder.mkdir(parents=True, exist_ok=True)
    for old in folder.glob("frame_*.png"):
        old.unlink()
    written = []
    with styled():
        for number, row in enumerate(progress(rows, len(rows), "film")):
            figure = fibers_picture(recording, int(row), fields.at(recording.times[row]), choice)
            path = folder / f"frame_{number:04d}.png"
            with replaced(path, "wb") as file:
                figure.savefig(file, format="png", dpi=DPI, facecolor="white")
            written.append(path)
    return [*written, *_joined(folder)]


class _Fields:
    """|∇×u| of the stored fields, the latest until a time; the one in use is kept."""

    def __init__(self, case: Path, cells: tuple[int, int, int] | None, recording: Recording):
        self.case, self.cells, self.size = case, cells, recording.box_size
        folders = sorted(time_folders(case).items()) if cells else []
        self.folders = [(time, name) for time, name in folders if velocity_file(case / name)]
        self._kept: tuple[str, tuple[NDArray, str]] | None = None

    def at(self, time: float) -> tuple[NDArray, str] | None:
        earlier = [name for t, name in self.folders if t <= time * (1 + 1e-9)]
        names = earlier[-1:] or [name for _, name in self.folders[:1]]
        if not names:
            return None
        if self._kept is None or self._kept[0] != names[0]:
            velocity = read_velocity(self.case, names[0], self.cells)
            self._kept = names[0], (vorticity_magnitude(velocity, self.size), "|∇×u| [1/s]")
        return self._kept[1]


def _joined(folder: Path) -> list[Path]:
    """The MP4, where ffmpeg can make it."""
    program = shutil.which("ffmpeg")
    if program is None:
        return []
    film = folder.with_suffix(".mp4")
    even = "scale=trunc(iw/2)*2:trunc(ih/2)*2"  # what the pixels of an MP4 must be
    words = [
        program,
        "-y",
        "-loglevel",
        "error",
        "-framerate",
        str(RATE),
        "-i",
        str(folder / "frame_%04d.png"),
    ]
    done = subprocess.run(
        [*words, "-vf", even, "-pix_fmt", "yuv420p", str(film)], capture_output=True, text=True
    )
    if done.returncode:
        raise ValueError(f"ffmpeg could not make {film}: {done.stderr.strip().splitlines()[-1:]}")
    return [film]
