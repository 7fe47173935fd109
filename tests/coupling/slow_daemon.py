"""The real daemon, made slower: `slow_daemon.py CASE SECONDS` sleeps that long in every advance."""

import sys
import time

from gbm_plugin.coupling import daemon
from gbm_plugin.fleet import fleet


class SlowFleet(fleet.Fleet):
    def advance(self, time_step: float) -> None:
        super().advance(time_step)
        time.sleep(float(sys.argv[2]))


daemon.Fleet = SlowFleet
daemon.serve(sys.argv[1])
