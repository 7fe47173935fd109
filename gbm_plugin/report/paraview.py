"""Fibers as a time series for ParaView: one .vtp of polylines per time, and a .pvd that lists them.

XDMF is not used: meshio's reader, and so a check, knows neither a slice of an HDF5 dataset nor moving points.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple
from xml.etree import ElementTree

import meshio
import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..files import replaced
from ..output.recording import Recording
from ..statistics.fibers import bead_curvature, bead_tension
from .vtp import Polylines, write_vtp

if TYPE_CHECKING:
    from ..fiber import Trajectory

FAR, LONG = 1e9, 1e3  # no bead is so many boxes away, and no link is so many long


def write_series(
    recording: Recording | Trajectory | Sequence[Trajectory],
    folder: Path | str,
    wrapped: bool = False,
    box: ArrayLike | None = None,
) -> Path:
    """Write all times of a recording, or of what `simulate` gave, as moving polylines; returns the .pvd to open.
    ParaView's filter Tube, with "Vary Radius: By Absolute Scalar" and the array radius, shows them as they are.

    box: widths [m] of the periodic box, three or one, of trajectories that are wrapped; a recording has its own.
    wrapped: every fiber cut at the faces of the periodic box and each piece shifted into it; otherwise fibers
    are whole, where they were carried. Point data: curvature [1/m] (eq. (5); end beads as their neighbours, 0 for two
    beads), velocity [m/s] (differences between records), radius [m], stiffness K^b [N m2], tension [N] where it was
    recorded (mean of the links beside a bead), family (its number), fiber (unique over the families), bead (index;
    fractional at a cut). Data of each line: family, fiber.
    Replaces a series that is there. Raises OSError if it cannot be written.
    """
    if not isinstance(recording, Recording):
        recording = _of_trajectories(recording, box, wrapped)
    name = "wrapped" if wrapped else "unwrapped"
    pieces = Path(folder) / name
    pieces.mkdir(parents=True, exist_ok=True)
    for old in pieces.glob("fibers_*.vt[pu]"):
        old.unlink()
    root = ElementTree.Element("VTKFile", type="Collection", version="0.1", byte_order="LittleEndian")
    collection = ElementTree.SubElement(root, "Collection")
    for row, time in enumerate(recording.times):
        file = pieces / f"fibers_{row:06d}.vtp"
        with replaced(file, "wb") as content:
            write_vtp(content, polylines(recording, row, wrapped))
        ElementTree.SubElement(
            collection, "DataSet", timestep=f"{time:.12g}", part="0", file=f"{name}/{file.name}"
        )
    ElementTree.indent(root)
    path = Path(folder) / f"fibers_{name}.pvd"
    with replaced(path, "wb") as file:
        ElementTree.ElementTree(root).write(file, encoding="utf-8", xml_declaration=True)
    return path


class _Moving(NamedTuple):
    """A family of a trajectory, as a recording has it."""

    positions: NDArray
    radius: float
    bending_stiffness: NDArray
    count: int
    beads: int
    tension: None = None


class _Trajectories(NamedTuple):
    """Trajectories of one flow, as a recording has them."""

    times: NDArray
    families: dict[str, _Moving]
    box_origin: NDArray
    box_size: NDArray | None


def _of_trajectories(given: Trajectory | Sequence[Trajectory], box, wrapped: bool) -> _Trajectories:
    paths = list(given) if isinstance(given, Sequence) else [given]
    if wrapped and box is None:
        raise ValueError("trajectories know no box: give box to wrap them")
    if any(not np.array_equal(path.times, paths[0].times) for path in paths):
        raise ValueError(
            "the trajectories are of different times; families that simulate moves together are not"
        )
    families = {
        str(number): _Moving(
            path.positions,
            path.fibers.radius,
            path.fibers.bending_stiffness,
            path.fibers.count,
            path.fibers.beads,
        )
        for number, path in enumerate(paths)
    }
    size = None if box is None else np.broadcast_to(np.asarray(box, dtype=float), (3,))
    return _Trajectories(paths[0].times, families, np.zeros(3), size)


def polylines(recording: Recording | _Trajectories, row: int, wrapped: bool) -> Polylines:
    """All fibers at the `row`-th time, with the data of `write_series`."""
    parts, first = [], 0
    tensions = all(family.tension is not None for family in recording.families.values())
    for number, family in enumerate(recording.families.values()):
        positions = family.positions[row]
        fiber, bead = np.indices(positions.shape[:2], dtype=float)
        stiffness = np.broadcast_to(family.bending_stiffness, family.count)[:, None]
        along = [
            bead_curvature(positions, family.radius)[..., None],
            _velocity(recording.times, family.positions, row),
            *(np.broadcast_to(v, bead.shape)[..., None] for v in (family.radius, stiffness, number)),
            (fiber + first)[..., None],
            bead[..., None],
            *([bead_tension(family.tension[row])[..., None]] if tensions else []),
        ]
        chains = np.concatenate([positions, *along], axis=-1)
        if wrapped:
            nodes, links = cut_at_faces(chains, recording.box_origin, recording.box_size)
            nodes, offsets = _joined(nodes, links)
        else:
            nodes = chains.reshape(-1, chains.shape[-1])
            offsets = np.arange(0, len(nodes) + 1, family.beads)
        parts.append((nodes, offsets))
        first += family.count
    starts = np.cumsum([0, *(len(nodes) for nodes, _ in parts)])
    offsets = [start + part[:-1] for start, (_, part) in zip(starts, parts, strict=False)]
    nodes = np.concatenate([nodes for nodes, _ in parts])
    ends = np.concatenate([*offsets, starts[-1:]])
    kappa, u, radius, stiffness, family, fiber, bead, *pull = np.split(
        nodes[:, 3:], [1, 4, 5, 6, 7, 8, *([9] if tensions else [])], axis=1
    )
    whole = {"family": family[:, 0].astype(np.int32), "fiber": fiber[:, 0].astype(np.int32)}
    along = {"curvature": kappa[:, 0], "velocity": u, "radius": radius[:, 0], "stiffness": stiffness[:, 0]}
    if pull:
        along["tension"] = pull[0][:, 0]
    return Polylines(
        nodes[:, :3],
        ends,
        along | whole | {"bead": bead[:, 0]},
        {name: values[ends[:-1]] for name, values in whole.items()},
    )


def line_mesh(recording: Recording, row: int, wrapped: bool) -> meshio.Mesh:
    """The same as lines of two nodes, for all formats that meshio writes."""
    lines = polylines(recording, row, wrapped)
    return meshio.Mesh(lines.points, [("line", lines.segments())], point_data=dict(lines.point_data))


def _velocity(times: NDArray, positions, row: int) -> NDArray:
    """Of the beads at one time, from the records beside it; 0 where there is one record only."""
    before, after = max(row - 1, 0), min(row + 1, len(times) - 1)
    if before == after:
        return np.zeros_like(positions[row])
    return (positions[after] - positions[before]) / (times[after] - times[before])


def _joined(nodes: NDArray, links: NDArray) -> tuple[NDArray, NDArray]:
    """Lines of the links that follow each other: points in their order, and offsets."""
    start = np.flatnonzero(np.append(True, links[1:, 0] != links[:-1, 1])) if len(links) else np.empty(0, int)
    lengths = np.diff(np.append(start, len(links))) + 1
    order = np.insert(links[:, 1], start, links[start, 0])
    return nodes[order], np.concatenate([[0], np.cumsum(lengths)])


def cut_at_faces(chains: NDArray, origin: ArrayLike, size: ArrayLike) -> tuple[NDArray, NDArray]:
    """Cut chains at the faces of the periodic box and shift each piece into it.

    chains (F, N, 3 + V): positions and V values along; origin, size (3,). A link that crosses a face is
    divided there, with linearly interpolated values; both ends of the cut become points, one on either face.
    Returns points (P, 3 + V) in the box and links (M, 2).
    """
    origin, size = np.asarray(origin, dtype=float), np.asarray(size, dtype=float)
    beads = chains.shape[1]
    scaled = (chains[..., :3] - origin) / size
    start, end = scaled[:, :-1].reshape(-1, 3), scaled[:, 1:].reshape(-1, 3)
    if not (np.abs(scaled).max() < FAR and np.abs(end - start).max() < LONG):
        raise ValueError(
            "a recording has beads that are nowhere near its box, or near each other: it was damaged"
        )
    # cuts: link, and where in it, for every plane of the lattice that lies strictly between its ends
    links, fractions = [np.empty(0, dtype=np.intp)], [np.empty(0)]
    for axis in range(3):
        low = np.minimum(start[:, axis], end[:, axis])
        high = np.maximum(start[:, axis], end[:, axis])
        plane = np.floor(low) + 1
        while np.any(plane < high):
            crossed = np.flatnonzero(plane < high)
            links.append(crossed)
            span = end[crossed, axis] - start[crossed, axis]
            fractions.append((plane[crossed] - start[crossed, axis]) / span)
            plane = plane + 1
    link, fraction = np.concatenate(links), np.concatenate(fractions)
    order = np.lexsort((fraction, link))
    link, fraction = link[order], fraction[order]

    # nodes along each chain: its beads and its cuts, by the coordinate bead + fraction
    first = link // (beads - 1) * beads + link % (beads - 1)
    flat = chains.reshape(-1, chains.shape[-1])
    cut = flat[first] + fraction[:, None] * (flat[first + 1] - flat[first])
    nodes = np.concatenate([flat, cut])
    along = np.argsort(np.concatenate([np.arange(len(flat)), first + fraction]), kind="stable")
    nodes = nodes[along]
    fiber = np.concatenate([np.arange(len(flat)) // beads, first // beads])[along]
    joined = np.flatnonzero(fiber[:-1] == fiber[1:])

    # a segment lies in the cell of its middle; nodes are written once for each cell they are used in
    middle = 0.5 * (nodes[joined, :3] + nodes[joined + 1, :3])
    cell = np.floor((middle - origin) / size).astype(np.int64)
    ends = np.stack([joined, joined + 1], axis=-1)
    use = np.concatenate([ends.reshape(-1, 1), np.repeat(cell, 2, axis=0)], axis=1)
    unique, inverse = np.unique(use, axis=0, return_inverse=True)
    points = nodes[unique[:, 0]].copy()
    points[:, :3] = np.clip(points[:, :3] - unique[:, 1:] * size, origin, origin + size)
    return points, inverse.reshape(-1, 2)
