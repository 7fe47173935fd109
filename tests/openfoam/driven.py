"""A solver of OpenFOAM with loads that a test prescribes: the daemon's side played by the test."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np

from gbm_plugin.case.scene import read_scene
from gbm_plugin.coupling.listen import listen
from gbm_plugin.coupling.message import (
    Kind,
    Message,
    decode_sample,
    encode_array,
    encode_welcome,
    sample_size,
)

from conftest import make_case, solver_log, start_solver

REST = "field random;\nspectrum peaked;\nkineticEnergy 1e-30;\npeakWavenumber 2;\nmaxWavenumber 4;\nseed 1;\n"


def driven(
    case: Path, places: np.ndarray, loads: np.ndarray, move: Callable | None = None, ranks: int = 1
) -> np.ndarray:
    """The case's solver with the loads (2, B, 3), forces and torques, on the flow at places (B, 3) in every step;
    move(step) gives other places. What it sampled in every step: velocity and rotation, (S, 2, B, 3)."""
    scene, samples = read_scene(case), []
    beads, payload = len(places), encode_array(loads)
    with listen(case, scene.coupling, solver_log(case)) as listener:
        solver = start_solver(case, ranks)
        try:
            channel, _, _ = listener.greet(lambda: solver.poll() is not None)
            channel.send(Message(Kind.WELCOME, 0, 0.0, encode_welcome("rotation", True, [(1, beads, 0)])))
            step = 0
            while True:
                time, at = step * scene.time_step, places if move is None else move(step)
                channel.send(Message(Kind.POSITIONS, step, time, encode_array(at)))
                message = channel.receive(sample_size(beads, "rotation"))
                while message.kind is Kind.SAVE:
                    message = channel.receive(sample_size(beads, "rotation"))
                if message.kind is not Kind.SAMPLE:
                    break
                samples.append(decode_sample(message, beads, "rotation"))
                channel.send(Message(Kind.FORCES, step, time, payload))
                step += 1
            channel.send(Message(Kind.GOODBYE, message.step, message.time))
            assert solver.wait() == 0, solver_log(case).read_text()[-2000:]
        finally:
            solver.kill()
            solver.wait()
    return np.array(samples)


def fluid_at_rest(path: Path, beads: int, **options) -> Path:
    """A case without flow and without forcing, whose one fiber has so many beads."""
    families = f"points {{ count 1; beads {beads}; length 0.01; bendingStiffness 0; seed 1; }}"
    options = {"tight": False} | options
    make_case(path, families=families, fv_options="", prepared=True, initial=REST, **options)
    properties = path / "constant/fiberProperties"
    words = "coupling { feedback yes; ownDisturbance kept;"
    properties.write_text(properties.read_text().replace("coupling {", words))
    return path
