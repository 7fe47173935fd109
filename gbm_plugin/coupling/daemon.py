"""The fiber daemon: moves a case's fibers while OpenFOAM solves the flow, one sample of it per step.

After the sample of step n it advances the fibers to step n + 1 with what it knows (the history of the flow
along each bead's path), sends the new positions and waits; OpenFOAM meanwhile solves step n + 1. Only the
first steps, whose history is too short, are corrected with a second sample (`provisional`).
"""

from __future__ import annotations

import contextlib
import logging
import threading
import time as clock
from collections.abc import Iterator
from pathlib import Path

import numpy as np

from ..case.layout import cause_file, fiber_state, find_state, log_file, results, states
from ..case.lock import DAEMON, locked
from ..case.scene import Scene, read_scene
from ..case.share import Share
from ..case.trust import check_case
from ..errors import CaseError, CouplingError, StateError, Stopped, one_line
from ..files import write_text
from ..fleet.fleet import Fleet, prepare_kernels
from ..fleet.journal import Journal
from ..signals import Asked, handled
from .channel import Channel
from .listen import listen
from .message import (
    KEEP,
    PROVISIONAL,
    STOP,
    Hello,
    Kind,
    Message,
    ProtocolError,
    decode_folder,
    decode_sample,
    encode_array,
    encode_welcome,
    sample_size,
)

log = logging.getLogger(__name__)

WAIT_INTERVAL = 2.0  # between words to a solver that waits for WELCOME [s]; shorter than any timeout of use


def serve(case: Path | str, number: int | None = None) -> None:
    """Serve one run of the solver in `case`, then return.

    number: which daemon this is, 1..., where the case has several that share the fibers. Raises CaseError for
    mistakes in the case, CouplingError where the solver fails, FloatingPointError for a value that is not finite,
    OSError where a recording cannot be written.
    """
    case = Path(case).resolve()
    scene = read_scene(case)
    check_case(case)
    share = _share(scene, number)
    scene = scene.part(share)
    stop = Asked()
    solver_log = log_file(case, scene.application)
    with (
        handled(lambda number: _note(stop, number)),
        locked(case, share.name(DAEMON)),
        _leaving_its_cause(cause_file(case, share)),
        listen(case, scene.coupling, solver_log, share) as listener,
    ):
        log.info("waiting for OpenFOAM (%s)", scene.coupling.transport)
        if (greeted := listener.greet(give_up=lambda: bool(stop))) is None:
            raise Stopped("stopped before OpenFOAM came")
        channel, *first = greeted
        try:
            Session(scene, share, channel, stop).run(*first)
        except Exception as error:
            channel.say_why(str(error))
            raise
        finally:
            late = channel.close()
        if late:
            raise channel.error(f"END is followed by {late} bytes: what is recorded is kept")


def _share(scene: Scene, number: int | None) -> Share:
    daemons = scene.coupling.daemons
    if number is None and daemons > 1:
        raise CaseError(
            f"{daemons} daemons share the fibers of {scene.case}: say which this is, --share 1 ... {daemons}"
        )
    if number is not None and not 1 <= number <= daemons:
        raise CaseError(
            f"--share {number}: {scene.case}/constant/fiberProperties has daemons {daemons}; allowed: 1 ... {daemons}"
        )
    return Share(number or 1, daemons)


@contextlib.contextmanager
def _leaving_its_cause(path: Path) -> Iterator[None]:
    """Of a daemon that fails, in a file for whoever started it."""
    path.unlink(missing_ok=True)
    try:
        yield
    except Stopped:
        raise
    except Exception as error:
        with contextlib.suppress(OSError):  # a full disk may be the cause
            write_text(path, one_line(error) + "\n")
        raise


def _note(stop: Asked, number: int) -> None:
    """The run then ends after its next step, with everything written; the same signal once more ends it at once."""
    stop.note(number)
    if stop.again:
        raise CouplingError("stopped by a second signal; what is recorded is kept")


@contextlib.contextmanager
def _patience(channel: Channel, first: Message) -> Iterator[None]:
    """What is done inside may take longer than the solver's patience: now and then it is told to wait."""
    done = threading.Event()

    def tell() -> None:
        while not done.wait(WAIT_INTERVAL):
            with contextlib.suppress(CouplingError):  # of a solver that is gone the next message tells
                text = b"the daemon prepares its kernels and fibers"
                channel.send(Message(Kind.WAIT, first.step, first.time, text))

    teller = threading.Thread(target=tell, name="patience")
    teller.start()
    try:
        yield
    finally:
        done.set()
        teller.join()


class Session:
    """One run of the solver, from HELLO to GOODBYE."""

    def __init__(self, scene: Scene, share: Share, channel: Channel, stop: Asked):
        self.scene = scene
        self.share = share
        self.channel = channel
        self.stop = stop

    def run(self, first: Message, hello: Hello) -> None:
        self._check(hello)
        self.step, self.time = first.step, first.time
        self.time_step = hello.time_step
        with _patience(self.channel, first):
            prepare_kernels(self.scene.families, self.scene.coupling.feedback)
            self.fleet = self._fibers(hello)
        self.journal = Journal(
            self.scene,
            self.fleet,
            results(self.scene.case) / Path(hello.folder).name,
            origin=hello.box_min,
            box=np.subtract(hello.box_max, hello.box_min),
            share=self.share,
            state=find_state(self.scene.case, hello.folder),
        )
        welcome = encode_welcome(self.fleet.need, self.scene.coupling.feedback, self.fleet.sizes)
        self.channel.send(Message(Kind.WELCOME, self.step, self.time, welcome))
        try:
            self._observe()
            while self._next_step():
                pass
        finally:
            self.journal.close()

    def _receive(self, *kinds: Kind) -> Message:
        message = self.channel.receive(sample_size(self.fleet.beads, self.fleet.need))
        if message.kind not in kinds:
            expected = " or ".join(k.name for k in kinds)
            raise self.channel.error(f"received {message.kind.name} where {expected} must come")
        return message

    def _check(self, hello: Hello) -> None:
        """Compare what OpenFOAM runs with to the case that this daemon read."""
        if hello.share != self.share:
            raise self.channel.error(
                f"OpenFOAM takes this for {hello.share}, and it is {self.share}: the entry 'daemons' of "
                f"{self.scene.case}/constant/fiberProperties was edited in between"
            )
        pairs = [
            ("nu", hello.viscosity, self.scene.kinematic_viscosity),
            ("deltaT", hello.time_step, self.scene.time_step),
        ]
        if self.scene.box is not None:
            pairs += zip(
                ("box length in x", "box length in y", "box length in z"),
                np.subtract(hello.box_max, hello.box_min),
                self.scene.box,
                strict=True,
            )
        for name, theirs, ours in pairs:
            if abs(theirs - ours) > 1e-6 * abs(ours):
                raise self.channel.error(
                    f"OpenFOAM runs with {name} = {theirs:g}, the case {self.scene.case} says {ours:g}: "
                    "daemon and solver are not on the same case, or it was edited in between"
                )

    def _fibers(self, hello: Hello) -> Fleet:
        """New fibers, or those of the time folder that OpenFOAM starts from."""
        fleet = Fleet.seeded(self.scene, hello.box_min, hello.box_max, self.time, self.share)
        folder = find_state(self.scene.case, hello.folder)
        if folder is None:
            earlier = sorted(t for t in states(self.scene.case) if t < self.time)
            if earlier:
                raise StateError(
                    f"time {self.time:g} has no complete fiber state (killed while writing?); there are "
                    f"states at {', '.join(f'{t:g}' for t in earlier)}: start from one of these "
                    "('gbm run' does), or remove them all to begin with new fibers"
                )
            log.info("time %g: %d beads of new fibers", self.time, fleet.beads)
        else:
            fleet.restore(folder)
            if abs(fleet.time - self.time) > 1e-6 * self.time_step:
                raise StateError(f"the fiber state in {folder} is of time {fleet.time:g}, not {self.time:g}")
            self.time = fleet.time
            log.info("time %g: fibers continue from %s", self.time, fiber_state(folder)[0])
        return fleet

    def _send_positions(self) -> None:
        flags = (PROVISIONAL if self.fleet.provisional else 0) | (STOP if self.stop else 0)
        payload = encode_array(self.fleet.positions)
        # when it begins: what no buffer holds waits there until the solver reads it
        self.sent_at = clock.time()
        self.channel.send(Message(Kind.POSITIONS, self.step, self.time, payload, flags))

    def _observe(self) -> bool:
        """Send the positions of this step until their sample is final; False where OpenFOAM ends instead."""
        while True:
            self._send_positions()
            message = self._receive(Kind.SAMPLE, Kind.END)
            if message.kind is Kind.END:
                self._check_step(message, self.step - 1, self.time - self.time_step)
                self._goodbye(message)
                return False
            self._check_step(message, self.step, self.time)
            try:
                arrived_at = clock.time()
                velocity, extra = decode_sample(message, self.fleet.beads, self.fleet.need)
            except ProtocolError as error:
                raise self.channel.error(str(error)) from None
            if not self.journal.take(self.step, velocity, extra, self.sent_at, arrived_at):
                continue
            if (reaction := self.journal.reaction) is not None:
                loads = encode_array(np.stack([reaction.force, reaction.torque]))
                self.channel.send(Message(Kind.FORCES, self.step, self.time, loads))
            if message.flags & KEEP:
                self._save()
            return True

    def _save(self) -> None:
        """Keep this step's state where OpenFOAM has written its fields by now."""
        message = self._receive(Kind.SAVE)
        self._check_step(message, self.step, self.time)
        try:
            folder = decode_folder(message.payload)
        except ProtocolError as error:
            raise self.channel.error(str(error)) from None
        self.journal.save(self.scene.case / folder, self.step, self.time)

    def _check_step(self, message: Message, step: int, time: float) -> None:
        if message.step != step or abs(message.time - time) > 1e-6 * self.time_step:
            raise self.channel.error(
                f"{message.kind.name} is of step {message.step}, time {message.time:g}; "
                f"step {step}, time {time:g} must come"
            )

    def _next_step(self) -> bool:
        self.fleet.advance(self.time_step)
        self.step += 1
        self.time = self.fleet.time
        return self._observe()

    def _goodbye(self, end: Message) -> None:
        if end.payload:
            raise self.channel.error(
                f"END of step {end.step} has {len(end.payload)} bytes, and must be empty"
            )
        self.channel.send(Message(Kind.GOODBYE, end.step, end.time))
        log.info("time %g: OpenFOAM ended the run; recorded in %s", end.time, self.journal.recorder.path)
