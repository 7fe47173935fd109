"""What can go wrong for a user, by kind: each says in one line what was found, where, and what is allowed.

The command line prints these and ends with exit code 1; anything else is a fault of the program.
"""

from __future__ import annotations


class GbmError(Exception):
    """Base of all that this package raises for something that its user can mend."""


class CaseError(GbmError, ValueError):
    """A mistake in a case: says the file, the entry, what was given and what is allowed."""


class InstallationError(GbmError):
    """OpenFOAM or the plugin is missing, not supported or not built."""


class UtilityError(GbmError):
    """An OpenFOAM utility failed: its own words, and its log."""


class LockedError(GbmError):
    """Another run or daemon is under way in the case."""


class StateError(GbmError):
    """What a run left in a time folder cannot be continued from: missing, cut off, or of something else."""


class PredictionError(GbmError):
    """The flow at the fibers was not what its history promised: the time step is too long."""


class CouplingError(GbmError):
    """The coupling ended otherwise than agreed: names the cause, the peer and its log."""


class RunError(GbmError):
    """A run that did not reach its end: names the cause, the side that failed and its log."""


class Stopped(RunError):
    """A run that ended before its end because a signal asked for it; what it needs to continue is written."""


def one_line(error: BaseException) -> str:
    """What an error says, as its user reads it."""
    text = f"not enough memory: {error}" if isinstance(error, MemoryError) else str(error)
    return " ".join(text.split()) or type(error).__name__
