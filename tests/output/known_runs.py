"""Recorded runs whose fibers have statistics that are known: chains, coils and rods made at random."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np

from gbm_plugin.output.recording import FamilyRecord, Recorder
from gbm_plugin.scales import kolmogorov_length, taylor_reynolds

from sample_records import SCENE

VISCOSITY, DISSIPATION, RMS = 1e-3, 1.5e-3, 0.13
MU_RHO_EPSILON = VISCOSITY * DISSIPATION


def persistence(stiffness: float) -> float:
    """l_p [m], eq. (15)."""
    return stiffness**0.25 / MU_RHO_EPSILON**0.125


def unit(vectors: np.ndarray) -> np.ndarray:
    return vectors / np.linalg.norm(vectors, axis=-1, keepdims=True)


def chains(random, count: int, beads: int, radius: float, cosine: float) -> np.ndarray:
    """(F, N, 3) freely rotating chains: each link makes an angle of this cosine with the one before, so that links n
    apart have the mean cosine cosine^n."""
    links = [unit(random.normal(size=(count, 3)))]
    for _ in range(beads - 2):
        side = unit(np.cross(links[-1], random.normal(size=(count, 3))))
        links.append(cosine * links[-1] + np.sqrt(1 - cosine**2) * side)
    beads_at = np.cumsum(2 * radius * np.stack(links, axis=1), axis=1)
    return np.concatenate([np.zeros((count, 1, 3)), beads_at], axis=1) + random.uniform(0, 6, (count, 1, 3))


def rods(directions: np.ndarray, beads: int, radius: float) -> np.ndarray:
    """(F, N, 3) straight chains along unit vectors (F, 3)."""
    places = 2 * radius * (np.arange(beads) - (beads - 1) / 2)
    return 3.0 + places[:, None] * directions[:, None]


def record_run(
    case: Path, families: list[tuple[FamilyRecord, Callable[[float], np.ndarray]]], times: np.ndarray, **scene
) -> Path:
    """A finished run: its recording, families at each time as their functions say, and its flow's table, in which the
    dissipation swings by a tenth with no time of its own."""
    words = SCENE | {"dynamic_viscosity": VISCOSITY} | scene
    with Recorder(
        case / "postProcessing/fibers/0/fibers.h5", [record for record, _ in families], **words
    ) as recorder:
        for step, time in enumerate(times):
            recorder.append(step, time, [positions(time) for _, positions in families])
    random = np.random.default_rng(1)
    epsilon = DISSIPATION * (1 + 0.1 * random.choice([-1, 1], len(times)))
    epsilon *= DISSIPATION / epsilon.mean()
    folder = case / "postProcessing/forcing/0"
    folder.mkdir(parents=True)
    names = ["Time", "k", "epsilonBudget", "epsilonGradient", "uPrime", "ReLambda", "eta"]
    with (folder / "forcing.dat").open("w") as table:
        table.write("# " + "\t".join(names) + "\n")
        for time, value in zip(times, epsilon, strict=True):
            line = (time, 1.5 * RMS**2, value, 0.9 * value, RMS, taylor_reynolds(RMS, VISCOSITY, value))
            table.write("\t".join(f"{x:.10g}" for x in (*line, kolmogorov_length(VISCOSITY, value))) + "\n")
    return case
