"""OpenFOAM's programs: their environment, their commands, and what their logs say went wrong."""

from __future__ import annotations

import os
import re
import shutil
import subprocess
from pathlib import Path

from ..errors import InstallationError, UtilityError
from ..files import created
from .layout import log_file

DEBIAN = Path("/usr/share/openfoam")
PLUGIN = "libgbmPlugin.so"


def environment() -> dict[str, str]:
    """Variables for OpenFOAM's programs: a sourced OpenFOAM as it is, else Debian's package.

    InstallationError where there is no OpenFOAM, or one that is not supported, or the plugin is not built.
    """
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
    own = Path(__file__).resolve().parents[2] / "build/lib"
    library = Path(env.get("FOAM_USER_LIBBIN", own)) if sourced else own  # each has its own binary interface
    if not (library / PLUGIN).is_file():
        raise InstallationError(f"the plugin {PLUGIN} is not in {library}: build it with ./Allwmake")
    env["LD_LIBRARY_PATH"] = os.pathsep.join(filter(None, [str(library), env.get("LD_LIBRARY_PATH", "")]))
    env |= {"OMPI_ALLOW_RUN_AS_ROOT": "1", "OMPI_ALLOW_RUN_AS_ROOT_CONFIRM": "1"}
    return env


def command(program: str, case: Path, ranks: int = 1) -> list[str]:
    """argv of a program on a case, on this many MPI ranks."""
    if shutil.which(program) is None:
        raise InstallationError(f"the OpenFOAM program '{program}' is not on the PATH")
    argv = [program, "-case", str(case)]
    if ranks > 1:
        argv = ["mpirun", "-np", str(ranks), "--oversubscribe", *argv, "-parallel"]
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
    if not log.is_file():
        return None
    text = log.read_text(errors="replace")
    match = re.search(r"--> FOAM FATAL (?:IO )?ERROR[^\n]*\n(.*?)(?:\n\s*\n|\n\s*From |\Z)", text, re.DOTALL)
    if match is None:
        return None
    lines = [re.sub(r"^\[\d+\]\s?", "", line).strip() for line in match.group(1).splitlines()]
    message = " ".join(line for line in lines if line)
    where = re.search(r"^(?:\[\d+\]\s)?file: (.+?) (?:from|at) line", text[match.end(1) :], re.MULTILINE)
    return f"{message} (in {where.group(1)})" if where else message
