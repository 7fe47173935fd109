"""The signals that ask a run to end, without a run."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time

import pytest

from gbm_plugin.signals import ASKS, TELL, Asked, handled, kept_from_children


@pytest.mark.parametrize("number", ASKS, ids=lambda n: signal.Signals(n).name)
def test_each_asks_once_and_a_second_time_means_at_once(number):
    asked = Asked()
    earlier = signal.getsignal(number)
    with handled(asked.note):
        assert not asked
        os.kill(os.getpid(), number)
        assert asked and not asked.again
        os.kill(os.getpid(), number)
        assert asked.again == (number != TELL)  # from a queue and from `gbm run`: no second wish
    assert signal.getsignal(number) is earlier


def test_two_different_signals_are_one_wish():
    """A queue sends USR1 before the end of a job, and TERM at it."""
    asked = Asked()
    with handled(asked.note):
        os.kill(os.getpid(), signal.SIGUSR1)
        os.kill(os.getpid(), signal.SIGTERM)
    assert asked and not asked.again


def test_nohup_is_respected():
    earlier = signal.signal(signal.SIGHUP, signal.SIG_IGN)
    try:
        with handled(lambda number: pytest.fail("SIGHUP was not ignored")):
            os.kill(os.getpid(), signal.SIGHUP)
    finally:
        signal.signal(signal.SIGHUP, earlier)


SLEEPER = "import time; print('here', flush=True); time.sleep(60)"
LISTENER = """
from gbm_plugin.signals import Asked, handled
import sys, time
print('here', flush=True); sys.stdin.readline()
asked = Asked()
with handled(asked.note):
    sys.exit(5 if asked else 1)
"""


@pytest.mark.parametrize("number", [signal.SIGTERM, signal.SIGUSR1, signal.SIGHUP])
def test_a_program_that_was_started_so_does_not_hear_them(number):
    with kept_from_children():
        child = subprocess.Popen([sys.executable, "-c", SLEEPER], stdout=subprocess.PIPE)
    try:
        assert child.stdout.readline()
        child.send_signal(number)
        time.sleep(0.2)
        assert child.poll() is None
    finally:
        child.kill()
        child.wait()


def test_what_comes_before_a_daemon_can_answer_is_not_lost():
    with kept_from_children():
        child = subprocess.Popen(
            [sys.executable, "-c", LISTENER], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True
        )
    assert child.stdout.readline()
    child.send_signal(TELL)
    child.communicate("go\n", timeout=60)
    assert child.returncode == 5
