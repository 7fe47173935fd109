"""The daemon's side of the protocol with positions that the test chooses: what OpenFOAM samples there."""

from __future__ import annotations

import numpy as np

from gbm_plugin.case.scene import read_scene
from gbm_plugin.coupling.listen import listen
from gbm_plugin.coupling.message import (
    Kind,
    Message,
    decode_sample,
    encode_array,
    encode_welcome,
)

from conftest import set_families, solver_log, start_solver


def probe(case, positions: np.ndarray, need: str = "rotation", ranks: int = 1):
    """Run the solver to its end with beads that stay at positions (B, 3).

    Returns what it said of itself, and {step: (time, velocity, extra)}.
    """
    scene = read_scene(case)
    set_families(case, f"probes {{ count {len(positions)}; beads 1; }}")
    samples = {}
    solver = start_solver(case, ranks)
    try:
        with listen(case, scene.coupling, solver_log(case)) as listener:
            greeted = listener.greet(lambda: solver.poll() is not None)
            assert greeted is not None, solver_log(case).read_text()[-3000:]
            channel, first, hello = greeted
            channel.send(
                Message(
                    Kind.WELCOME,
                    first.step,
                    first.time,
                    encode_welcome(need, False, [(len(positions), 1, 0)]),
                )
            )
            step = first.step
            while True:
                time = first.time + (step - first.step) * hello.time_step
                channel.send(Message(Kind.POSITIONS, step, time, encode_array(positions)))
                message = channel.receive()
                if message.kind is Kind.SAVE:
                    message = channel.receive()
                if message.kind is Kind.END:
                    channel.send(Message(Kind.GOODBYE, message.step, message.time))
                    break
                samples[step] = (message.time, *decode_sample(message, len(positions), need))
                step += 1
            channel.close()
        assert solver.wait() == 0, solver_log(case).read_text()[-3000:]
    finally:
        solver.kill()
    return hello, samples
