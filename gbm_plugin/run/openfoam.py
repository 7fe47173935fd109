"""One scene brought together: the case prepared, solver and daemon started, watched and ended."""

from __future__ import annotations

import logging
import os
import shutil
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from ..case.check import check_forcing, check_mesh, check_openfoam, notes
from ..case.disk import Room
from ..case.layout import FIBERS, cause_file, log_file
from ..case.lock import DAEMON, RUN, locked
from ..case.log import shorten, summary
from ..case.openfoam import command, environment, fatal_message, last_words
from ..case.prepare import prepare, ranks_of, reconstruct
from ..case.scene import Scene, read_scene
from ..case.share import Share, all_shares
from ..case.times import choose_start
from ..case.trust import check_case
from ..errors import RunError, Stopped
from ..files import created
from ..output.restarts import keep_earlier
from ..signals import TELL, Asked, handled, kept_from_children
from .continued import compare
from .progress import Progress, newest_row
from .standstill import Pulse, kill_session, where_it_stands
from .warnings import Warnings
from .words import COMPLETE, closing, opening

log = logging.getLogger(__name__)

STOPPED = "stopped on request; everything is written: the same command continues"
STOPPED_EARLY = "stopped on request before the first step: the same command begins again"
STOPPED_ELSEWHERE = (
    "stopped on request; everything is written: startFrom latestTime in system/controlDict continues it"
)
LOOK = 10.0  # how often the room on the disk is looked at [s]
GRACE = 5.0  # how long one side may outlive the other that failed, before it is ended [s]
FULL = 1 << 20  # a disk with less room may be why OpenFOAM failed [bytes]


def run(case: Path | str, *, parallel: bool = False, fresh: bool = False) -> None:
    """Run a case with OpenFOAM and the fiber daemon to its endTime, continuing an unfinished run.

    parallel: on the ranks of system/decomposeParDict; fresh: from the beginning, earlier results set aside.
    Raises CaseError for a mistake in the case, RunError where a process fails.
    """
    case = Path(case).resolve()
    scene = read_scene(case)
    check_openfoam(scene)
    ranks = ranks_of(case, parallel)
    with _only_run(case) as lock:
        start = choose_start(case, scene.start_time, scene.end_time, scene.time_step, fresh, scene.start_from)
        if start.complete:
            reconstruct(case)
            log.info(COMPLETE, start.time)
            return
        if start.continues:
            compare(scene)
        scene = prepare(scene, start, ranks)
        check_mesh(case)
        check_forcing(scene, f"{start.time:.12g}")
        for note in notes(scene):
            log.info("note: %s", note)
        _remove_addresses(case)
        opening(scene, start.time, f"; see log.{scene.application} and log.gbmDaemon in {case}")
        _Processes(scene, ranks, start.time, lock).run()
        if ranks > 1:
            reconstruct(case)
        closing(scene, case)


def run_spectral(case: Path | str, **options) -> None:
    """Run a case in the pseudo-spectral solver; options as those of `spectral_run.run_spectral`."""
    from .spectral import run_spectral

    _run_here(case, run_spectral, options)


def run_stored(case: Path | str, **options) -> None:
    """Move the fibers of a case through stored fields; options as those of `replay.run_stored`."""
    from .stored import run_stored

    _run_here(case, run_stored, options)


def _run_here(case: Path | str, engine: Callable[..., bool], options: dict) -> None:
    case = Path(case).resolve()
    with _only_run(case):
        if not engine(read_scene(case), **options):
            raise Stopped(STOPPED)


@contextmanager
def _only_run(case: Path) -> Iterator[int]:
    """Two runs never write into one case, nor one beside a daemon that was started by hand. Yields the lock,
    which solver and daemon hold too: should this process be killed, the next run is refused until they have ended."""
    check_case(case)
    with locked(case, RUN) as lock:
        for file in case.glob(f".gbm.{DAEMON}*.lock"):
            with locked(case, file.name.removeprefix(".gbm.").removesuffix(".lock")):
                pass
        yield lock


def _remove_addresses(case: Path) -> None:
    """Addresses that killed daemons left."""
    for pattern in ("gbm*.tcp", "exchange*/session"):
        for path in case.glob(pattern):
            path.unlink()


class _Daemon:
    """One daemon of a run: its process and its log."""

    def __init__(self, case: Path, share: Share):
        self.case, self.share = case, share
        self.log = log_file(case, share.name("gbmDaemon"))
        # -P: not a folder gbm_plugin that happens to be here
        self.argv = [sys.executable, "-P", "-m", "gbm_plugin.cli", "daemon", str(case)]
        if share.of > 1:
            self.argv += ["--share", str(share.number)]
        self.process: subprocess.Popen | None = None

    def ask_to_stop(self) -> None:
        """It then asks OpenFOAM to write and end."""
        if self.process is not None and self.process.poll() is None:
            self.process.send_signal(TELL)

    def cause(self) -> str | None:
        """Why it failed, as it left it."""
        file = cause_file(self.case, self.share)
        return file.read_text().strip() if file.is_file() else None


class _Processes:
    """The solver and the daemons of a run."""

    def __init__(self, scene: Scene, ranks: int, start_time: float, lock: int):
        self.scene = scene
        self.case = scene.case
        self.ranks = ranks
        self.start_time = start_time
        self.daemons = [_Daemon(self.case, share) for share in all_shares(scene.coupling.daemons)]
        self.solver_log = log_file(self.case, scene.application)
        self.lock = lock
        self._room, self._next_look = Room(scene), 0.0
        self.solver: subprocess.Popen | None = None
        self.stopping = Asked()
        self.ended_here: set[subprocess.Popen] = set()  # by this process, after another one's end
        self.standstill = ""  # what was seen of a run that made no step

    def run(self) -> None:
        # in sessions of their own: Ctrl-C reaches this process alone, which then ends all in order
        solver = command(self.scene.application, self.case, self.ranks)
        # the cores that the solver leaves; one that they share, if it leaves none
        cores = max(1, (len(os.sched_getaffinity(0)) - self.ranks) // len(self.daemons))
        with handled(self._stop):
            try:
                for daemon in self.daemons:
                    cause_file(self.case, daemon.share).unlink(missing_ok=True)
                    daemon.process = self._start(daemon.argv, daemon.log, NUMBA_NUM_THREADS=str(cores))
                if not self.stopping:
                    self.solver = self._start(solver, self.solver_log)
                self._watch()
            finally:
                for daemon in self.daemons:
                    self._end(daemon)
                self._kill_solver()
        self._judge()

    def _start(self, argv: list[str], log_file: Path, **variables: str) -> subprocess.Popen:
        keep_earlier(log_file)
        # a queue asks all processes of a job: daemons answer when they can, and tell the solver, which never listens
        with created(log_file, "a") as output, kept_from_children():  # which `shorten` may cut
            return subprocess.Popen(
                argv,
                env=environment() | variables,
                stdin=subprocess.DEVNULL,
                stdout=output,
                stderr=subprocess.STDOUT,
                start_new_session=True,
                pass_fds=(self.lock,),
            )

    def _end(self, daemon: _Daemon) -> None:
        """The daemon and all that it started are gone when this returns."""
        if daemon.process is None:
            return
        if daemon.process.poll() is None:
            self.ended_here.add(daemon.process)
            daemon.ask_to_stop()
            with suppress(subprocess.TimeoutExpired):  # where it hangs, or was stopped
                daemon.process.wait(3)
        kill_session(daemon.process.pid)
        daemon.process.wait()

    def _kill_solver(self) -> None:
        """With all its ranks, at once: it does not listen to anything gentler."""
        if self.solver is None:
            return
        if self.solver.poll() is None:
            self.ended_here.add(self.solver)
        kill_session(self.solver.pid)
        self.solver.wait()

    def _stop(self, number: int) -> None:
        first = not self.stopping
        self.stopping.note(number)
        if first:
            log.info("stopping: the flow is written after the step under way (once more: at once)")
            for daemon in self.daemons:
                daemon.ask_to_stop()
        elif self.stopping.again and self.solver is not None:
            kill_session(self.solver.pid)

    def _watch(self) -> None:
        """Until all have ended, one has outlived another for too long, or none makes a step any more."""
        if self.solver is None:
            return
        everyone = [self.solver, *(d.process for d in self.daemons)]
        warnings = Warnings(self.case)
        pulse = Pulse(self.case, [self.solver_log, *(d.log for d in self.daemons)])
        limit = self.scene.coupling.timeout + GRACE  # who waits for another knows more, and gives up first
        alone_since = None
        with Progress(self.scene, self.start_time) as progress:
            while any(process.poll() is None for process in everyone):
                time.sleep(0.1)
                progress.update()
                shorten(self.solver_log)
                self._look_after_room()
                for line in warnings.news():
                    log.warning("%s", line)
                if all(process.poll() is None for process in everyone):
                    if pulse.silence() > limit:
                        self.standstill = self._where_all_stand(limit)
                        break
                    continue
                if alone_since is None:
                    alone_since = time.monotonic()
                    failed = any(process.poll() for process in everyone)
                    grace = GRACE if failed else self.scene.coupling.timeout
                    if failed:
                        self._dismiss()
                elif time.monotonic() - alone_since > grace:
                    break
            progress.update()
        for line in warnings.news():
            log.warning("%s", line)

    def _look_after_room(self) -> None:
        if time.monotonic() >= self._next_look:
            self._next_look = time.monotonic() + LOOK
            self._room.look(newest_row(self.case, f"{FIBERS}/*/daemon*.dat").get("Time", self.start_time))

    def _where_all_stand(self, seconds: float) -> str:
        sides = [(self.scene.application, self.solver, self.solver_log)]
        sides += [(str(d.share), d.process, d.log) for d in self.daemons]
        stands = "; ".join(where_it_stands(name, process.pid, log) for name, process, log in sides)
        return (
            f"no step for {seconds:g} s ({GRACE:g} s more than the entry timeout of constant/fiberProperties), so "
            f"the run was ended: {stands}"
        )

    def _dismiss(self) -> None:
        """End at once who would only wait for a partner that does not come."""
        if self.solver.poll():
            for daemon in self.daemons:  # one in a session is merely asked for the end
                if daemon.process.poll() is None:
                    self.ended_here.add(daemon.process)
                    daemon.ask_to_stop()
        elif self.stopping and self.solver.poll() is None:
            self._kill_solver()

    def _judge(self) -> None:
        if self.standstill:
            raise RunError(self.standstill)
        if self.solver is None:
            raise Stopped(STOPPED_EARLY)
        solver = self.solver.returncode
        problem = fatal_message(self.solver_log)
        if not any((solver, *(d.process.returncode for d in self.daemons))):
            if self.stopping:
                raise Stopped(STOPPED if self.scene.start_from == "latestTime" else STOPPED_ELSEWHERE)
            log.info("%s: %s", self.scene.application, summary(self.solver_log))
            return
        if self.stopping and not problem:
            raise Stopped("stopped at once; the same command continues from the latest time that is written")
        name = self.scene.application
        causes = []
        # one that was ended here is not the cause
        if solver < 0 and not problem and self.solver not in self.ended_here:
            causes.append(f"{name} was ended by {signal.Signals(-solver).name} ({self.solver_log})")
        if solver > 0 and not problem and self.solver not in self.ended_here:
            said = last_words(self.solver_log)
            causes.append(f"{name} ended with exit code {solver} and said last '{said}' ({self.solver_log})")
        for d in self.daemons:
            if d.process.returncode < 0 and d.process not in self.ended_here:
                ended_by = signal.Signals(-d.process.returncode).name
                causes.append(f"{d.share} was ended by {ended_by} ({d.log})")
        errors = [(error, d.log) for d in self.daemons if (error := d.cause())]
        # where the solver repeats what one of them said, the others only lost the solver
        errors = [(error, file) for error, file in errors if problem and error in problem] or errors
        if not problem or "the daemon stopped:" in problem:
            causes += [f"{error} ({file})" for error, file in errors]
        if problem and not (errors and "the daemon stopped:" in problem):
            causes.append(f"{name}: {problem} ({self.solver_log})")
        if not causes:
            codes = [f"{name} ended with exit code {solver}"]
            codes += [f"{d.share} with {d.process.returncode}" for d in self.daemons]
            logs = [str(self.solver_log), *(str(d.log) for d in self.daemons)]
            causes.append(f"{', '.join(codes)} ({', '.join(logs)})")
        if shutil.disk_usage(self.case).free < FULL:
            causes.append(f"the disk of {self.case} is full")
        raise RunError("; ".join(causes))
