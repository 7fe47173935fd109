"""Speed of the fibers: bead-steps per second through the public simulate, and time to a given accuracy.

Processor time for one thread, wall time where two are compared; the best of several runs counts.
"""

from __future__ import annotations

import argparse
import time

import numpy as np

from gbm_plugin.fiber import Fibers, simulate
from gbm_plugin.flow import TaylorGreen
from gbm_plugin.threads import available, limited_to

from ..study import option

VISCOSITY = 1e-3


class Timed:
    """A flow that adds up the time spent in sampling it."""

    def __init__(self, flow, clock):
        self.flow, self.clock, self.seconds = flow, clock, 0.0

    def sample(self, positions, time_, need):
        """As the flow's own."""
        start = self.clock()
        result = self.flow.sample(positions, time_, need)
        self.seconds += self.clock() - start
        return result


def bent_fibers(count, beads, stiffness, diameter=0.1, seed=0) -> Fibers:
    """Smoothly bent fibers, 0.1 rad between links."""
    random = np.random.default_rng(seed)
    links = random.standard_normal((count, 1, 3))
    links = links / np.linalg.norm(links, axis=2, keepdims=True)
    links = links + np.cumsum(0.1 * random.standard_normal((count, beads - 1, 3)), axis=1)
    links /= np.linalg.norm(links, axis=2, keepdims=True)
    start = 2 * np.pi * random.random((count, 1, 3))
    positions = np.concatenate([start, start + np.cumsum(diameter * links, axis=1)], axis=1)
    return Fibers(positions, stiffness, VISCOSITY)


def bead_steps(fibers, step, steps, repeats=3, clock=time.process_time, **options) -> dict:
    """Bead-steps per second of simulate without sampling, the share of that, refinements; best of repeats."""
    best = None
    for _ in range(repeats):
        flow = Timed(TaylorGreen(np.pi, 0.1), clock)
        start = clock()
        trajectory = simulate(fibers, flow, step, steps * step, **options)
        total = clock() - start
        report = trajectory.report
        # steps of the flow actually taken; a step cut in pieces counts for each
        work = fibers.count * fibers.beads * report["steps"]
        own = total - flow.seconds
        row = {
            "bead_steps_per_second": work / own,
            "sampling_share": flow.seconds / total,
            "steps": report["steps"],
            "refined": report["refined_fibers"] / (fibers.count * report["steps"]),
        }
        if best is None or row["bead_steps_per_second"] > best["bead_steps_per_second"]:
            best = row
    return best


def time_to_accuracy(end=2.0) -> dict:
    """Stiff fibers (K = 1e-3, L = 2, N = 20, μ = 1e-3, Flow I rates): 1 % of L by each way, in seconds."""
    speed, width = 0.125, 0.7  # u' and integral length of Flow I
    positions = bent_fibers(8, 20, 1e-3).positions
    fibers = Fibers(positions, 1e-3, VISCOSITY)
    flow = TaylorGreen(width, speed)
    limit = VISCOSITY * (2 * fibers.radius) ** 4 / 1e-3

    def run(step, stop, **options):
        start = time.process_time()
        last = simulate(fibers, flow, step, stop, **options).positions[-1]
        return time.process_time() - start, last

    run(limit, 3 * limit, integrator="ab3")
    run(0.01, 0.03)
    _, tight = run(0.01, end, tolerance=1e-5)
    seconds, last = run(limit, end, integrator="ab3")
    rows = {"ab3 at eq. (10)": (seconds, last)}
    # its own stability limit allows steps longer than eq. (10), for which it is scaled, not run
    rows["ab3 at its own limit (scaled)"] = (seconds * 0.206 / (6 / 11), last)
    for step in (0.1, 0.4):
        for tolerance in (1e-2, 3e-2):
            rows[f"implicit, step {step:g}, tolerance {tolerance:g}"] = min(
                (run(step, end, tolerance=tolerance) for _ in range(5)), key=lambda row: row[0]
            )
    return {
        name: {
            "seconds": seconds,
            "error_over_length": float(np.linalg.norm(last - tight, axis=2).max() / fibers.contour_length),
        }
        for name, (seconds, last) in rows.items()
    }


def add_arguments(parser: argparse.ArgumentParser) -> None:
    option(parser, run, "fibers", "how many")
    option(parser, run, "beads", "of each fiber")
    option(parser, run, "repeats", "of which the best counts")
    option(parser, run, "quick", "without the large batches")


def run(fibers=1000, beads=20, repeats=3, quick=False) -> dict:
    """All measurements, quick without the long ones; on one thread except where two are compared."""
    threads = available()
    soft = VISCOSITY * 0.1**4 / 0.01  # eq. (10) allows the step of 0.01
    cases = {
        "ab3": (fibers, beads, soft, 200, {"integrator": "ab3"}),
        "implicit": (fibers, beads, soft * 100, 60, {"integrator": "implicit"}),
        "rpy ab3, N = 6": (fibers, 6, soft, 60, {"integrator": "ab3", "mobility": "rpy"}),
        "rpy implicit, N = 6": (fibers, 6, soft * 100, 30, {"integrator": "implicit", "mobility": "rpy"}),
    }
    for n in (50, 100, 200):
        cases[f"ab3, N = {n}"] = (fibers * 20 // n, n, soft, 100, {"integrator": "ab3"})
        cases[f"implicit, N = {n}"] = (fibers * 20 // n, n, soft * 100, 30, {"integrator": "implicit"})
    if not quick:
        cases["ab3, 10000 fibers"] = (10_000, beads, soft, 20, {"integrator": "ab3"})
        cases["ab3, 100000 fibers"] = (100_000, beads, soft, 5, {"integrator": "ab3"})
    result = {"speed": {}, "threads": {}}
    with limited_to(1):
        for name, (count, n, stiffness, steps, options) in cases.items():
            case = bent_fibers(count, n, stiffness)
            simulate(case, TaylorGreen(np.pi, 0.1), 0.01, 0.05, **options)  # compiles
            result["speed"][name] = bead_steps(case, 0.01, steps, repeats, **options)
        result["accuracy"] = time_to_accuracy()
    if threads > 1:
        for name in ("ab3", "implicit"):
            count, n, stiffness, steps, options = cases[name]
            case = bent_fibers(count, n, stiffness)
            rates = []
            for number in (1, 2):
                with limited_to(number):
                    row = bead_steps(case, 0.01, steps, repeats, time.perf_counter, **options)
                rates.append(row["bead_steps_per_second"])
            result["threads"][name] = rates[1] / rates[0]
    return result


def rows(result: dict) -> list[dict]:
    """The lines of a CSV file."""
    found = [{"case": name, "threads": 1} | row for name, row in result["speed"].items()]
    found += [{"case": name, "two_threads_over_one": ratio} for name, ratio in result["threads"].items()]
    return found + [{"case": name} | row for name, row in result["accuracy"].items()]


def table(result) -> str:
    """The result of run as text."""
    lines = [f"{'case (one thread)':34s} {'M bead-steps/s':>14s} {'sampling':>9s} {'refined':>8s}"]
    for name, row in result["speed"].items():
        speed = row["bead_steps_per_second"] / 1e6
        lines.append(f"{name:34s} {speed:14.1f} {row['sampling_share']:9.0%} {row['refined']:8.1%}")
    for name, ratio in result["threads"].items():
        lines.append(f"{name + ', two threads over one':34s} {ratio:14.2f}")
    lines.append(f"{'time to accuracy, stiff fibers':34s} {'seconds':>14s} {'error/L':>9s}")
    for name, row in result.get("accuracy", {}).items():
        lines.append(f"{name:34s} {row['seconds']:14.4f} {row['error_over_length']:9.1e}")
    return "\n".join(lines)
