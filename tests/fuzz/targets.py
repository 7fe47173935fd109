"""The files that a case may bring: for each kind a small valid one, how it is altered, and the reading of it."""

from __future__ import annotations

import math
import shutil
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from random import Random

import h5py
import numpy as np

from gbm_plugin.case.layout import FLOW_FILE, STATE_FILE
from gbm_plugin.case.mesh import box_mesh
from gbm_plugin.case.scene import read_scene
from gbm_plugin.fleet.fleet import Fleet
from gbm_plugin.output.field import read_velocity
from gbm_plugin.output.recording import FamilyRecord, Recorder, open_recording
from gbm_plugin.output.tables import read_dat
from gbm_plugin.report.paraview import polylines
from gbm_plugin.run.spectral import _SpectralFlow
from gbm_plugin.run.stored import SOURCE_FILE, _Stored
from gbm_plugin.spectral import EswaranPope, SpectralSolver

import alter

CASE = Path(__file__).parents[2] / "openfoam_case"
FAMILIES = """interpolation trilinear;
coupling { feedback yes; ownDisturbance removed; }
families
{
    soft { count 3; beads 5; length 0.6; bendingStiffness 1e-4; seed 1; }
    stiff { count 2; beads 4; length 0.6; bendingStiffness 1e-3; seed 2; integrator implicit; }
}
"""
POSITIONS = 'families { one { shape file; positions "positions.npy"; bendingStiffness 1e-4; } }\n'
HEADER = "FoamFile { version 2.0; format ascii; class dictionary; object fiberProperties; }\n"
STEP, N = 0.01, 6


@dataclass(frozen=True)
class Target:
    """One kind of file: `make` writes a valid one below a folder, `alter` changes it, `read` takes it as gbm would."""

    name: str
    make: Callable[[Path], Path]
    alter: Callable[[Path, Random], str]
    read: Callable[[Path], object]


def _case(folder: Path, fibers: str) -> Path:
    case = folder / "case"
    if not case.is_dir():
        case.mkdir(parents=True)
        for part in ("0.orig", "constant", "system"):
            shutil.copytree(CASE / part, case / part, ignore=shutil.ignore_patterns("polyMesh"))
        (case / "constant/fiberProperties").write_text(HEADER + fibers)
    return case


def _fleet(folder: Path) -> Fleet:
    scene = read_scene(_case(folder, FAMILIES))
    return Fleet.seeded(scene, scene.origin, np.add(scene.origin, scene.box), 0.0)


def _step(fleet: Fleet) -> None:
    fleet.reaction(STEP)
    fleet.advance(STEP)
    for _ in range(2):
        x = fleet.positions
        fleet.observe(fleet.time, np.sin(x), 0.1 * np.cos(x))
        if not fleet.provisional:
            return
        fleet.correct()


def _make_fibers(folder: Path) -> Path:
    fleet = _fleet(folder)
    fleet.observe(0.0, np.sin(fleet.positions), 0.1 * np.cos(fleet.positions))
    for _ in range(4):
        _step(fleet)
    fleet.save(folder / "case/0.04", 4, fleet.time)
    return folder / "case/0.04" / STATE_FILE


def _read_fibers(path: Path) -> None:
    fleet = _fleet(path.parents[3])
    fleet.restore(path.parents[1])
    _step(fleet)


def _spectral(folder: Path) -> _SpectralFlow:
    scene = read_scene(_case(folder, FAMILIES))
    forcing = EswaranPope(variance=0.1, time_scale=0.5, cutoff=1.5, seed=1)
    return _SpectralFlow(scene, SpectralSolver(8, 0.1, forcing=forcing, time_step=STEP))


def _make_spectral(folder: Path) -> Path:
    flow = _spectral(folder)
    x = 2 * np.pi * np.arange(8) / 8
    flow.solver.set_velocity(
        np.array(np.broadcast_arrays(np.sin(x)[None, :, None], 0, 0, np.zeros((8, 8, 8)))[:3])
    )
    for _ in range(4):
        flow.advance()
    flow.before = (0.1, 0.2)
    flow.save(folder / "case/0.04")
    return folder / "case/0.04" / FLOW_FILE


def _read_spectral(path: Path) -> None:
    flow = _spectral(path.parents[3])
    flow.restore(path.parents[1], 0.04)
    flow.advance()


def _make_stored(folder: Path) -> Path:
    _Stored(None, None, {"fields": "time folders", "every": 1}).save(folder)
    return folder / SOURCE_FILE


def _read_stored(path: Path) -> None:
    _Stored(None, None, {"fields": "time folders", "every": 1}).restore(path.parents[1], 0.0)


def _chains() -> np.ndarray:
    x = np.zeros((3, 5, 3))
    x[:, :, 0] = 0.2 * np.arange(5)
    x[:, :, 1] = np.arange(3)[:, None]
    return x


def _make_recording(folder: Path) -> Path:
    path = folder / "fibers.h5"
    family = FamilyRecord("soft", 3, 5, 0.1, 1e-4, 1, {"mobility": "freeDrain"})
    scene = {"box_origin": [0] * 3, "box_size": [2] * 3, "dynamic_viscosity": 1.0, "density": 1.0}
    with Recorder(path, [family], **scene, dictionaries={"a/b": "x 1;"}, program_version="0") as recorder:
        for step in range(4):
            recorder.append(step, 0.1 * step, [_chains() + 0.1 * step])
    return path


def _read_recording(path: Path) -> None:
    with open_recording(path) as recording:
        for family in recording.families.values():
            np.linalg.norm(family.positions[:], axis=-1)
        polylines(recording, len(recording.times) - 1, wrapped=True)


def _make_positions(folder: Path) -> Path:
    path = _case(folder, POSITIONS) / "positions.npy"
    np.save(path, _chains())
    return path


def _read_positions(path: Path) -> None:
    scene = read_scene(path.parent)
    Fleet.seeded(scene, scene.origin, np.add(scene.origin, scene.box), 0.0)


def _foam(kind: str, form: str, content: bytes) -> bytes:
    arch = "LSB;label=32;scalar=64"
    head = f'FoamFile\n{{\n version 2.0;\n format {form};\n class {kind};\n arch "{arch}";\n object x;\n}}\n'
    return head.encode() + content


def _velocity(form: str) -> Callable[[Path], Path]:
    def make(folder: Path) -> Path:
        u = np.random.default_rng(1).normal(size=(N**3, 3))
        values = (
            u.tobytes() if form == "binary" else "\n".join("({} {} {})".format(*row) for row in u).encode()
        )
        field = b"dimensions [0 1 -1 0 0 0 0];\ninternalField nonuniform List<vector> \n%d\n(%s)\n;\n" % (
            N**3,
            values,
        )
        path = folder / "1/U"
        path.parent.mkdir(parents=True)
        path.write_bytes(_foam("volVectorField", form, field + b"boundaryField { x { type cyclic; } }\n"))
        return path

    return make


def _read_velocity(path: Path) -> None:
    read_velocity(path.parents[1], "1", (N, N, N)).sum()


def _mesh(name: str) -> Callable[[Path], Path]:
    def make(folder: Path) -> Path:
        mesh = folder / "constant/polyMesh"
        mesh.mkdir(parents=True)
        i = np.arange(N + 1)
        points = np.stack(np.meshgrid(i, i, i, indexing="ij"), axis=-1).transpose(2, 1, 0, 3).reshape(-1, 3)
        cells = np.arange(N**3).reshape(N, N, N)  # z, y, x
        pairs = [(cells[:, :, :-1], cells[:, :, 1:]), (cells[:, :-1], cells[:, 1:]), (cells[:-1], cells[1:])]
        low, high = (np.concatenate([pair[side].ravel() for pair in pairs]) for side in range(2))
        lists = {"points": points, "owner": np.append(low, [0, N**3 - 1]), "neighbour": high}
        for file, values in lists.items():
            kind = "vectorField" if file == "points" else "labelList"
            text = "\n".join("({} {} {})".format(*v) if file == "points" else str(v) for v in values)
            (mesh / file).write_bytes(_foam(kind, "ascii", f"{len(values)}\n(\n{text}\n)\n".encode()))
        return mesh / name

    return make


def _read_mesh(path: Path) -> None:
    box_mesh(path.parents[2])


def _make_table(folder: Path) -> Path:
    path = folder / "linearForcing/0/linearForcing.dat"
    path.parent.mkdir(parents=True)
    rows = "".join(f"{0.1 * i:g}\t{math.sin(i)}\t(1 2 {i})\n" for i in range(20))
    path.write_text("# Time\tk\tmean\n" + rows)
    return path


def _read_table(path: Path) -> None:
    read_dat(path.parents[1], path.name)


def _alter_recording(path: Path, random: Random) -> str:
    if random.random() < 0.4:
        return alter.some_bytes(path, random)
    with h5py.File(path, "r+") as file:
        return alter.a_node(file, random)


TARGETS = [
    Target("fiber-state", _make_fibers, alter.an_array, _read_fibers),
    Target("spectral-state", _make_spectral, alter.an_array, _read_spectral),
    Target("stored-state", _make_stored, alter.a_text, _read_stored),
    Target("recording", _make_recording, _alter_recording, _read_recording),
    Target("positions", _make_positions, alter.an_array, _read_positions),
    Target("field-ascii", _velocity("ascii"), alter.a_text, _read_velocity),
    Target("field-binary", _velocity("binary"), alter.a_text, _read_velocity),
    Target("points", _mesh("points"), alter.a_text, _read_mesh),
    Target("owner", _mesh("owner"), alter.a_text, _read_mesh),
    Target("table", _make_table, alter.a_text, _read_table),
]
