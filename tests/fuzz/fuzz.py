"""Altered files, and what their reading comes to:   python tests/fuzz/fuzz.py [--inputs 600] [--seed 1]

Each is read in another process, which has some seconds and a gigabyte for it. It may be accepted, where it is still
valid, or refused in one line; a traceback, a crash, a hang or a hunger for memory is a failure.
"""

from __future__ import annotations

import argparse
import collections
import faulthandler
import json
import resource
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path
from random import Random

SECONDS, MEMORY = 30, 1 << 30  # for one file
ACCEPTED, REFUSED = "accepted", "refused"
FINE = (ACCEPTED, REFUSED)


def fuzz(inputs: int, seed: int) -> list[dict]:
    """Outcomes, each with the kind of file, how it was altered and what was said."""
    found: list[dict] = []
    while len(found) < inputs:
        argv = [
            sys.executable,
            __file__,
            "--worker",
            str(len(found)),
            "--inputs",
            str(inputs),
            "--seed",
            str(seed),
        ]
        worker = subprocess.run(argv, capture_output=True, text=True)
        lines = [json.loads(line) for line in worker.stdout.splitlines() if line.startswith("{")]
        done = [line for line in lines if "outcome" in line]
        found += done
        if worker.returncode == 0 and done:
            continue
        if not lines or "outcome" in lines[-1]:
            raise RuntimeError(f"the worker fails between two readings:\n{worker.stderr[-3000:]}")
        last = lines[-1]  # what it was about when it died
        outcome = "hang" if "Timeout" in worker.stderr else f"crash ({worker.returncode})"
        found.append(last | {"outcome": outcome, "text": worker.stderr[-300:]})
    return found


def _work(first: int, inputs: int, seed: int) -> None:
    """Read the inputs from this one on, a line for each before and after."""
    from gbm_plugin.cli import EXPECTED

    from targets import TARGETS

    with tempfile.TemporaryDirectory() as folder:
        originals = {}
        for target in TARGETS:
            path = target.make(Path(folder) / "original" / target.name)
            target.read(path)  # warm, and valid
            originals[target.name] = path
        virtual = int(Path("/proc/self/statm").read_text().split()[0]) * resource.getpagesize()
        resource.setrlimit(resource.RLIMIT_AS, (virtual + MEMORY, virtual + MEMORY))
        for number in range(first, inputs):
            target = TARGETS[number % len(TARGETS)]
            random = Random(f"{seed} {number}")
            source = Path(folder) / "original" / target.name
            copy = Path(folder) / "altered"
            shutil.rmtree(copy, ignore_errors=True)
            shutil.copytree(source, copy)
            path = copy / originals[target.name].relative_to(source)
            line = {"number": number, "kind": target.name, "how": target.alter(path, random)}
            print(json.dumps(line), flush=True)
            faulthandler.dump_traceback_later(SECONDS, exit=True)
            try:
                target.read(path)
                line |= {"outcome": ACCEPTED, "text": ""}
            except MemoryError as error:
                line |= {"outcome": "memory", "text": str(error)}
            except Exception as error:
                one_line = isinstance(error, EXPECTED)
                line |= {
                    "outcome": REFUSED if one_line else "traceback",
                    "text": f"{type(error).__name__}: {error}",
                }
            faulthandler.cancel_dump_traceback_later()
            print(json.dumps(line), flush=True)


def table(found: list[dict]) -> str:
    """Counts by kind of file and outcome."""
    outcomes = list(dict.fromkeys([*FINE, *(line["outcome"] for line in found)]))
    lines = [f"{'':<16}" + "".join(f"{o:>14}" for o in outcomes)]
    for kind in dict.fromkeys(line["kind"] for line in found):
        count = collections.Counter(line["outcome"] for line in found if line["kind"] == kind)
        lines.append(f"{kind:<16}" + "".join(f"{count[o]:>14}" for o in outcomes))
    return "\n".join(lines)


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--inputs", type=int, default=600)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--all", action="store_true", help="also say what was refused, and how")
    parser.add_argument("--worker", type=int, help=argparse.SUPPRESS)
    arguments = parser.parse_args()
    if arguments.worker is not None:
        _work(arguments.worker, arguments.inputs, arguments.seed)
        return 0
    found = fuzz(arguments.inputs, arguments.seed)
    for line in found:
        if arguments.all or line["outcome"] not in FINE:
            print("{number} {kind}: {how}: {outcome}: {text}".format(**line))
    print(table(found))
    return any(line["outcome"] not in FINE for line in found)


if __name__ == "__main__":
    sys.exit(main())
