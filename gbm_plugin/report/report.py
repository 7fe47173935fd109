"""`gbm report CASE`: figures, tables and key figures of a run."""

from __future__ import annotations

import json
import math
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ..case.changes import changes
from ..case.layout import results
from ..case.mesh import box_mesh
from ..case.trust import check_case
from ..files import replaced, write_text
from ..output.field import latest_time, read_velocity, vorticity_magnitude
from ..output.recording import RecordedFamily, Recording, open_recording
from ..output.tables import read_forcing
from ..scales import kolmogorov_length
from ..statistics import fibers as shape
from ..statistics.turbulence import energy_spectrum
from .figures import end_to_end_figure, energy_figure, spectrum_figure
from .paraview import write_series
from .picture import fibers_picture
from .style import save, styled

_FLOW = {  # column of the forcing's table: key figure
    "k": "kinetic_energy",
    "epsilonBudget": "dissipation_budget",
    "epsilonGradient": "dissipation_gradient",
    "epsilonLaplacian": "dissipation_laplacian",
    "uPrime": "velocity_rms",
    "ReLambda": "taylor_reynolds",
    "eta": "kolmogorov_length",
    "A": "forcing_coefficient",
    "power": "forcing_power",
}


def report(case_dir: Path | str) -> dict:
    """Write figures (PNG, PDF), tables (CSV), ParaView series (.pvd) and report.json into <case>/report/;
    returns the key figures.

    Averages over time are over its second half. What cannot be drawn, because a file or a column is missing,
    is listed with the reason under "not_drawn". Key figures that are not defined are None (null in
    report.json). Raises FileNotFoundError if the case is not there or holds nothing to report.
    """
    case = Path(case_dir)
    if not case.is_dir():
        raise FileNotFoundError(f"no case at {case}")
    check_case(case)
    key: dict = {"case": case.resolve().name, "flow": None, "spectrum": None, "fibers": None}
    key.update(files=[], not_drawn=[])
    folder = case / "report"
    with styled():
        recording = _attempt(key, "fibers", open_recording, results(case))
        key["changes"] = _changes(recording) if recording is not None else []
        table = _attempt(key, "k and ε against time", _flow, case, folder, key)
        try:
            field = _attempt(key, "E(k)", _spectrum, case, folder, key, table, recording)
            if recording is not None and len(recording.times):
                _fibers(recording, folder, key)
                _picture(recording, folder, key, field)
                key["files"] += [write_series(recording, folder, wrapped) for wrapped in (True, False)]
            elif recording is not None:
                key["not_drawn"].append("fibers: the recording is empty")
        finally:
            if recording is not None:
                recording.close()
    if not key["files"]:
        raise FileNotFoundError(f"{case} holds nothing to report: " + "; ".join(key["not_drawn"]))
    key["files"] = sorted(path.name for path in key["files"])
    key = _json_ready(key)
    write_text(folder / "report.json", json.dumps(key, indent=2, allow_nan=False, ensure_ascii=False) + "\n")
    return key


def _changes(recording: Recording) -> list[dict]:
    """What was changed in the dictionaries at which restart."""
    pairs = zip(recording.starts[:-1], recording.starts[1:], strict=True)
    found = ({"time": time, "changes": changes(before, now)} for (_, before), (time, now) in pairs)
    return [change for change in found if change["changes"]]


def _attempt(key: dict, what: str, function, *arguments):
    """A part of the report, or None and the reason why there is none."""
    try:
        return function(*arguments)
    except (FileNotFoundError, ValueError) as error:
        key["not_drawn"].append(f"{what}: {error}")
        return None


def _flow(case: Path, folder: Path, key: dict) -> dict[str, NDArray]:
    table = read_forcing(case)
    if not len(table["Time"]):
        raise ValueError("the table of the forcing has no lines")
    key["not_drawn"] += [
        f"{name}: no such column in the table of the forcing" for name in _FLOW if name not in table
    ]
    key["files"] += [
        _write_csv(folder / "flow.csv", table),
        *save(energy_figure(table, _when(key)), folder, "energy"),
    ]
    late = _second_half(table["Time"])
    flow = {"time": [table["Time"][0], table["Time"][-1]], "averaged_from": table["Time"][late][0]}
    flow |= {figure: _mean(table[name][late]) for name, figure in _FLOW.items() if name in table}
    if {"epsilonBudget", "epsilonLaplacian"} <= set(table):
        # what the scheme dissipates beyond its own discrete viscous term
        flow["numerical_dissipation_fraction"] = (
            1 - flow["dissipation_laplacian"] / flow["dissipation_budget"]
        )
    mean = [table[name] for name in ("meanUx", "meanUy", "meanUz") if name in table]
    if mean and "uPrime" in table:
        flow["largest_mean_velocity_over_rms"] = np.max(np.linalg.norm(mean, axis=0) / table["uPrime"])
    key["flow"] = flow
    return table


def _spectrum(case: Path, folder: Path, key: dict, table: dict | None, recording: Recording | None):
    """E(k) of the latest written time; returns the time and the vorticity's magnitude for the picture."""
    name = latest_time(case, "U")
    if name is None:
        raise FileNotFoundError(f"no time folder with U in {case}")
    cells, _, size = box_mesh(case)
    velocity = read_velocity(case, name, cells)
    k, spectrum = energy_spectrum(velocity, tuple(size))
    resolved = k <= np.pi * np.min(np.array(cells) / size) * (
        1 + 1e-9
    )  # the grid's corners hold no full shells
    time, step = float(name), k[1] - k[0]
    dissipation, length, source = _scales(time, k, spectrum, table, recording)
    columns = {"k [rad/m]": k[resolved], "E [m3/s2]": spectrum[resolved]}
    if dissipation is not None:
        columns["k eta"] = k[resolved] * length
        columns["E k^(5/3) eps^(-2/3)"] = (spectrum * k ** (5 / 3))[resolved] * dissipation ** (-2 / 3)
    figure = spectrum_figure(k[resolved], spectrum[resolved], time, dissipation, length)
    key["files"] += [_write_csv(folder / "spectrum.csv", columns), *save(figure, folder, "spectrum")]
    fluctuation = step * spectrum[1:].sum()
    key["spectrum"] = {
        "time": time,
        "cells": list(cells),
        "kinetic_energy": step * spectrum.sum(),
        "integral_length": 0.75 * np.pi * step * (spectrum[1:] / k[1:]).sum() / fluctuation
        if fluctuation
        else None,
        "dissipation": dissipation,
        "dissipation_from": source,
        "kolmogorov_length": length,
        "k_max_eta": None if length is None else float(k[resolved][-1] * length),
    }
    return time, vorticity_magnitude(velocity, size)


def _scales(time: float, k: NDArray, spectrum: NDArray, table: dict | None, recording: Recording | None):
    """ε and η at a time: from the run's own table, else from the spectrum and the recorded viscosity."""
    if table is not None and {"epsilonBudget", "eta"} <= set(table):
        row = int(np.argmin(np.abs(table["Time"] - time)))
        epsilon, eta = float(table["epsilonBudget"][row]), float(table["eta"][row])
        if epsilon > 0 and eta > 0 and abs(table["Time"][row] - time) <= 0.01 * np.ptp(table["Time"]):
            return epsilon, eta, "epsilonBudget and eta of the table of the forcing"
    if recording is not None:
        nu = recording.metadata["dynamic_viscosity"] / recording.metadata["density"]
        epsilon = float(2 * nu * (k[1] - k[0]) * (k**2 * spectrum).sum())
        if epsilon > 0:
            return epsilon, kolmogorov_length(nu, epsilon), "2 nu sum k^2 E"
    return None, None, None


def _fibers(recording: Recording, folder: Path, key: dict) -> None:
    late = _second_half(recording.times)
    columns: dict[str, NDArray] = {"time [s]": recording.times, "step": recording.steps}
    curves, families = {}, {}
    for name, family in recording.families.items():
        rows = [
            _shape(family.positions[row], family.radius) | _tension(family, row)
            for row in range(len(recording.times))
        ]
        series = {quantity: np.array([row[quantity] for row in rows]) for quantity in rows[0]}
        columns |= {f"{name}: {quantity}": values for quantity, values in series.items()}
        ratio, error = series["<R^2>/(2a(N-1))^2"], series["standard error of it"]
        curves[name] = (ratio, error, family.beads)
        families[name] = {
            "count": family.count,
            "beads": family.beads,
            "radius": family.radius,
            "length_2aN": 2 * family.radius * family.beads,
            "contour_2a(N-1)": 2 * family.radius * (family.beads - 1),
            "bending_stiffness": np.unique(family.bending_stiffness).tolist(),
            "R2_over_contour2_last": ratio[-1],
            "R2_over_contour2_mean": _mean(ratio[late]),
            "R2_over_length2_mean": _mean(series["<R^2>/(2aN)^2"][late]),
            "mean_curvature": _mean(series["mean curvature [1/m]"][late]),
            "gyration_radius": _mean(series["gyration radius [m]"][late]),
            "worst_link_length_error": series["worst link length error"].max(),
        }
        if "mean tension [N]" in series:
            families[name]["tension_mean"] = _mean(series["mean tension [N]"][late])
            families[name]["tension_largest"] = series["largest tension [N]"].max()
    key["files"] += [
        _write_csv(folder / "fibers.csv", columns),
        *save(end_to_end_figure(recording.times, curves, _when(key)), folder, "end_to_end"),
    ]
    key["fibers"] = {
        "time": [recording.times[0], recording.times[-1]],
        "records": len(recording.times),
        "averaged_from": recording.times[late][0],
        "families": families,
    }


def _shape(positions: NDArray, radius: float) -> dict[str, float]:
    """Averages over the fibers (F, N, 3) of one family at one time."""
    count, beads, _ = positions.shape
    ratio = shape.end_to_end_squared_ratio(positions, radius)
    bent = shape.mean_curvature(positions, radius).mean() if beads > 2 else 0.0
    return {
        "<R^2>/(2a(N-1))^2": ratio.mean(),
        "standard error of it": ratio.std(ddof=1) / np.sqrt(count) if count > 1 else np.nan,
        "<R^2>/(2aN)^2": ratio.mean() * ((beads - 1) / beads) ** 2,
        "mean curvature [1/m]": bent,
        "gyration radius [m]": shape.gyration_radius(positions).mean(),
        "worst link length error": shape.link_length_error(positions, radius),
    }


def _tension(family: RecordedFamily, row: int) -> dict[str, float]:
    """Of all links at one time; nothing where it was not recorded."""
    if family.tension is None:
        return {}
    values = family.tension[row]
    return {
        "mean tension [N]": values.mean(),
        "largest tension [N]": values.max(),
        "smallest tension [N]": values.min(),
    }


def _picture(recording: Recording, folder: Path, key: dict, field: tuple[float, NDArray] | None) -> None:
    """The fibers at the latest time; or at the flow's, with its vorticity, if recorded then."""
    row, flow = len(recording.times) - 1, None
    if field is not None:
        time, vorticity = field
        nearest = int(np.argmin(np.abs(recording.times - time)))
        interval = np.diff(recording.times).min() if row else 0.0
        if abs(recording.times[nearest] - time) <= interval:
            apart = abs(recording.times[nearest] - time) > 1e-3 * interval
            row, flow = nearest, (vorticity, "|∇×u| [1/s]" + (f" at t = {time:g} s" if apart else ""))
    key["files"] += save(fibers_picture(recording, row, flow), folder, "fibers")


def _when(key: dict) -> list[float]:
    return [change["time"] for change in key["changes"]]


def _second_half(times: NDArray) -> NDArray[np.bool_]:
    return times >= 0.5 * (times[0] + times[-1])


def _mean(values: NDArray) -> float:
    known = values[np.isfinite(values)]
    return float(known.mean()) if len(known) else math.nan


def _write_csv(path: Path, columns: dict[str, NDArray]) -> Path:
    flat = {}
    for name, values in columns.items():
        parts = (
            {name: values} if values.ndim == 1 else {f"{name}.{i}": part for i, part in enumerate(values.T)}
        )
        flat |= parts
    header = ",".join(f'"{name}"' if "," in name else name for name in flat)
    rows = np.stack(list(flat.values()), axis=-1)
    path.parent.mkdir(exist_ok=True)
    with replaced(path, encoding="utf-8") as file:
        np.savetxt(file, rows, "%.12g", ",", header=header, comments="")
    return path


def _json_ready(value):
    """The same with plain numbers, and None for what is not finite: JSON has no NaN."""
    if isinstance(value, dict):
        return {name: _json_ready(item) for name, item in value.items()}
    if isinstance(value, list):
        return [_json_ready(item) for item in value]
    if isinstance(value, np.generic):
        value = value.item()
    return None if isinstance(value, float) and not math.isfinite(value) else value
