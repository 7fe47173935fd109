"""Finished runs, or runs under way, as the studies of their fibers see them: anybody's, of any engine.

A run is a folder with postProcessing: a case, or the folder `spectral` or `stored` in one. Its fibers come from the
recordings, the scales of its flow from the table of its forcing, both from the time on that --from says.
"""

from __future__ import annotations

import argparse
import re
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from fnmatch import fnmatch
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ..case.layout import results
from ..output.recording import RecordedFamily, open_recording
from ..output.tables import read_forcing
from ..scales import kolmogorov_length, kolmogorov_time, taylor_reynolds
from ..statistics.ensemble import Estimate, fiber_average
from ..statistics.wormlike import persistence_length
from .study import option, steps

ENGINES = ("spectral", "stored")  # folders in a case that are runs
BLOCK = 16 << 20  # bytes of positions read at once
Since = (
    float | Sequence[float] | None
)  # start of the averages [s] of all runs or of each; None: their middles
TURNING = 1.0  # Kolmogorov times between records that tumbling can be told from
STIFFER = {"asPrinted": 2.0}  # bending torque: how much stiffer than its K^b it makes a fiber


def add_run_arguments(parser: argparse.ArgumentParser, run: Callable) -> None:
    """Which runs, and what of them."""
    text = "folders with postProcessing: a case, or CASE/spectral, CASE/stored (default: the working folder)"
    parser.add_argument("cases", nargs="*", type=Path, default=[Path(".")], metavar="CASE", help=text)
    text = "start of the averages [s]; once, or again for each further run (default: the middle of each run)"
    parser.add_argument("--from", dest="since", type=float, action="append", metavar="T", help=text)
    option(parser, run, "records", "of each run at most, equally spaced")
    text = "families whose names match one of these patterns, as 'K1e-5*' (default: all)"
    parser.add_argument("--families", nargs="+", default=(), metavar="PATTERN", help=text)


@dataclass(frozen=True)
class Flow:
    """The scales of a flow. SI units; dissipation is the budget's, gradient and swing the one from gradients and the
    rms of the budget's over its mean, NaN and 0 where unknown; forcing: its word."""

    viscosity: float
    density: float
    dissipation: Estimate
    gradient: float
    swing: float
    velocity_rms: float
    forcing: str

    @property
    def kolmogorov_length(self) -> float:
        return kolmogorov_length(self.viscosity, self.dissipation.value)

    @property
    def kolmogorov_time(self) -> float:
        return kolmogorov_time(self.viscosity, self.dissipation.value)

    @property
    def taylor_reynolds(self) -> float:
        return taylor_reynolds(self.velocity_rms, self.viscosity, self.dissipation.value)

    @property
    def large_length(self) -> float:
        """u'³/ε: of the eddies that hold the energy."""
        return self.velocity_rms**3 / self.dissipation.value

    def persistence(self, stiffness: float, dissipation: float | None = None) -> float:
        """l_p [m], eq. (15)."""
        epsilon = dissipation or self.dissipation.value
        return float(persistence_length(stiffness, self.density * self.viscosity, self.density, epsilon))


@dataclass(frozen=True)
class Family:
    """A family of a run, in the scales of its flow. Lengths in metres; stiffness: K^b that its bending energy has;
    persistence: l_p of eq. (15), without γ."""

    run: str
    name: str
    count: int
    beads: int
    radius: float
    stiffness: float
    persistence: float
    model: Mapping[str, str]
    time_step: float | None

    @property
    def length(self) -> float:
        """2aN."""
        return 2 * self.radius * self.beads

    @property
    def contour(self) -> float:
        """2a(N−1), from centre to centre of the end beads."""
        return 2 * self.radius * (self.beads - 1)

    @property
    def stretch(self) -> float:
        """2a(N−1)/l_p; infinite for K^b = 0."""
        return self.contour / self.persistence if self.persistence else np.inf

    @property
    def resolved(self) -> bool:
        """Whether l_p is no shorter than a bead is wide."""
        return self.persistence >= 2 * self.radius

    def row(self) -> dict:
        """What a line of a CSV says of it."""
        return {
            "run": self.run,
            "family": self.name,
            "count": self.count,
            "beads": self.beads,
            "length_2aN": self.length,
            "bending_stiffness": self.stiffness,
            "l_p": self.persistence,
            "L_over_l_p": self.stretch if np.isfinite(self.stretch) else None,
            "l_p_over_2a": self.persistence / (2 * self.radius),
        }


def even_records(steps: np.ndarray) -> np.ndarray:
    """Records at equal intervals, the usual one: a restart makes one more, of the step at which it began."""
    usual = int(np.median(np.diff(steps))) if len(steps) > 1 else 1
    phases, counts = np.unique(steps % max(usual, 1), return_counts=True)
    return np.flatnonzero(steps % max(usual, 1) == phases[counts.argmax()])


class FinishedRun:
    """A run whose recording is open: its label, its flow, families, and the times of the records in use (T,) [s].

    FileNotFoundError where there is no recording or no table of the flow; ValueError where no record is in use.
    """

    def __init__(
        self, case: Path | str, since: float | None = None, records: int = 400, families: Sequence[str] = ()
    ):
        self.case = Path(case)
        self.label = run_label(self.case)
        if not self.case.is_dir():
            raise FileNotFoundError(f"there is no folder {case}")
        if not results(self.case).is_dir():
            inner = [str(self.case / e) for e in ENGINES if results(self.case / e).is_dir()]
            hint = f": did you mean {' or '.join(inner)}?" if inner else ""
            raise FileNotFoundError(f"no fiber recording, {results(self.case)}{hint}")
        self.recording = open_recording(results(self.case))
        try:
            self._choose(since, records)
            self.table = _table(self.case)
            self.flow = self._flow()
            self.families = [
                self._family(record)
                for record in self.recording.families.values()
                if not families or any(fnmatch(record.name, pattern) for pattern in families)
            ]
            if not self.families:
                names = " ".join(self.recording.families)
                raise ValueError(f"{case}: no family is named {' '.join(families)}; there are {names}")
        except BaseException:
            self.recording.close()
            raise

    def _choose(self, since: float | None, records: int) -> None:
        times = self.recording.times
        if not len(times):
            raise ValueError(f"{self.case}: the recording is empty")
        self.since = (times[0] + times[-1]) / 2 if since is None else since
        self.even = even_records(self.recording.steps)
        rows = self.even[times[self.even] >= self.since - 1e-9 * max(1.0, abs(self.since))]
        if len(rows) < 2:
            raise ValueError(
                f"{self.case} has fewer than two records from t = {self.since:g} on: they are at {times[0]:g} "
                f"to {times[-1]:g}"
            )
        self.rows = rows[:: max(1, -(-len(rows) // records))]
        self.times = times[self.rows]

    @property
    def spacing(self) -> float:
        """Between the records in use [s]."""
        return float(np.diff(self.times).mean())

    @property
    def turns(self) -> bool:
        """Whether the records in use follow a rod that turns with the smallest eddies."""
        return self.spacing <= TURNING * self.flow.kolmogorov_time

    def _flow(self) -> Flow:
        table, meta = self.table, self.recording.metadata
        late = table["Time"] >= self.since - 1e-9
        if not late.any():
            raise ValueError(f"{self.case}: the table of the flow has no line from t = {self.since:g} on")
        epsilon = fiber_average(table["epsilonBudget"][late][:, None])
        gradient = float(table["epsilonGradient"][late].mean()) if "epsilonGradient" in table else np.nan
        rms = float(np.sqrt((table["uPrime"][late] ** 2).mean()))
        words = meta["dictionaries"].get("constant/fvOptions", "")
        kind = re.search(r"^\s*type\s+(linearForcing|eswaranPope)\s*;", words, flags=re.MULTILINE)
        return Flow(
            viscosity=meta["dynamic_viscosity"] / meta["density"],
            density=meta["density"],
            dissipation=epsilon,
            gradient=gradient,
            swing=float(table["epsilonBudget"][late].std() / epsilon.value),
            velocity_rms=rms,
            forcing=kind[1] if kind else "none",
        )

    def _family(self, record: RecordedFamily) -> Family:
        stiffness = np.unique(record.bending_stiffness)
        if len(stiffness) != 1:
            raise ValueError(f"{self.case}: family {record.name} has several bending stiffnesses")
        own = float(stiffness[0]) * STIFFER.get(record.model.get("bendingTorque", ""), 1.0)
        control = self.recording.metadata["dictionaries"].get("system/controlDict", "")
        step = re.search(r"^\s*deltaT\s+([\d.eE+-]+)\s*;", control, flags=re.MULTILINE)
        return Family(
            run=self.label,
            name=record.name,
            count=record.count,
            beads=record.beads,
            radius=record.radius,
            stiffness=own,
            persistence=self.flow.persistence(own),
            model=record.model,
            time_step=float(step[1]) if step else None,
        )

    def followed(self) -> Iterator[Family]:
        """Its families, with a bar on a terminal."""
        return steps(self.families, len(self.families), self.label)

    def measure(
        self, family: Family, *quantities: Callable[[NDArray], NDArray], rows: NDArray | None = None
    ) -> list[NDArray]:
        """Each quantity, a function of positions (B, F, N, 3), at all records in use, or at those of these rows of the
        recording: (T, F, ...)."""
        positions = self.recording.families[family.name].positions
        rows = self.rows if rows is None else rows
        block = max(1, BLOCK // (24 * family.count * family.beads))
        found: list[list[NDArray]] = [[] for _ in quantities]
        for start in range(0, len(rows), block):
            part = positions[rows[start : start + block]]
            for values, quantity in zip(found, quantities, strict=True):
                values.append(np.asarray(quantity(part)))
        return [np.concatenate(values) for values in found]

    def summary(self) -> dict:
        """The run and its flow in numbers."""
        flow = self.flow
        return {
            "run": self.label,
            "from": float(self.times[0]),
            "to": float(self.times[-1]),
            "records": len(self.times),
            "forcing": flow.forcing,
            "viscosity": flow.viscosity,
            "dissipation": flow.dissipation.value,
            "dissipation_error": flow.dissipation.error,
            "dissipation_gradient": flow.gradient if np.isfinite(flow.gradient) else None,
            "dissipation_rms_over_mean": flow.swing,
            "kolmogorov_length": flow.kolmogorov_length,
            "kolmogorov_time": flow.kolmogorov_time,
            "taylor_reynolds": flow.taylor_reynolds,
            "velocity_rms": flow.velocity_rms,
        }

    def close(self) -> None:
        self.recording.close()

    def __enter__(self) -> FinishedRun:
        return self

    def __exit__(self, *_) -> None:
        self.close()


def run_label(case: Path) -> str:
    path = case.resolve()
    return f"{path.parent.name}/{path.name}" if path.name in ENGINES else path.name


def _table(case: Path) -> dict[str, NDArray]:
    """The table of the flow, of a replay that of the case whose fields it took."""
    try:
        return read_forcing(case)
    except FileNotFoundError:
        if case.resolve().name != "stored":
            raise
        return read_forcing(case.resolve().parent)


def finished_runs(
    cases: Sequence[Path], since: Since, records: int, families: Sequence[str]
) -> Iterator[FinishedRun]:
    """One after the other, open while in use; since: one time for all, one for each, or None. Labels are unique: a
    second run of one label has a number. ValueError for another number of times."""
    starts = [None] if since is None else np.atleast_1d(since).tolist()
    starts = starts * len(cases) if len(starts) == 1 else starts
    if len(starts) != len(cases):
        raise ValueError(
            f"--from is given {len(starts)} times for {len(cases)} runs: give it once, or for each"
        )
    seen: dict[str, int] = {}
    for case, start in zip(cases, starts, strict=True):
        with FinishedRun(case, start, records, families) as run:
            seen[run.label] = seen.get(run.label, 0) + 1
            if seen[run.label] > 1:
                label = f"{run.label} ({seen[run.label]})"
                run.families = [Family(**(vars(f) | {"run": label})) for f in run.families]
                run.label = label
            yield run


def same_flow(one: dict, other: dict) -> bool:
    """Whether two runs, by their `summary`, are of one flow: their scales are alike, whatever solved it."""
    return one["viscosity"] == other["viscosity"] and 0.6 < one["dissipation"] / other["dissipation"] < 1.6


def flow_lines(runs: Sequence[dict]) -> list[str]:
    """The flows of the `summary` of each run, as text."""
    return [
        f"{r['run']}: t = {r['from']:g} to {r['to']:g} s, {r['records']} records, ε = {r['dissipation']:.4g}"
        + (f" ± {r['dissipation_error']:.2g}" if r["dissipation_error"] else "")
        + f", η = {r['kolmogorov_length']:.4g}, τ = {r['kolmogorov_time']:.4g}, Re_λ = {r['taylor_reynolds']:.1f}"
        for r in runs
    ]


def checked_bending(measured: Sequence, cases: Sequence[Path]) -> Sequence:
    """What was measured of the families of three beads or more; ValueError where there is none."""
    if not measured:
        raise ValueError(
            f"no family has more than two beads, of which nothing bends: {' '.join(map(str, cases))}"
        )
    return measured
