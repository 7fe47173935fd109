"""An OpenFOAM case that looks as after a run: synthetic flow, drifting bent fibers, tables. Not physics."""

import os
import shutil
import subprocess
from pathlib import Path

import numpy as np

from gbm_plugin.output.recording import FamilyRecord, Recorder

BOX = 2 * np.pi
NU = 1e-3
BLOCK_MESH = shutil.which("blockMesh")
_HEADER = """FoamFile
{{
    version     2.0;
    format      ascii;
    class       {kind};
    location    "{place}";
    object      {name};
}}

"""


def write_mesh(case: Path, cells: int) -> None:
    corners = [(x, y, z) for z in (0, 1) for x, y in ((0, 0), (1, 0), (1, 1), (0, 1))]
    vertices = "\n".join(f"({BOX * x} {BOX * y} {BOX * z})" for x, y, z in corners)
    faces = {
        "left": "(0 4 7 3)", "right": "(1 2 6 5)", "bottom": "(0 1 5 4)",
        "top": "(3 7 6 2)", "back": "(0 3 2 1)", "front": "(4 5 6 7)",
    }  # fmt: skip
    names = list(faces)
    patches = "\n".join(
        f"{name} {{ type cyclic; neighbourPatch {names[i + 1 - 2 * (i % 2)]}; faces ({faces[name]}); }}"
        for i, name in enumerate(names)
    )
    (case / "system").mkdir(parents=True)
    (case / "system/controlDict").write_text(
        _HEADER.format(kind="dictionary", place="system", name="controlDict")
        + "application pimpleFoam;\nstartFrom startTime;\nstartTime 0;\nstopAt endTime;\nendTime 1;\n"
        "deltaT 0.1;\nwriteControl timeStep;\nwriteInterval 1;\n"
    )
    (case / "system/blockMeshDict").write_text(
        _HEADER.format(kind="dictionary", place="system", name="blockMeshDict")
        + f"vertices\n(\n{vertices}\n);\nblocks (hex (0 1 2 3 4 5 6 7) ({cells} {cells} {cells}) "
        f"simpleGrading (1 1 1));\nedges ();\nboundary\n(\n{patches}\n);\n"
    )
    environment = {"WM_PROJECT_DIR": "/usr/share/openfoam", **os.environ}
    subprocess.run([BLOCK_MESH, "-case", case], check=True, capture_output=True, env=environment)


def random_flow(cells: int, seed: int = 0) -> np.ndarray:
    """Divergence-free random field (3, n, n, n) with a model spectrum, at the cell centres."""
    random = np.random.default_rng(seed)
    k = np.stack(np.meshgrid(*[np.fft.fftfreq(cells, 1 / cells)] * 3, indexing="ij"))
    magnitude = np.sqrt((k**2).sum(axis=0))
    magnitude[0, 0, 0] = 1
    wave = np.fft.fftn(random.normal(size=(3, cells, cells, cells)), axes=(1, 2, 3))
    wave -= k * (k * wave).sum(axis=0) / magnitude**2
    spectrum = magnitude**4 / (1 + (magnitude / 1.5) ** 2) ** (17 / 6) * np.exp(-7 * magnitude / cells)
    wave *= np.sqrt(spectrum) / magnitude * (magnitude < cells / 2)
    wave[:, 0, 0, 0] = 0
    velocity = np.fft.ifftn(wave, axes=(1, 2, 3)).real
    return velocity * np.sqrt(0.5 / (0.5 * (velocity**2).sum(axis=0).mean()))


def write_velocity(case: Path, time: str, velocity: np.ndarray) -> None:
    rows = velocity.transpose(0, 3, 2, 1).reshape(3, -1).T  # x fastest
    folder = case / time
    folder.mkdir(exist_ok=True)
    values = "\n".join("({:.15g} {:.15g} {:.15g})".format(*row) for row in rows)
    (folder / "U").write_text(
        _HEADER.format(kind="volVectorField", place=time, name="U")
        + "dimensions      [0 1 -1 0 0 0 0];\n\ninternalField   nonuniform List<vector> \n"
        f"{len(rows)}\n(\n{values}\n)\n;\n\nboundaryField\n{{\n}}\n"
    )


def write_forcing_table(case: Path, start: float, times: np.ndarray) -> None:
    k = 0.5 + 0.08 * np.sin(1.3 * times) + 0.02 * np.sin(7.1 * times)
    epsilon = 0.09 + 0.02 * np.sin(1.3 * times - 0.9)
    rms = np.sqrt(2 * k / 3)
    columns = dict(
        Time=times, k=k,
        epsilonBudget=epsilon, epsilonGradient=0.9 * epsilon, epsilonLaplacian=0.97 * epsilon,
        uPrime=rms, ReLambda=rms * np.sqrt(15 * NU * rms**2 / epsilon) / NU, eta=(NU**3 / epsilon) ** 0.25,
        A=epsilon / (2 * k), power=epsilon, meanUx=1e-17 + 0 * k, meanUy=0 * k, meanUz=-2e-17 + 0 * k,
    )  # fmt: skip
    folder = case / "postProcessing/linearForcing" / f"{start:g}"
    folder.mkdir(parents=True)
    np.savetxt(
        folder / "linearForcing.dat",
        np.stack(list(columns.values()), axis=-1),
        header="Time\t" + "\t".join(list(columns)[1:]),
        delimiter="\t",
    )


def bent_fibers(times, count, beads, radius, bend, seed) -> np.ndarray:
    """(S, F, N, 3): links of length 2a whose directions wander smoothly, more with time; carried along."""
    random = np.random.default_rng(seed)
    s = np.arange(beads - 1) / beads
    phase = random.uniform(0, 2 * np.pi, size=(2, 4, count, 1))
    weight = random.normal(size=(2, 4, count, 1)) / np.arange(1, 5)[:, None, None] ** 1.2
    first = random.normal(size=(count, 3))
    frame = np.linalg.qr(np.stack([first, *random.normal(size=(2, count, 3))], axis=-1))[0]
    centre, drift = random.uniform(0, BOX, size=(count, 3)), 0.4 * random.normal(size=(count, 3))
    shapes = []
    for time in times:
        mode = np.arange(1, 5)[:, None, None]
        angle = (
            bend
            * (1 - np.exp(-time))
            * (
                weight
                * np.sin(np.pi * mode * s + phase + 0.8 * time * np.array([1, 1.3])[:, None, None, None])
            ).sum(axis=1)
        )
        theta, tilt = angle
        local = np.stack([np.cos(theta) * np.cos(tilt), np.sin(theta) * np.cos(tilt), np.sin(tilt)], axis=-1)
        links = 2 * radius * np.einsum("fij,fnj->fni", frame, local)
        chain = np.concatenate([np.zeros((count, 1, 3)), np.cumsum(links, axis=1)], axis=1)
        shapes.append(chain - chain.mean(axis=1, keepdims=True) + (centre + drift * time)[:, None])
    return np.array(shapes)


def make_case(case: Path, cells: int = 16, counts: tuple[int, int] = (12, 12)) -> Path:
    """Write the whole case: U at time 2, forcing tables and fibers of a run to 2, restarted at 1.2."""
    write_mesh(case, cells)
    write_velocity(case, "2", random_flow(cells))
    write_forcing_table(case, 0, np.arange(0.02, 1.41, 0.02))
    write_forcing_table(case, 1.2, np.arange(1.22, 2.001, 0.02))
    families = [
        FamilyRecord("stiff", counts[0], 20, 0.05, 1e-4, 1, {"mobility": "freeDrain"}),
        FamilyRecord("soft", counts[1], 40, 0.025, 1e-7, 2, {"mobility": "freeDrain"}),
    ]
    steps = np.arange(0, 41)
    shapes = [
        bent_fibers(0.05 * steps, family.count, family.beads, family.radius, bend, seed)
        for family, bend, seed in zip(families, (0.7, 2.2), (1, 2), strict=True)
    ]
    scene = dict(
        box_origin=[0] * 3, box_size=[BOX] * 3, dynamic_viscosity=NU, density=1.0,
        dictionaries={"constant/fiberProperties": "rho 1;"}, program_version="0.1.0",
    )  # fmt: skip
    for start, part in (("0", steps[:29]), ("1.2", steps[24:])):
        path = case / "postProcessing/fibers" / start / "fibers.h5"
        with Recorder(path, families, **scene) as recorder:
            for step in part:
                recorder.append(step, 0.05 * step, [shape[step] for shape in shapes])
    return case
