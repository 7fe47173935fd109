"""The place where the solver finds the daemon, by the case's word `transport`."""

from __future__ import annotations

from pathlib import Path

from ..case.scene import Coupling
from ..case.share import WHOLE, Share
from .channel import Listener
from .files import FileListener
from .sockets import TcpListener, UnixListener

LISTENERS = {"socket": UnixListener, "tcp": TcpListener, "file": FileListener}


def listen(case: Path, coupling: Coupling, log: Path, share: Share = WHOLE) -> Listener:
    """Open the way that the case names. log: the solver's, for messages; share: whose of the case's daemons."""
    return LISTENERS[coupling.transport](case, coupling, log, share)
