"""OpenFOAM's programs: their environment, their commands, and what their logs say went wrong."""

from __future__ import annotations

import os
import re
import shutil
import subprocess
from pathlib import Path

from ..errors import CaseError, InstallationError, UtilityError
from ..files import created
from .layout import log_file

DEBIAN = Path("/usr/share/openfoam")
PLUGIN = "libgbmPlugin.so"


def _tools() -> tuple[dict[str, str], bool]:
    """Variables for OpenFOAM's own programs, and whether they are of a sourced OpenFOAM: else Debian's package."""
    env = dict(os.environ)
    sourced = "WM_PROJECT_DIR" in env and Path(env["WM_PROJECT_DIR"]) != DEBIAN
    if not sourced:
        if not (DEBIAN / "etc").is_dir():
            raise InstallationError(
                "OpenFOAM is not installed (Debian: the package openfoam), nor is one sourced: run ./Allrun"
            )
        env |= {"WM_PROJECT_DIR": str(DEBIAN), "WM_PROJECT_VERSION": "v1912"}
    version = env.get("WM_PROJECT_VERSION", "v1912")
    if not re.fullmatch(r"v(19[12]\d|2\d\d\d)", version):
        raise InstallationError(
            f"OpenFOAM '{version}' is not supported: openfoam.com v1912 or later is needed "
            "(www.openfoam.com names its releases vYYMM)"
        )
    return env, sourced


def environment() -> dict[str, str]:
    """Variables for OpenFOAM's programs with the plugin: a sourced OpenFOAM as it is, else Debian's package.

    InstallationError where there is no OpenFOAM, or one that is not supported, or the plugin is not built.
    """
    env, sourced = _tools()
    own = Path(__file__).resolve().parents[2] / "build"
    # each OpenFOAM has its own binary interface
    library = Path(env.get("FOAM_USER_LIBBIN", own / "lib")) if sourced else own / "lib"
    programs = Path(env.get("FOAM_USER_APPBIN", own / "bin")) if sourced else own / "bin"
    if not (library / PLUGIN).is_file():
        raise InstallationError(f"the plugin {PLUGIN} is not in {library}: build it with ./Allwmake")
    env["LD_LIBRARY_PATH"] = os.pathsep.join(filter(None, [str(library), env.get("LD_LIBRARY_PATH", "")]))
    env["PATH"] = os.pathsep.join(filter(None, [str(programs), env.get("PATH", "")]))
    if os.geteuid() == 0:
        env |= {"OMPI_ALLOW_RUN_AS_ROOT": "1", "OMPI_ALLOW_RUN_AS_ROOT_CONFIRM": "1"}
    # more ranks than cores: in words that other MPIs pass over, as they would not an option (Open MPI 4, and 5)
    env.setdefault("OMPI_MCA_rmaps_base_oversubscribe", "1")
    env.setdefault("PRTE_MCA_rmaps_default_mapping_policy", ":oversubscribe")
    return env


def expanded(case: Path, dictionary: Path) -> str:
    """A dictionary with its macros and directives carried out by OpenFOAM, every digit kept.

    Code is not run: whatever would compile and load some is refused by OpenFOAM itself. CaseError with its words.
    """
    program = "foamDictionary"
    if shutil.which(program) is None:
        raise InstallationError(
            f"{dictionary} has macros, for which OpenFOAM's '{program}' is needed: not on the PATH"
        )
    argv = [program, "-case", str(case), "-expand", "-precision", "17"]
    argv += ["-info-switch", "allowSystemOperations=0", str(dictionary)]
    done = subprocess.run(argv, env=_tools()[0], stdin=subprocess.DEVNULL, capture_output=True, text=True)
    if done.returncode == 0:
        return done.stdout
    words = done.stdout + done.stderr
    if "dynamicCode" in words:
        raise CaseError(
            f"{dictionary}: #calc or #codeStream in what it includes runs code, which gbm does not"
        )
    raise CaseError(
        f"{dictionary} is not read by OpenFOAM: {fatal_text(words) or f'exit code {done.returncode}'}"
    )


def command(program: str, case: Path, ranks: int = 1) -> list[str]:
    """argv of a program on a case, on this many MPI ranks."""
    if shutil.which(program, path=environment()["PATH"]) is None:
        raise InstallationError(f"the OpenFOAM program '{program}' is not on the PATH")
    argv = [program, "-case", str(case)]
    if ranks > 1:
        # a queue asks all processes of a job to end: the ranks are told by the daemon; mpirun resets what it was given
        deaf = ["sh", "-c", 'trap "" HUP TERM USR1 USR2; exec "$@"', "sh"]
        argv = ["mpirun", "-np", str(ranks), *deaf, *argv, "-parallel"]
    return argv


def utility(case: Path, program: str, *options: str) -> None:
    """Run a utility to its end, its output in `log.<program>`. UtilityError with its own words where it fails."""
    log = log_file(case, program)
    with created(log) as output:
        done = subprocess.run(
            [*command(program, case), *options],
            env=environment(),
            stdout=output,
            stderr=subprocess.STDOUT,
            stdin=subprocess.DEVNULL,
        )
    if done.returncode != 0:
        raise UtilityError(
            f"{program} failed: {fatal_message(log) or f'exit code {done.returncode}'} ({log})"
        )


def fatal_message(log: Path) -> str | None:
    """The text of the first FOAM FATAL ERROR of a log, in one line; None where there is none."""
    return fatal_text(log.read_text(errors="replace")) if log.is_file() else None


def last_words(log: Path, lines: int = 3) -> str:
    """The last lines of a log that say anything, in one."""
    text = log.read_text(errors="replace") if log.is_file() else ""
    said = [line.strip() for line in text.splitlines() if line.strip(" -=*\t")]
    return " ".join(said[-lines:])


def fatal_text(text: str) -> str | None:
    match = re.search(r"--> FOAM FATAL (?:IO )?ERROR[^\n]*\n(.*?)(?:\n\s*\n|\n\s*From |\Z)", text, re.DOTALL)
    if match is None:
        return None
    lines = [re.sub(r"^\[\d+\]\s?", "", line).strip() for line in match.group(1).splitlines()]
    message = " ".join(line for line in lines if line)
    where = re.search(
        r"^(?:\[\d+\]\s)?file: (.+?) (?:from|at) (line \d+)", text[match.end(1) :], re.MULTILINE
    )
    return f"{message} (in {where[1]}, {where[2]})" if where else message
