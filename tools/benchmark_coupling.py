"""What the coupling costs on several ranks and with several daemons, beside a model of it.

    python tools/benchmark_coupling.py CASE [--cells 64] [--json FILE]

Constants, nanoseconds per bead of sampling, finding, sending and of a daemon's step, come from one rank with one
daemon and two numbers of fibers; the model then predicts the other runs:

    coupling = fixed + B (location + sending)/H + B sampling/R      H = min(daemons, ranks) ranks serve daemons
    daemon   = fixed + B daemon/D
    step     = flow + coupling + max(0, daemon - flow)

with B beads, R ranks, D daemons, and flow, the step without fibers' cost, as measured with few fibers on R ranks. A
daemon is a bottleneck from B = D (flow - fixed)/daemon on. Where processes outnumber cores they share these, which the
model does not know.
"""

from __future__ import annotations

import argparse
import json
from pathlib import Path

from gbm_plugin.studies.bench.coupling import run

BEADS = 20
FEW, MANY = 1000, 20_000  # fibers


def measure(case: Path, cells: int, fibers: int, ranks: int, daemons: int, turns: int) -> dict:
    """The turn with the shortest step."""
    runs = [run(case, cells, fibers, BEADS, 20, ranks=ranks, daemons=daemons) for _ in range(turns)]
    return min(runs, key=lambda r: r["step"])


def constants(few: dict, many: dict) -> dict[str, tuple[float, float]]:
    """Fixed seconds and seconds per bead of each part, from two runs on one rank."""
    beads = [r["fibers"] * r["beads"] for r in (few, many)]
    result = {}
    for name in ("location", "sampling", "sending", "daemon"):
        slope = max(0.0, (many[name] - few[name]) / (beads[1] - beads[0]))
        result[name] = (max(0.0, few[name] - slope * beads[0]), slope)
    return result


def predict(c: dict, flow: float, beads: int, ranks: int, daemons: int) -> dict[str, float]:
    """Seconds of the coupling, of a daemon, and of the whole step."""
    served = min(ranks, daemons)
    coupling = sum(c[name][0] for name in ("location", "sampling", "sending"))
    coupling += beads * ((c["location"][1] + c["sending"][1]) / served + c["sampling"][1] / ranks)
    daemon = c["daemon"][0] + beads * c["daemon"][1] / daemons
    return {"coupling": coupling, "daemon": daemon, "step": flow + coupling + max(0.0, daemon - flow)}


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("case", type=Path)
    parser.add_argument("--cells", type=int, default=64)
    parser.add_argument(
        "--turns", type=int, default=2, help="of each run, the fastest of which counts (default: 2)"
    )
    parser.add_argument("--json", type=Path, metavar="FILE")
    arguments = parser.parse_args()

    def turn(fibers: int, ranks: int, daemons: int) -> dict:
        return measure(arguments.case, arguments.cells, fibers, ranks, daemons, arguments.turns)

    few = {ranks: turn(FEW, ranks, 1) for ranks in (1, 2, 4)}
    many = {(r, d): turn(MANY, r, d) for r, d in ((1, 1), (1, 2), (2, 1), (2, 2), (4, 1), (4, 2), (4, 4))}
    c = constants(few[1], many[1, 1])
    print("constants, ms and ns per bead:")
    for name, (fixed, slope) in c.items():
        print(f"    {name:<10}{1e3 * fixed:8.2f}{1e9 * slope:8.0f}")
    rows = [*few.values(), *many.values()]
    print("| ranks | daemons | fibers | coupling: ms, model | daemon: ms, model | step: ms, model |")
    print("|---|---|---|---|---|---|")
    for r in rows:
        base = few[r["ranks"]]
        own = sum(base[name] for name in ("wait", "location", "sampling", "sending"))
        p = predict(c, base["step"] - own, r["fibers"] * BEADS, r["ranks"], r["daemons"])
        coupling = sum(r[name] for name in ("location", "sampling", "sending"))
        r["predicted"] = p
        cells = [(coupling, p["coupling"]), (r["daemon"], p["daemon"]), (r["step"], p["step"])]
        text = " | ".join(f"{1e3 * a:.1f}, {1e3 * b:.1f}" for a, b in cells)
        print(f"| {r['ranks']} | {r['daemons']} | {r['fibers']} | {text} |")
    for ranks, r in few.items():
        flow = r["step"] - sum(r[name] for name in ("wait", "location", "sampling", "sending"))
        limit = (flow - c["daemon"][0]) / c["daemon"][1] / BEADS
        print(
            f"{ranks} rank(s): a step of {1e3 * flow:.0f} ms; one daemon keeps up with {limit:.0f} fibers of {BEADS}"
        )
    if arguments.json:
        arguments.json.write_text(json.dumps({"constants": c, "rows": rows}, indent=2) + "\n")


if __name__ == "__main__":
    main()
