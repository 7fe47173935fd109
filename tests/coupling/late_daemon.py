"""The real daemon, late on purpose: `late_daemon.py CASE LOG AHEAD LAST` holds the positions of each step back until
the solver with this log has solved AHEAD steps more than the samples are of, or all up to LAST."""

import sys
import time
from pathlib import Path

from gbm_plugin.coupling import daemon
from gbm_plugin.fleet import fleet

CASE, LOG = map(Path, sys.argv[1:3])
AHEAD, LAST = map(int, sys.argv[3:])


class LateFleet(fleet.Fleet):
    step = 0

    def advance(self, time_step: float) -> None:
        super().advance(time_step)
        steps = min(self.step + AHEAD, LAST)
        while LOG.read_text().count("ExecutionTime") < steps:
            time.sleep(0.001)
        self.step += 1


daemon.Fleet = LateFleet
daemon.serve(CASE)
