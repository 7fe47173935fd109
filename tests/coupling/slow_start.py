"""The real daemon, slow to start: `slow_start.py CASE SECONDS` takes so long to prepare its kernels."""

import logging
import sys
import time

from gbm_plugin.coupling import daemon

logging.basicConfig(level=logging.INFO)
daemon.prepare_kernels = lambda families, feedback: time.sleep(float(sys.argv[2]))
daemon.serve(sys.argv[1])
