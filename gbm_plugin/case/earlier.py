"""The flow of an earlier run of the spectral solver as the beginning of another, as fine or finer.

system/initialFieldDict:

    field   run;
    from    "../coarse";    // its case; a path from this one
    time    20;             // of a time folder there; the latest where it is not said
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from ..arrays import check_arrays, read_arrays
from .dictionary import Dictionary
from .fields import FourierModes
from .layout import FLOW_FILE, SPECTRAL, numbered
from .mesh import read_box

# of the solver's state those that a beginning takes, and those that it leaves: of another time step, or of sums
TAKEN = ("coefficients", "forcing_amplitudes", "forcing_draws")
OTHERS = ("energy", "time", "step", "slope_0", "slope_1", "slope_2", "slope_times", "before")


@dataclass(frozen=True)
class Earlier:
    """The velocity of a run, and the state of its force (empty without one that has any)."""

    path: Path
    modes: FourierModes
    force: dict[str, np.ndarray]


def read_earlier(case: Path, d: Dictionary) -> Earlier:
    """The flow that the entries `from` and `time` of this dictionary name. CaseError where there is none, or one of
    another box."""
    path = _find(case, d)
    source = path.parents[2]
    ours, theirs = read_box(case), read_box(source)
    if ours and theirs and not np.allclose(ours.size, theirs.size, rtol=1e-9):
        raise d.fail(
            "from", f"names {source} with the box {theirs}, and this one has {ours}: they must be as large"
        )
    try:
        state = read_arrays(path, (*TAKEN, *OTHERS), path.stat().st_size)
        force = {
            n.removeprefix("forcing_"): state[n] for n in TAKEN if n.startswith("forcing_") and n in state
        }
        return Earlier(path, _modes(state), force)
    except ValueError as error:
        raise d.fail("from", f"names the flow {path}, which cannot be read: {error}") from None


def _find(case: Path, d: Dictionary) -> Path:
    named = Path(d.word("from").strip('"'))
    source = case / named
    folder = source / SPECTRAL if (source / SPECTRAL).is_dir() else source
    times = {t: f / FLOW_FILE for t, f in numbered(folder).items() if (f / FLOW_FILE).is_file()}
    if not times:
        raise d.fail(
            "from", f"is {named}: {folder} has no time folder with a flow of gbm run --flow spectral"
        )
    time = d.number("time", max(times))
    if time not in times:
        raise d.fail("time", f"is {time:g}; {folder} has {' '.join(f'{t:g}' for t in times)}")
    return times[time]


def _modes(state: dict[str, np.ndarray]) -> FourierModes:
    """The coefficients of `spectral.modes`, kz >= 0, as a list. ValueError where they are none."""
    any_length = range(2, 1 << 16)
    check_arrays(state, {"coefficients": ("c", (range(3, 4), any_length, any_length, any_length))})
    c = state["coefficients"].astype(complex)
    cut = c.shape[3] - 1
    if c.shape[1:3] != (2 * cut + 1, 2 * cut + 1):
        raise ValueError(f"'coefficients' has shape {c.shape}")
    signed = np.concatenate([np.arange(cut + 1), np.arange(-cut, 0)])
    m = np.stack(np.meshgrid(signed, signed, np.arange(cut + 1), indexing="ij"), axis=-1).reshape(-1, 3)
    weight = np.where(m[:, 2] > 0, 2.0, 1.0)  # for the conjugates, which are not stored
    return FourierModes(m, weight[:, None] * c.reshape(3, -1).T)
