"""The command line, `gbm`. Exit codes: 0 done, 1 a failure that is named in one line, 2 wrong usage, 3 stopped on
request, with all that is needed to continue written."""

from __future__ import annotations

import argparse
import json
import logging
import os
import signal
import sys
import warnings
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

from . import __version__
from .errors import GbmError, Stopped, one_line
from .signals import ASKS

# what is said in one line: the rest is a fault of the program, with its traceback
EXPECTED = (GbmError, ValueError, OSError, FloatingPointError, MemoryError)
DONE, FAILED, USAGE, STOPPED = 0, 1, 2, 3
COMMON = {"action", "command", "study", "csv", "figure", "json", "save"}  # not of a study itself


def main(argv: list[str] | None = None) -> int:
    words = sys.argv[1:] if argv is None else argv
    arguments = _parser(words).parse_args(words)
    logging.basicConfig(level=logging.WARNING, format="%(message)s", handlers=[_Screen(sys.stdout)])
    logging.getLogger("gbm_plugin").setLevel(logging.INFO)  # and not what libraries have to say
    warnings.showwarning = lambda message, *_: logging.warning("%s", message)  # without the line of code
    try:
        result = arguments.action(arguments)
        if result is not None and getattr(arguments, "json", None):
            Path(arguments.json).write_text(json.dumps(result, indent=2) + "\n")
        sys.stdout.flush()
    except BrokenPipeError:  # who read what is printed has gone, as head does
        _to_nowhere(sys.stdout)
        return DONE
    except KeyboardInterrupt:
        return _failed(arguments.command, "stopped on request", STOPPED)
    except Stopped as error:
        return _failed(arguments.command, one_line(error), STOPPED)
    except Exception as error:
        if not isinstance(error, EXPECTED):
            raise
        return _failed(arguments.command, one_line(error))
    return DONE


def _failed(command: str, problem: str, code: int = FAILED) -> int:
    print(f"gbm {command}: {problem}", file=sys.stderr)
    return code


class _Screen(logging.StreamHandler):
    """What is said goes nowhere once nobody reads it: a run does not end for that."""

    def handleError(self, record: logging.LogRecord) -> None:
        if isinstance(sys.exc_info()[1], BrokenPipeError):
            _to_nowhere(self.stream)
        else:
            super().handleError(record)


def _to_nowhere(stream) -> None:
    os.dup2(os.open(os.devnull, os.O_WRONLY), stream.fileno())


def _parser(words: Sequence[str]) -> argparse.ArgumentParser:
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

    sub = add(
        "new", _new, "Make a case of one's own, from the shipped one; without a name, list the presets."
    )
    sub.add_argument("case", nargs="?", help="the new folder")
    sub.add_argument("--preset", default="default", metavar="NAME", help="whose numbers it has")

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

    sub = add(
        "report", _report, "Write figures, tables, ParaView files and a page of a run into CASE/report."
    )
    add_case(sub)
    _add_json(sub)
    sub.add_argument(
        "--quiet", action="store_true", help="without the averages, which a run prints at its end"
    )
    sub.add_argument(
        "--film", action="store_true", help="only a film: report/film/*.png, film.mp4 where ffmpeg is"
    )
    sub.add_argument("--frames", type=int, default=60, help="of the film (default: 60)")
    sub.add_argument("--from", dest="since", type=float, metavar="T", help="start of the film [s]")
    sub.add_argument("--families", nargs="+", default=["*"], metavar="PATTERN", help="that the film shows")
    sub.add_argument("--fibers", type=int, metavar="N", help="of each family in the film")

    sub = add("info", _info, "Say what a case contains and whether the fiber model holds in it. SI units.")
    add_case(sub)
    sub.add_argument(
        "--flow",
        choices=("openfoam", "spectral"),
        default="openfoam",
        help="as of gbm run (default: openfoam)",
    )
    _add_json(sub)
    sub = add("study", _study, "Measure and compare; without a name, the list of studies.")
    if words[:1] == ["study"]:
        _add_studies(sub, words)
    return parser


def _add_json(sub: argparse.ArgumentParser) -> None:
    sub.add_argument("--json", metavar="FILE", help="also write the figures to FILE, as JSON")


def _new(arguments) -> None:
    from .case.new import PRESETS, listing, new_case

    if arguments.case is None:
        print(f"gbm new DIR --preset NAME\n{listing()}")
        return
    case = new_case(arguments.case, arguments.preset)
    print(f"{case}: {PRESETS[arguments.preset].title}")
    print(f"next: gbm info {case}; gbm run {case}")


def _run(arguments) -> None:
    from .run import openfoam as run

    for number in ASKS:  # as Ctrl-C, until the run has its own way
        if signal.getsignal(number) is not signal.SIG_IGN:
            signal.signal(number, signal.default_int_handler)
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


def _film(arguments) -> None:
    from .case.layout import results
    from .case.mesh import read_box
    from .case.trust import check_case
    from .output.recording import open_recording
    from .report.film import write_film
    from .studies.study import steps

    case = Path(arguments.case)
    check_case(case)
    mesh = read_box(case)
    words = {name: getattr(arguments, name) for name in ("frames", "families", "fibers", "since")}
    with open_recording(results(case)) as recording:
        written = write_film(recording, case, mesh and mesh.cells, progress=steps, **words)
    last = written[-1]
    print(f"{len([p for p in written if p.suffix == '.png'])} frames in {written[0].parent}")
    print(f"film: {last}" if last.suffix == ".mp4" else "no film.mp4: ffmpeg is not installed")


def _report(arguments) -> dict | None:
    if arguments.film:
        _film(arguments)
        return None
    from .case.scene import read_scene
    from .fleet.cloud import complete_clouds
    from .report.report import report
    from .report.summary import summary
    from .studies.page import make_page

    result = report(Path(arguments.case))
    try:
        result["clouds"] = complete_clouds(read_scene(arguments.case))
    except (GbmError, ValueError) as error:  # as a dictionary that was edited since
        result["clouds"] = []
        result["not_drawn"].append(f"data of lagrangian/fibers: {error}")
    averages = summary(arguments.case)
    if not arguments.quiet:
        print("\n".join(averages))
    folder = Path(arguments.case) / "report"
    print(f"written to {folder}: {' '.join(result['files'])}")
    for change in result["changes"]:
        print(f"changed at t = {change['time']:g} (dotted in the figures): {', '.join(change['changes'])}")
    for reason in result["not_drawn"]:
        print(f"not drawn: {reason}")
    print(f"all on one page: {make_page(Path(arguments.case), result, averages)}")
    return result


def _info(arguments) -> dict:
    from .case.check import notes
    from .case.info import describe, figures
    from .case.mesh import difference
    from .case.scene import read_scene

    scene = read_scene(arguments.case)
    if arguments.flow == "spectral":
        from .run.spectral import check_spectral

        check_spectral(scene)
        scene = replace(scene, application=arguments.flow)
    result = figures(scene)
    print(describe(result))
    result["notes"] = [*notes(scene, judged=False), *filter(None, [difference(scene.case)])]
    for note in result["notes"]:
        print(f"note: {note}")
    return result


def _add_studies(parser: argparse.ArgumentParser, words: Sequence[str]) -> None:
    """A parser for each study; only those that the command line names are imported for their arguments."""
    from .studies.study import find_studies

    names = parser.add_subparsers(dest="study", metavar="NAME")
    for name, study in find_studies().items():
        sub = names.add_parser(name, help=study.title, description=study.title)
        if name in words:
            study.load().add_arguments(sub)
            sub.add_argument("--csv", metavar="FILE", help="also write the numbers, unrounded")
            sub.add_argument("--figure", metavar="PNG", help="also draw the result")
            _add_json(sub)
            sub.add_argument("--save", metavar="NAME", help="all three: NAME.csv, NAME.json and NAME.png")


def _study(arguments) -> dict | None:
    from .studies.study import draw, find_studies, listing, write, write_csv

    studies = find_studies()
    if arguments.study is None:
        print(listing(studies))
        return None
    study = studies[arguments.study].load()
    options = {name: value for name, value in vars(arguments).items() if name not in COMMON}
    if arguments.figure and not hasattr(study, "draw"):
        raise ValueError(f"--figure: the study {arguments.study} has no picture")
    result = study.run(**options)
    print(study.table(result))
    if arguments.csv:
        write_csv(study, result, arguments.csv)
    if arguments.figure:
        draw(study, result, arguments.figure)
    if arguments.save:
        write(study, result, arguments.save)
    return result


if __name__ == "__main__":
    sys.exit(main())
