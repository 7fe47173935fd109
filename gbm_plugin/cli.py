"""The command line, `gbm`. Exit codes: 0 done, 1 a failure that is named in one line, 2 wrong usage."""

from __future__ import annotations

import argparse
import json
import logging
import signal
import sys
from pathlib import Path

from . import __version__


def main(argv: list[str] | None = None) -> int:
    parser = _parser()
    arguments = parser.parse_args(argv)
    logging.basicConfig(level=logging.WARNING, format="%(message)s", stream=sys.stdout)
    logging.getLogger("gbm_plugin").setLevel(logging.INFO)  # and not what libraries have to say
    try:
        from .coupling.channel import CouplingError
        from .run import RunError

        expected = (ValueError, CouplingError, RunError, OSError, FloatingPointError)
        result = arguments.action(arguments)
    except MemoryError as error:
        return _failed(arguments.command, f"not enough memory: {error}")
    except KeyboardInterrupt:
        return _failed(arguments.command, "stopped on request")
    except Exception as error:
        if not isinstance(error, expected):
            raise
        return _failed(arguments.command, str(error))
    if result is not None and getattr(arguments, "json", None):
        Path(arguments.json).write_text(json.dumps(result, indent=2) + "\n")
    return 0


def _failed(command: str, problem: str) -> int:
    """One line, whatever the problem's text is."""
    print(f"gbm {command}: {' '.join(problem.split())}", file=sys.stderr)
    return 1


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(prog="gbm", description="Long flexible fibers in turbulence, in OpenFOAM.")
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
    sub.add_argument("--fresh", action="store_true", help="from the beginning; earlier results go to previous/<n>")

    sub = add("daemon", _daemon, "Move the fibers of a case for a solver that is started by hand.")
    add_case(sub)

    sub = add("report", _report, "Write figures, tables and ParaView files of a run into CASE/report.")
    add_case(sub)
    _add_json(sub)

    sub = add("info", _info, "Say what a case contains and whether the fiber model holds in it. SI units.")
    add_case(sub)
    _add_json(sub)
    return parser


def _add_json(sub: argparse.ArgumentParser) -> None:
    sub.add_argument("--json", metavar="FILE", help="also write the figures to FILE, as JSON")


def _run(arguments) -> None:
    from .run import run

    signal.signal(signal.SIGTERM, signal.default_int_handler)  # as Ctrl-C, until the run has its own way
    run(arguments.case, parallel=arguments.parallel, fresh=arguments.fresh)


def _daemon(arguments) -> None:
    from .coupling.daemon import serve

    serve(arguments.case)


def _report(arguments) -> dict:
    from .output.report import report

    return report(Path(arguments.case))


def _info(arguments) -> dict:
    from .case.info import describe, figures
    from .case.scene import read_scene

    result = figures(read_scene(arguments.case))
    print(describe(result))
    return result


if __name__ == "__main__":
    sys.exit(main())
