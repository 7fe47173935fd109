"""The command line, `gbm`. Exit codes: 0 done, 1 a failure that is named in one line, 2 wrong usage."""

from __future__ import annotations

import argparse
import csv
import json
import logging
import signal
import sys
from importlib import import_module
from pathlib import Path

from . import __version__
from .errors import GbmError

# what is said in one line: the rest is a fault of the program, with its traceback
EXPECTED = (GbmError, ValueError, OSError, FloatingPointError)

STUDIES = {  # modules of validation/, each with run, table and draw
    "convergence": "errors of flow and fibers as cells and step shrink (default)",
    "schemes": "which of OpenFOAM's schemes have the least error for their time",
    "stationary": "averages of forced turbulence in both engines, with standard errors (20 min)",
    "steady": "fibers in an ABC flow against the analytic one",
    "replay": "distance of fibers in stored fields to the coupled run, by the interval between fields",
}


def main(argv: list[str] | None = None) -> int:
    parser = _parser()
    arguments = parser.parse_args(argv)
    logging.basicConfig(level=logging.WARNING, format="%(message)s", stream=sys.stdout)
    logging.getLogger("gbm_plugin").setLevel(logging.INFO)  # and not what libraries have to say
    try:
        result = arguments.action(arguments)
        if result is not None and getattr(arguments, "json", None):
            Path(arguments.json).write_text(json.dumps(result, indent=2) + "\n")
    except MemoryError as error:
        return _failed(arguments.command, f"not enough memory: {error}")
    except KeyboardInterrupt:
        return _failed(arguments.command, "stopped on request")
    except Exception as error:
        if not isinstance(error, EXPECTED):
            raise
        return _failed(arguments.command, str(error))
    return 0


def _failed(command: str, problem: str) -> int:
    """One line, whatever the problem's text is."""
    print(f"gbm {command}: {' '.join(problem.split())}", file=sys.stderr)
    return 1


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog="gbm", description="Long flexible fibers in turbulence, in OpenFOAM."
    )
    parser.add_argument("--version", action="version", version=f"gbm {__version__}")
    commands = parser.add_subparsers(dest="command", required=True, metavar="COMMAND")

    def add(name: str, action, text: str) -> argparse.ArgumentParser:
        sub = commands.add_parser(name, help=text, description=text)
        sub.set_defaults(action=action)
        return sub

    def add_case(sub: argparse.ArgumentParser) -> None:
        sub.add_argument("case", nargs="?", default=".", help="OpenFOAM case (default: this folder)")

    sub = add("run", _run, "Run a case: flow and fibers, continuing an unfinished run.")
    add_case(sub)
    sub.add_argument("--parallel", action="store_true", help="on the MPI ranks of system/decomposeParDict")
    sub.add_argument(
        "--fresh", action="store_true", help="from the beginning; earlier results go to previous/<n>"
    )
    sub.add_argument(
        "--flow",
        choices=("openfoam", "spectral", "stored"),
        default="openfoam",
        help="OpenFOAM; the pseudo-spectral solver, whose results go to CASE/spectral; or velocity fields that "
        "are stored in the time folders or in --fields, with results in CASE/stored",
    )
    sub.add_argument("--fields", metavar="FILE", help="with stored: an HDF5 file of fields (docs/files.md)")
    sub.add_argument(
        "--in-time",
        choices=("cubic", "linear"),
        help="with stored: interpolation between the times of fields (default: cubic)",
    )
    sub.add_argument("--threads", type=int, default=1, help="of the spectral solver (default: 1)")
    sub.add_argument(
        "--precision", choices=("double", "single"), default="double", help="of the spectral solver"
    )
    sub.add_argument(
        "--device", choices=("cpu", "gpu"), default="cpu", help="of the spectral solver; gpu needs CuPy"
    )

    sub = add("daemon", _daemon, "Move the fibers of a case for a solver that is started by hand.")
    add_case(sub)
    sub.add_argument(
        "--share",
        type=int,
        metavar="K",
        help="which daemon this is, 1 ... daemons, of several that share the fibers",
    )

    sub = add("report", _report, "Write figures, tables and ParaView files of a run into CASE/report.")
    add_case(sub)
    _add_json(sub)

    sub = add("info", _info, "Say what a case contains and whether the fiber model holds in it. SI units.")
    add_case(sub)
    _add_json(sub)
    sub = add("validate", _validate, "Judge OpenFOAM with a case's schemes by the spectral solver.")
    add_case(sub)
    sub.add_argument(
        "--study",
        choices=STUDIES,
        default="convergence",
        help="; ".join(f"{name}: {text}" for name, text in STUDIES.items()),
    )
    sub.add_argument("--cells", type=int, nargs="+", help="in each direction (default: as the study needs)")
    sub.add_argument(
        "--time-step",
        type=float,
        help="of the first mesh; finer ones take it in proportion, those of steady as it is [s]",
    )
    sub.add_argument("--figure", metavar="PNG", help="also draw the result")
    sub.add_argument("--csv", metavar="FILE", help="also write the table, unrounded")
    _add_json(sub)

    sub = add("bench", None, "Measure speed beside error; ratios within one run.")
    kinds = sub.add_subparsers(dest="kind", required=True, metavar="KIND")

    kind = kinds.add_parser("coupling", help="what the coupling costs a step of OpenFOAM")
    kind.set_defaults(action=_bench_coupling)
    add_case(kind)
    kind.add_argument("--cells", type=int, default=64, help="cells in each direction (default: 64)")
    kind.add_argument("--fibers", type=int, default=1000, help="(default: 1000)")
    kind.add_argument("--beads", type=int, default=20, help="of each fiber (default: 20)")
    kind.add_argument("--steps", type=int, default=30, help="(default: 30)")
    kind.add_argument(
        "--transport", choices=("socket", "tcp", "file"), default="socket", help="(default: socket)"
    )
    kind.add_argument("--ranks", type=int, default=1, help="of OpenFOAM, in slabs (default: 1)")
    kind.add_argument("--daemons", type=int, default=1, help="that share the fibers (default: 1)")
    _add_json(kind)

    kind = kinds.add_parser(
        "fibers", help="bead-steps per second of the integrators, and time to an accuracy"
    )
    kind.set_defaults(action=_bench_fibers)
    kind.add_argument("--fibers", type=int, default=1000, help="(default: 1000)")
    kind.add_argument("--beads", type=int, default=20, help="of each fiber (default: 20)")
    kind.add_argument("--quick", action="store_true", help="without the large batches")
    _add_json(kind)

    kind = kinds.add_parser(
        "spectral", help="a right-hand side of the spectral solver, beside fluidsim if there"
    )
    kind.set_defaults(action=_bench_spectral)
    kind.add_argument("--cells", type=int, default=128, help="in each direction (default: 128)")
    kind.add_argument("--threads", type=int, default=1, help="(default: 1)")
    kind.add_argument(
        "--fluidsim", metavar="PYTHON", default=sys.executable, help="interpreter that has fluidsim"
    )
    _add_json(kind)
    return parser


def _add_json(sub: argparse.ArgumentParser) -> None:
    sub.add_argument("--json", metavar="FILE", help="also write the figures to FILE, as JSON")


def _run(arguments) -> None:
    from .run import openfoam as run

    signal.signal(signal.SIGTERM, signal.default_int_handler)  # as Ctrl-C, until the run has its own way
    if arguments.parallel and arguments.flow != "openfoam":
        raise ValueError("--parallel is for OpenFOAM; the spectral solver takes --threads")
    for option in ("fields", "in_time"):
        if getattr(arguments, option) is not None and arguments.flow != "stored":
            raise ValueError(f"--{option.replace('_', '-')} goes with --flow stored")
    if arguments.flow == "openfoam":
        run.run(arguments.case, parallel=arguments.parallel, fresh=arguments.fresh)
    elif arguments.flow == "spectral":
        options = {name: getattr(arguments, name) for name in ("fresh", "threads", "precision", "device")}
        run.run_spectral(arguments.case, **options)
    else:
        in_time = arguments.in_time or "cubic"
        run.run_stored(arguments.case, fresh=arguments.fresh, fields=arguments.fields, in_time=in_time)


def _daemon(arguments) -> None:
    from .coupling.daemon import serve

    serve(arguments.case, arguments.share)


def _report(arguments) -> dict:
    from .report.report import report

    return report(Path(arguments.case))


def _info(arguments) -> dict:
    from .case.info import describe, figures
    from .case.scene import read_scene

    result = figures(read_scene(arguments.case))
    print(describe(result))
    return result


def _validate(arguments) -> dict:
    study = import_module(f".studies.validate.{arguments.study}", __package__)
    given = {name: getattr(arguments, name) for name in ("cells", "time_step")}
    result = study.run(arguments.case, **{name: value for name, value in given.items() if value is not None})
    print(study.table(result))
    if arguments.figure:
        from .report.style import styled

        with styled():
            study.draw(result).savefig(arguments.figure)
    if arguments.csv:
        with open(arguments.csv, "w", newline="") as file:
            rows = result["rows"] + result.get("temporal_rows", [])
            writer = csv.DictWriter(file, list(dict.fromkeys(name for row in rows for name in row)))
            writer.writeheader()
            writer.writerows(rows)
    return result


def _bench_coupling(arguments) -> dict:
    from .studies.bench import coupling

    names = ("cells", "fibers", "beads", "steps", "transport", "ranks", "daemons")
    result = coupling.run(arguments.case, **{name: getattr(arguments, name) for name in names})
    print(coupling.table(result))
    return result


def _bench_fibers(arguments) -> dict:
    from .studies.bench import fibers

    result = fibers.run(arguments.fibers, arguments.beads, quick=arguments.quick)
    print(fibers.table(result))
    return result


def _bench_spectral(arguments) -> dict:
    from .studies.bench import spectral

    result = spectral.run(arguments.cells, arguments.threads, fluidsim_python=arguments.fluidsim)
    print(spectral.table(result))
    return result


if __name__ == "__main__":
    sys.exit(main())
