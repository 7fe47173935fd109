"""One scene brought together: the case prepared, solver and daemon started, watched and ended."""

from __future__ import annotations

import logging
import os
import shutil
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from .case.dictionary import CaseError
from .case.lock import DAEMON, RUN, locked
from .case.log import summary
from .case.openfoam import command, environment, fatal_message
from .case.prepare import prepare, ranks_of, reconstruct
from .case.scene import Scene, read_scene
from .case.times import choose_start
from .output.progress import Progress
from .output.restarts import keep_earlier

log = logging.getLogger(__name__)

STOPPED = "stopped on request; everything is written: the same command continues"
GRACE = 5.0  # how long one side may outlive the other that failed, before it is ended [s]
FULL = 1 << 20  # a disk with less room may be why OpenFOAM failed [bytes]


class RunError(RuntimeError):
    """A run that did not reach its end: names the cause, the side that failed and its log."""


def run(case: Path | str, *, parallel: bool = False, fresh: bool = False) -> None:
    """Run a case with OpenFOAM and the fiber daemon to its endTime, continuing an unfinished run.

    parallel: on the ranks of system/decomposeParDict; fresh: from the beginning, earlier results set aside.
    Raises CaseError for a mistake in the case, RunError where a process fails.
    """
    case = Path(case).resolve()
    scene = read_scene(case)
    if scene.forcing is not None and scene.forcing.type == "eswaranPope":
        raise CaseError(
            f"{case}/constant/fvOptions: eswaranPope is a forcing of the spectral solver; OpenFOAM has "
            "linearForcing (gbm run --flow spectral runs this case)"
        )
    ranks = ranks_of(case, parallel)
    with _only_run(case) as lock:
        start = choose_start(case, scene.start_time, scene.end_time, scene.time_step, fresh)
        prepare(scene, start, ranks)
        _remove_addresses(case)
        _Pair(scene, ranks, start.time, lock).run()
        if ranks > 1:
            reconstruct(case)


def run_spectral(case: Path | str, **options) -> None:
    """Run a case in the pseudo-spectral solver; options as those of `spectral_run.run_spectral`."""
    from . import spectral_run

    case = Path(case).resolve()
    with _only_run(case):
        if not spectral_run.run_spectral(read_scene(case), **options):
            raise RunError(STOPPED)


@contextmanager
def _only_run(case: Path) -> Iterator[int]:
    """Two runs never write into one case, nor one beside a daemon that was started by hand. Yields the lock,
    which solver and daemon hold too: should this process be killed, the next run is refused until they have ended."""
    with locked(case, RUN) as lock:
        with locked(case, DAEMON):
            pass
        yield lock


def _remove_addresses(case: Path) -> None:
    """Addresses that a killed daemon left."""
    for name in ("gbm.tcp", "exchange/session"):
        (case / name).unlink(missing_ok=True)


class _Pair:
    """The two processes of a run."""

    def __init__(self, scene: Scene, ranks: int, start_time: float, lock: int):
        self.scene = scene
        self.case = scene.case
        self.ranks = ranks
        self.start_time = start_time
        self.daemon_log = self.case / "log.gbmDaemon"
        self.solver_log = self.case / f"log.{scene.application}"
        self.lock = lock
        self.daemon: subprocess.Popen | None = None
        self.solver: subprocess.Popen | None = None
        self.stopping = 0
        self.asked = False  # the daemon, to stop
        self.ended_here: set[subprocess.Popen] = set()  # by this process, after the other side's end

    def run(self) -> None:
        # in sessions of their own: Ctrl-C reaches this process alone, which then ends both in order
        daemon = [sys.executable, "-P", "-m", "gbm_plugin.cli", "daemon", str(self.case)]
        solver = command(self.scene.application, self.case, self.ranks)
        handlers = {n: signal.signal(n, self._stop) for n in (signal.SIGINT, signal.SIGTERM)}
        for path in (self.daemon_log, self.solver_log):
            keep_earlier(path)
        try:
            with self.daemon_log.open("w") as d, self.solver_log.open("w") as s:
                # the cores that the solver leaves; one that they share, if it leaves none
                cores = max(1, len(os.sched_getaffinity(0)) - self.ranks)
                self.daemon = self._start(daemon, d, NUMBA_NUM_THREADS=str(cores))
                if self.stopping:  # before there was a daemon to tell
                    self._ask_to_stop()
                self.solver = self._start(solver, s)
                self._watch()
        finally:
            for number, handler in handlers.items():
                signal.signal(number, handler)
            for process in filter(None, (self.solver, self.daemon)):
                self._end(process)
        self._judge()

    def _start(self, argv: list[str], output, **variables: str) -> subprocess.Popen:
        return subprocess.Popen(
            argv,
            env=environment() | variables,
            stdin=subprocess.DEVNULL,
            stdout=output,
            stderr=subprocess.STDOUT,
            start_new_session=True,
            pass_fds=(self.lock,),
        )

    def _end(self, process: subprocess.Popen) -> None:
        """The process and all that it started are gone when this returns."""
        if process.poll() is None:
            self.ended_here.add(process)
            process.terminate()
            try:
                process.wait(3)
            except subprocess.TimeoutExpired:  # it hangs, or was stopped
                os.killpg(process.pid, signal.SIGKILL)
                process.wait()

    def _stop(self, *_) -> None:
        self.stopping += 1
        if self.stopping == 1:
            log.info("stopping: the flow is written after the step under way (once more: at once)")
            if self.daemon is not None:
                self._ask_to_stop()
        elif self.solver is not None:
            self.solver.terminate()

    def _ask_to_stop(self) -> None:
        """Once: the daemon then asks OpenFOAM to write and end, and a second signal would end it at once."""
        if not self.asked:
            self.asked = True
            self.daemon.terminate()

    def _watch(self) -> None:
        """Until both have ended, or one has outlived the other for too long."""
        alone_since = None
        with Progress(self.scene, self.start_time) as progress:
            while self.solver.poll() is None or self.daemon.poll() is None:
                time.sleep(0.1)
                progress.update()
                if self.solver.poll() is None and self.daemon.poll() is None:
                    continue
                if alone_since is None:
                    alone_since = time.monotonic()
                    failed = (self.solver.poll() or 0) or (self.daemon.poll() or 0)
                    grace = GRACE if failed else self.scene.coupling.timeout
                    if failed:
                        self._dismiss()
                elif time.monotonic() - alone_since > grace:
                    break
            progress.update()

    def _dismiss(self) -> None:
        """End at once who would only wait for a partner that does not come."""
        if self.solver.poll() and self.daemon.poll() is None:  # in a session it merely asks for the end
            self.ended_here.add(self.daemon)
            self.daemon.terminate()
        elif self.stopping and self.solver.poll() is None:
            self.ended_here.add(self.solver)
            self.solver.terminate()

    def _judge(self) -> None:
        solver, daemon = self.solver.returncode, self.daemon.returncode
        problem = fatal_message(self.solver_log)
        if solver == 0 and daemon == 0:
            if self.stopping:
                raise RunError(STOPPED)
            log.info("%s: %s", self.scene.application, summary(self.solver_log))
            return
        if self.stopping and not problem:
            raise RunError("stopped at once; the same command continues from the latest time that is written")
        daemon_problem = _last_error(self.daemon_log)
        name = self.scene.application
        causes = []
        # one that was ended here is not the cause
        if solver < 0 and not problem and self.solver not in self.ended_here:
            causes.append(f"{name} was ended by {signal.Signals(-solver).name} ({self.solver_log})")
        if daemon < 0 and self.daemon not in self.ended_here:
            causes.append(f"the daemon was ended by {signal.Signals(-daemon).name} ({self.daemon_log})")
        if daemon_problem and (not problem or "the daemon stopped:" in problem):
            causes.append(f"{daemon_problem} ({self.daemon_log})")
        elif problem:
            causes.append(f"{name}: {problem} ({self.solver_log})")
        if not causes:
            codes = f"{name} ended with exit code {solver}, the daemon with {daemon}"
            causes.append(f"{codes} ({self.solver_log}, {self.daemon_log})")
        if shutil.disk_usage(self.case).free < FULL:
            causes.append(f"the disk of {self.case} is full")
        raise RunError("; ".join(causes))


def _last_error(path: Path) -> str | None:
    lines = [
        line for line in path.read_text(errors="replace").splitlines() if line.startswith("gbm daemon: ")
    ]
    return lines[-1].removeprefix("gbm daemon: ") if lines else None
