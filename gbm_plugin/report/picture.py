"""Fibers in their periodic box, seen in perspective."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from fnmatch import fnmatch

import numpy as np
from matplotlib.axes import Axes
from matplotlib.cm import ScalarMappable
from matplotlib.collections import LineCollection
from matplotlib.colors import LinearSegmentedColormap, Normalize
from matplotlib.figure import Figure
from numpy.typing import NDArray
from scipy.interpolate import CubicSpline, interp1d

from ..output.recording import RecordedFamily, Recording
from ..statistics.fibers import bead_curvature
from .paraview import cut_at_faces
from .style import new_figure

# light (straight) to dark (bent); one hue per family, told apart by colour-blind readers too
_HUES = (
    ("#8fd0f5", "#0072B2", "#001c33"),
    ("#ffd9a0", "#E0640A", "#4a1500"),
    ("#a5ecd0", "#009E73", "#00291d"),
    ("#f7c9e2", "#C4559A", "#3d0a2c"),
    ("#e3e3e3", "#7a7a7a", "#101010"),
    ("#fff3a6", "#d9b800", "#574600"),
)
_FLOW = LinearSegmentedColormap.from_list("flow", ["#ffffff", "#dfe3ea", "#aab2c3", "#7d879f"])
_POINTS_PER_LINK = 6
_MOST_FIBERS = 200  # more hide each other
_THINNEST = 1.1  # points; thinner fibers are drawn this thick


class Camera:
    """Perspective projection of a box: scene (..., 3) to picture (..., 2) and nearness."""

    def __init__(self, origin: NDArray, size: NDArray, elevation: float = 20, azimuth: float = -62) -> None:
        e, a = np.radians([elevation, azimuth])
        self.towards = np.array([np.cos(e) * np.cos(a), np.cos(e) * np.sin(a), np.sin(e)])
        self.right = np.array([-np.sin(a), np.cos(a), 0.0])
        self.up = np.cross(self.towards, self.right)
        self.centre = origin + size / 2
        self.distance = 3.2 * np.linalg.norm(size)

    def __call__(self, points: NDArray) -> tuple[NDArray, NDArray]:
        offset = points - self.centre
        near = offset @ self.towards
        magnification = self.distance / (self.distance - near)
        flat = np.stack([offset @ self.right, offset @ self.up], axis=-1)
        return flat * magnification[..., None], near


@dataclass(frozen=True)
class Choice:
    """What of a recording is drawn: families by patterns of their names, fibers of each, and, in a film, the largest
    curvature [1/m] of each family's colours, by its name, and that of the flow's."""

    families: Sequence[str] = ("*",)
    fibers: int | None = None
    curvatures: Mapping[str, float] = field(default_factory=dict)
    flow: float | None = None

    def of(self, recording: Recording) -> list[RecordedFamily]:
        """The families that are drawn. ValueError where no name matches."""
        found = [f for f in recording.families.values() if any(fnmatch(f.name, p) for p in self.families)]
        if not found:
            names = " ".join(recording.families)
            raise ValueError(f"no family is named {' '.join(self.families)}; there are {names}")
        return found[: len(_HUES)]


def largest_curvature(positions: NDArray, radius: float) -> float:
    """Where a scale of colours ends [1/m], for fibers (..., N, 3): what few beads are beyond."""
    return max(float(np.percentile(bead_curvature(positions, radius), 98)), 1e-3 / radius)


def fibers_picture(
    recording: Recording, row: int, flow: tuple[NDArray, str] | None = None, choice: Choice | None = None
) -> Figure:
    """Draw all families at the `row`-th time, or what is chosen, wrapped into the box.

    Fibers have their true thickness 2a where that is visible; colour is the curvature of eq. (5), a hue per
    family. flow: values (nx, ny, nz) at the cell centres and their label, shown on the faces behind.
    """
    origin, size = recording.box_origin, recording.box_size
    choice = choice or Choice()
    families = choice.of(recording)
    camera = Camera(origin, size)
    figure = new_figure(8.2, 6.4)
    grid = figure.add_gridspec(
        len(families) + (flow is not None), 3, width_ratios=[1, 0.024, 0.13], wspace=0.02, hspace=0.06
    )
    axes = figure.add_subplot(grid[:, 0])
    flat, _ = camera(origin + size * np.indices((2, 2, 2)).reshape(3, -1).T)
    margin = 0.01 * np.ptp(flat, axis=0).max()
    axes.set(xlim=(flat[:, 0].min() - margin, flat[:, 0].max() + margin))
    axes.set(ylim=(flat[:, 1].min() - margin, flat[:, 1].max() + margin), aspect="equal")
    axes.axis("off")

    shapes, mappables, bars = [], [], []
    for number, family in enumerate(families):
        positions = family.positions[row]
        shown = min(family.count, choice.fibers or max(_MOST_FIBERS // len(families), 1))
        kappa = bead_curvature(positions, family.radius)
        colours = LinearSegmentedColormap.from_list(family.name, _HUES[number % len(_HUES)])
        top = choice.curvatures.get(family.name) or largest_curvature(positions, family.radius)
        scale = Normalize(0, top, clip=True)
        mappables.append(ScalarMappable(scale, colours))
        shapes.append((family.radius, positions[:shown], kappa[:shown]))
        label = f"{family.name}\n{shown} of {family.count} fibers"
        bars.append(_bar(figure, grid[number, 1], mappables[-1], label, extend="max"))
    if flow is not None:
        faces = _draw_faces(axes, camera, origin, size, flow[0], choice.flow)
        _bar(figure, grid[-1, 1], faces, flow[1])
    title = f"t = {recording.times[row]:g} s,  colour: curvature [1/m]"
    if len(families) < len(recording.families):
        title += f",  {len(families)} of {len(recording.families)} families"
    axes.set_title(title, fontsize=10, color="0.25")

    figure.draw_without_rendering()  # lays out the axes, which says how many points a metre has
    figure.set_layout_engine("none")
    points_per_metre = axes.transData.get_matrix()[0, 0] * 72 / figure.dpi
    for (radius, _, _), bar in zip(shapes, bars, strict=True):
        if 2 * radius * points_per_metre < _THINNEST:
            bar.set_title(bar.get_title(loc="left") + "\n(drawn too thick)", fontsize=8, loc="left")
    strokes = [
        _strokes(camera, *shape, mappable, origin, size)
        for shape, mappable in zip(shapes, mappables, strict=True)
    ]
    _draw_edges(axes, camera, origin, size, front=False)
    _draw_strokes(axes, strokes, points_per_metre, size)
    _draw_edges(axes, camera, origin, size, front=True)
    return figure


def _bar(figure: Figure, cell, mappable: ScalarMappable, label: str, extend: str = "neither") -> Axes:
    bar = figure.colorbar(mappable, cax=figure.add_subplot(cell), extend=extend)
    bar.ax.set_title(label, fontsize=8, loc="left")
    bar.ax.tick_params(labelsize=8)
    bar.ax.locator_params(nbins=5)
    bar.outline.set_visible(False)
    return bar.ax


def _smooth(radius: float, positions: NDArray, kappa: NDArray) -> NDArray:
    """Smooth curves through the beads with round ends: (F, P, 5), position, curvature, relative thickness."""
    bead = np.arange(positions.shape[1], dtype=float)
    fine = np.linspace(0, bead[-1], _POINTS_PER_LINK * (len(bead) - 1) + 1)
    spline = CubicSpline(bead, positions, axis=1) if len(bead) > 2 else interp1d(bead, positions, axis=1)
    curve = spline(fine)
    values = interp1d(bead, kappa, axis=1)(fine)
    x = np.sin(np.linspace(0, np.pi / 2, 6))[1:]  # the end beads' outer halves

    def cap(end: NDArray, inner: NDArray, value: NDArray) -> NDArray:
        tangent = (end - inner) / np.linalg.norm(end - inner, axis=-1, keepdims=True)
        place = end[:, None] + radius * x[:, None] * tangent[:, None]
        shape = (*place.shape[:2], 1)
        thickness = np.broadcast_to(np.sqrt(1 - x**2)[:, None], shape)
        return np.concatenate([place, np.broadcast_to(value[:, None, None], shape), thickness], axis=-1)

    first = cap(curve[:, 0], curve[:, 1], values[:, 0])[:, ::-1]
    last = cap(curve[:, -1], curve[:, -2], values[:, -1])
    middle = np.concatenate([curve, values[..., None], np.ones_like(values)[..., None]], axis=-1)
    return np.concatenate([first, middle, last], axis=1)


def _strokes(
    camera: Camera, radius: float, positions: NDArray, kappa: NDArray, colours: ScalarMappable, origin, size
) -> tuple[NDArray, ...]:
    """Short straight pieces of the fibers in the box: ends (M, 2, 2), nearness, width [m], taper, colour."""
    points, lines = cut_at_faces(_smooth(radius, positions, kappa), origin, size)
    flat, near = camera(points[:, :3])
    near = near[lines].mean(axis=1)
    value, taper = points[lines, 3:].mean(axis=1).T
    width = 2 * radius * camera.distance / (camera.distance - near)
    return flat[lines], near, width, taper, colours.to_rgba(value)[:, :3]


def _draw_strokes(axes: Axes, strokes: list, points_per_metre: float, size: NDArray) -> None:
    """From back to front: a dark rim, the body, a highlight; what is far fades.

    A rim lies two diameters behind its body and a highlight a radius before it, so that where a fiber folds the
    neighbours' bodies cover each other's rims, and other fibers are covered as wholes.
    """
    ends, near, width, taper, colour = (np.concatenate(part) for part in zip(*strokes, strict=True))
    radius = 0.5 * width
    depth = np.clip(0.5 - near / np.linalg.norm(size), 0, 1)[:, None]
    width = np.maximum(width * points_per_metre, _THINNEST) * taper
    body = colour + 0.45 * depth * (0.97 - colour)
    inner = np.maximum(width - 0.9, 0.7 * width)
    shift = (width / points_per_metre)[:, None, None] * np.array([-0.13, 0.2])
    layers = (
        (near - 4 * radius, ends, width, 0.45 * body),
        (near, ends, inner, body),
        (near + radius, ends + shift, 0.3 * width, body + 0.55 * (1 - body)),
    )
    near, ends, width, colour = (np.concatenate(part) for part in zip(*layers, strict=True))
    # equally near pieces keep their order along the fiber
    order = np.argsort(np.round(near / np.linalg.norm(size), 6), kind="stable")
    axes.add_collection(
        LineCollection(
            ends[order],
            linewidths=width[order],
            colors=colour[order],
            capstyle="round",  # no gaps where pieces meet
            rasterized=True,
            zorder=3,
        ),
        autolim=False,
    )


def _draw_faces(
    axes: Axes, camera: Camera, origin: NDArray, size: NDArray, values: NDArray, top: float | None
):
    """The field on the three faces that look towards the camera from behind the fibers."""
    nodes = values
    for axis in range(3):  # from cell centres to nodes, periodically
        nodes = 0.5 * (nodes + np.roll(nodes, 1, axis))
        nodes = np.concatenate([nodes, np.take(nodes, [0], axis)], axis)
    scale = Normalize(0, top or np.percentile(nodes, 99.5))
    for axis in range(3):
        side = 0 if camera.towards[axis] > 0 else -1
        face = np.take(nodes, side, axis)
        fraction = np.indices(face.shape) / (np.array(face.shape)[:, None, None] - 1)
        place = np.insert(fraction, axis, 0.0 if side == 0 else 1.0, axis=0)
        flat, _ = camera(origin + np.moveaxis(place, 0, -1) * size)
        image = axes.pcolormesh(
            flat[..., 0],
            flat[..., 1],
            face,
            cmap=_FLOW,
            norm=scale,
            shading="gouraud",
            rasterized=True,
            zorder=1,
        )
    return image


def _draw_edges(axes: Axes, camera: Camera, origin: NDArray, size: NDArray, front: bool) -> None:
    """The box's edges: those that meet in the corner nearest to the camera, or the others."""
    nearest = (camera.towards > 0).astype(int)
    edges = []
    for axis in range(3):
        for corner in np.indices((2, 2, 2)).reshape(3, -1).T:
            if corner[axis] == 0:
                end = corner.copy()
                end[axis] = 1
                others = np.delete(np.arange(3), axis)
                if np.array_equal(corner[others], nearest[others]) is front:
                    edges.append(camera(origin + np.stack([corner, end]) * size)[0])
    axes.add_collection(
        LineCollection(edges, colors="0.35" if front else "0.55", linewidths=0.9, zorder=4 if front else 2),
        autolim=False,
    )
