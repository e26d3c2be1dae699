"""Figures of the tire's outer face and of the footprint, as data URIs.

Surfaces are projected and sorted here: mplot3d takes 0.3 s per view for 4,000 quads, this 0.05 s.
"""

from __future__ import annotations

import hashlib
from collections import OrderedDict
from collections.abc import Callable, Sequence
from functools import wraps
from typing import Any, ParamSpec

import numpy as np
from matplotlib.axes import Axes
from matplotlib.cm import ScalarMappable
from matplotlib.collections import LineCollection, PolyCollection
from matplotlib.colors import LinearSegmentedColormap, Normalize
from matplotlib.tri import Triangulation
from numpy.typing import NDArray

from tireroad.runs.report.figures import COLOURS, MUTED, WIDE, bare_canvas, canvas, encode, styled

P = ParamSpec("P")

MOST = 16  # figures, each up to some hundred kB
_drawn: OrderedDict[bytes, str] = OrderedDict()
PRESSURE = LinearSegmentedColormap.from_list(
    "pressure", ("#ffffff", "#fdd9a0", "#f59053", "#d4402f", "#7f1d3f", "#2b0a2e")
)
VIEW = (np.radians(-55.0), np.radians(18.0))  # azimuth of the viewer from +x, elevation
BULGE = 0.14  # largest drawn displacement of a mode over the tire's radius
COLUMNS = 64  # most cells along x in the space-time map
DARKEST = 0.99  # of the touching points lie below the end of the colour scale


def once(draw: Callable[P, str]) -> Callable[P, str]:
    """Decorate `draw` to keep its latest figures and reuse them for bitwise equal arguments."""

    @wraps(draw)
    def drawn(*given: P.args, **named: P.kwargs) -> str:
        key = _digest(draw.__qualname__, given, sorted(named.items()))
        if key not in _drawn:
            _drawn[key] = draw(*given, **named)
        _drawn.move_to_end(key)
        while len(_drawn) > MOST:
            _drawn.popitem(last=False)
        return _drawn[key]

    return drawn


def _digest(*given: Any) -> bytes:
    """Hash of arrays by their bytes, of sequences item by item, of anything else by its repr."""
    digest = hashlib.sha256()
    for value in given:
        if isinstance(value, np.ndarray):
            digest.update(
                f"{value.dtype}{value.shape}".encode() + np.ascontiguousarray(value).tobytes()
            )
        elif isinstance(value, list | tuple):
            digest.update(f"{len(value)}".encode() + _digest(*value))
        else:
            digest.update(repr(value).encode())
        digest.update(b"\0")
    return digest.digest()


def camera(azimuth: float, elevation: float) -> NDArray:
    """Rows: right, up and towards the viewer, (3, 3)."""
    ca, sa, ce, se = np.cos(azimuth), np.sin(azimuth), np.cos(elevation), np.sin(elevation)
    return np.array(((-sa, ca, 0.0), (-se * ca, -se * sa, ce), (ce * ca, ce * sa, se)))


def paint(axes: Axes, points: NDArray, quads: NDArray, colours: NDArray) -> None:
    """Draw the quads (q, 4) of points (s, 3), far ones first, lit from the upper left."""
    seen = (points @ camera(*VIEW).T)[quads]
    normal = np.cross(seen[:, 2] - seen[:, 0], seen[:, 3] - seen[:, 1])
    length = np.linalg.norm(normal, axis=1, keepdims=True)
    normal *= np.where(normal[:, 2:] < 0.0, -1.0, 1.0) / np.maximum(length, 1e-300)
    light = 0.55 + 0.45 * np.clip(normal @ (-0.35, 0.55, 0.76), 0.0, 1.0)
    order = np.argsort(seen[:, :, 2].mean(axis=1))
    shaded = np.column_stack((colours[:, :3] * light[:, None], np.ones(len(quads))))[order]
    axes.add_collection(
        PolyCollection(seen[order][:, :, :2], facecolors=shaded, edgecolors=shaded, linewidths=0.3)
    )
    axes.set_aspect("equal")
    axes.axis("off")
    axes.autoscale_view()


def paint_road(axes: Axes, height: float, reach: float) -> None:
    """Draw the road plane z = height (m) as a square of half width `reach` (m), behind all else."""
    square = reach * np.array(((-1, -1), (1, -1), (1, 1), (-1, 1)))
    corners = np.column_stack((square, np.full(4, height))) @ camera(*VIEW).T
    axes.add_collection(
        PolyCollection([corners[:, :2]], facecolors="#d9dee4", edgecolors=MUTED, zorder=0)
    )


def cut(
    points: NDArray, quads: NDArray, distance: NDArray, keep: NDArray
) -> tuple[NDArray, NDArray]:
    """Cut the surface where `distance` (s) changes sign.

    Returns node pairs (n, 2, 2) and the weight (n, 2) of the second node of each, which interpolate
    any field on the surface to the cut. Only quads for which `keep` (q) holds are cut.
    """
    value = np.where(distance == 0.0, 1e-12, distance)[quads]
    crossed = (value > 0) != (np.roll(value, -1, axis=1) > 0)
    chosen = np.flatnonzero((crossed.sum(axis=1) == 2) & keep)
    edge = np.nonzero(crossed[chosen])[1].reshape(-1, 2)
    row = chosen[:, None]
    ends = np.stack((quads[row, edge], quads[row, (edge + 1) % 4]), -1)
    start, stop = value[row, edge], value[row, (edge + 1) % 4]
    return ends, start / (start - stop)


def carry(field: NDArray, ends: NDArray, weight: NDArray) -> NDArray:
    """Interpolate a field (s, 3) to the segments (n, 2, 3) of a cut."""
    return field[ends[..., 0]] * (1 - weight[..., None]) + field[ends[..., 1]] * weight[..., None]


@once
@styled
def deformed(points: NDArray, moved: NDArray, quads: NDArray, road: float | None) -> str:
    """The loaded tire in three panels: surface, side view, section below; `road` (m) or None."""
    figure, axes = bare_canvas(
        WIDE, 4.7, 2, 2, gridspec_kw={"width_ratios": (1.2, 1.0), "height_ratios": (1.45, 1)}
    )
    figure.subplots_adjust(0.01, 0.1, 0.97, 0.94, 0.25, 0.5)
    for here in axes[1]:
        here.remove()
    size = 1e3 * np.linalg.norm(moved, axis=1)
    scale = ScalarMappable(Normalize(size.min(), max(size.max(), 1e-9)), "YlGnBu")
    if road is not None:
        paint_road(axes[0, 0], road, 1.05 * np.abs(points[:, 0]).max())
    paint(axes[0, 0], points + moved, quads, scale.to_rgba(size[quads].mean(axis=1)))
    beside = axes[0, 0].inset_axes((0.2, -0.06, 0.6, 0.035))
    figure.colorbar(scale, cax=beside, orientation="horizontal", label="displacement in mm")
    everywhere = np.ones(len(quads), dtype=bool)
    middle = cut(points, quads, points[:, 1], everywhere)
    _profile(axes[0, 1], points, moved, (0, 2), [(middle, COLOURS[0], "loaded")], road)
    axes[0, 1].set(title="side view, middle of the tread", xlabel="x in mm", ylabel="z in mm")
    lower = points[quads][:, :, 2].mean(axis=1) < 0.0
    bottom = cut(points, quads, points[:, 0], lower)
    top = cut(points, quads, points[:, 0], ~lower)
    shown = [(top, COLOURS[1], "opposite (turned)"), (bottom, COLOURS[0], "over the road")]
    section = figure.add_subplot(axes[1, 0].get_gridspec()[1, :])
    _profile(section, points, moved, (1, 2), shown, road)
    section.set(title="section under the axle", xlabel="y in mm", ylabel="z in mm")
    return encode(figure, "png")


def _profile(
    axes: Axes,
    points: NDArray,
    moved: NDArray,
    plane: tuple[int, int],
    cuts: Sequence[tuple[tuple[NDArray, NDArray], str, str]],
    road: float | None,
) -> None:
    """Draw cuts of the undeformed (dashed) and deformed tire in the plane of two coordinates."""
    ends, weight = cuts[-1][0]
    before = carry(points, ends, weight)[:, :, plane] * 1e3
    axes.add_collection(LineCollection(before, colors=MUTED, linewidths=0.9, label="as made"))
    for (ends, weight), colour, label in cuts:
        line = carry(points + moved, ends, weight)
        if line[..., 2].mean() > 1e-3:  # turn down the half above the axle, for comparison
            line = line * (1, 1, -1)
        drawn = 1e3 * line[:, :, plane]
        axes.add_collection(LineCollection(drawn, colors=colour, linewidths=1.4, label=label))
    if road is not None:
        axes.axhline(1e3 * road, color="#52606d", lw=1.2, label="road")
    axes.set_aspect("equal")
    axes.autoscale_view()
    axes.legend(loc="center" if plane[0] == 0 else "upper center", fontsize=8)


@once
@styled
def modes(points: NDArray, quads: NDArray, shapes: NDArray, titles: Sequence[str]) -> str:
    """Mode shapes (m, s, 3), m ≤ 6, exaggerated; coloured by the normal displacement."""
    rows = 1 + (len(titles) > 3)
    height = 2.3 * rows
    # Axes without labels need no layout, which would take as long as the drawing.
    figure, axes = bare_canvas(WIDE, height, rows, 3)
    figure.subplots_adjust(0.0, 0.6 / height, 1.0, 1 - 0.25 / height, 0.05, 0.1)
    radius = np.hypot(points[:, 0], points[:, 2]).max()
    normal = outward(points, quads)
    for here in axes.flat[len(titles) :]:
        here.axis("off")
    for here, shape, title in zip(axes.flat, shapes, titles, strict=False):
        greatest = max(np.linalg.norm(shape, axis=1).max(), 1e-300)
        across = np.einsum("si,si->s", shape, normal) / greatest
        scale = ScalarMappable(Normalize(-1.0, 1.0), "RdBu_r")
        drawn = points + BULGE * radius / greatest * shape
        paint(here, drawn, quads, scale.to_rgba(across[quads].mean(axis=1)))
        here.set_title(title)
    beside = figure.add_axes((0.3, 0.42 / height, 0.4, 0.1 / height))
    label = "displacement along the normal"
    figure.colorbar(scale, cax=beside, orientation="horizontal", label=label)
    return encode(figure, "png", dpi=110)


def outward(points: NDArray, quads: NDArray) -> NDArray:
    """Unit normals (s, 3), pointing away from the middle of the section."""
    corners = points[quads]
    flat = np.cross(corners[:, 2] - corners[:, 0], corners[:, 3] - corners[:, 1])
    normal = np.zeros_like(points)
    np.add.at(normal, quads.ravel(), np.repeat(flat, 4, axis=0))
    radius = np.hypot(points[:, 0], points[:, 2])
    core = 0.5 * (radius.min() + radius.max())
    ring = points * (core / np.maximum(radius, 1e-300))[:, None] * (1, 0, 1)
    side = np.einsum("si,si->s", normal, points - ring)
    length = np.linalg.norm(normal, axis=1)
    return normal * (np.where(side < 0, -1.0, 1.0) / np.maximum(length, 1e-300))[:, None]


def darkest(values: NDArray) -> float:
    """End of a colour scale of pressures or forces: a few points on tips of stones bear many times more."""
    touching = values[values > 0]
    return float(np.quantile(touching, DARKEST)) if touching.size else 1e-12


@once
@styled
def footprints(
    points: NDArray,
    maps: Sequence[NDArray],
    titles: Sequence[str],
    unit: str,
    top: float | None = None,
) -> str:
    """Maps (c) of pressure or force at contact points (c, 3) m, two per row, one colour scale to `top`."""
    place = 1e3 * points[:, :2]
    touched = np.any([values > 0 for values in maps], axis=0)
    low, high = frame(place[touched] if touched.any() else place)
    columns = min(len(maps), 2)
    rows, panel = -(-len(maps) // columns), (WIDE - 1.6) / columns
    height = np.clip(panel * (high[1] - low[1]) / (high[0] - low[0]) + 0.8, 1.7, 4.5)
    figure, axes = canvas(WIDE, rows * height, rows, columns, sharex=True, sharey=True)
    largest = max(np.nan_to_num(values).max(initial=0.0) for values in maps)
    top = max(largest, 1e-12) if top is None else top
    scale, mesh = Normalize(0.0, top), triangles(place)
    for here, values, title in zip(axes.flat, maps, titles, strict=True):
        if mesh is not None:
            shown = np.nan_to_num(values)
            here.tripcolor(mesh, shown, shading="gouraud", cmap=PRESSURE, norm=scale)
        active = values > 0
        here.plot(*place[~active].T, ".", ms=2.0, color="#c3cbd4")
        dots = here.scatter(*place[active].T, s=9, c=values[active], cmap=PRESSURE, norm=scale)
        dots.set(edgecolor="#3e4c59", linewidth=0.4)
        here.set(title=title, xlabel="x (forward) in mm", ylabel="y (axle) in mm", aspect="equal")
        here.label_outer()
        here.set(xlim=(low[0], high[0]), ylim=(low[1], high[1]))
        here.grid(visible=False)
    beyond = "max" if largest > top else "neither"
    figure.colorbar(ScalarMappable(scale, PRESSURE), ax=axes, label=unit, pad=0.01, extend=beyond)
    return encode(figure, "png")


def frame(place: NDArray) -> tuple[NDArray, NDArray]:
    """Corners of a frame around points (n, 2) mm, wider by a fifth, at least 10 mm, all round."""
    low, high = place.min(axis=0), place.max(axis=0)
    margin = np.maximum(0.2 * (high - low), 10.0)
    return low - margin, high + margin


def triangles(place: NDArray) -> Triangulation | None:
    """Delaunay triangles of points (c, 2), or None if they are too few or collinear."""
    if len(place) < 3 or np.linalg.matrix_rank(place - place[0], tol=1e-9) < 2:
        return None
    return Triangulation(*place.T)


@styled
def space_time(time: NDArray, points: NDArray, force: NDArray) -> str:
    """Normal force (n, c) N at n > 1 instants, summed across the width, over time and x.

    Each point's force is split linearly between the two nearest cells of a row; cells are as wide
    as the widest gap between points. This preserves the sum and leaves no cell empty between
    columns of nodes.
    """
    place = np.sort(1e3 * points[:, 0])
    extent = max(place[-1] - place[0], 1e-9)
    count = int(np.clip(extent / max(np.diff(place).max(initial=0.0), 1e-9) + 1.01, 2, COLUMNS))
    centres = np.linspace(place[0], place[-1], count)
    width = centres[1] - centres[0]
    share = np.maximum(1.0 - np.abs(1e3 * points[:, :1] - centres) / width, 0.0)
    figure, axes = canvas(WIDE, 2.6)
    picture = axes[0, 0].imshow(
        (np.nan_to_num(force) @ share).T / width,
        extent=(time[0], time[-1], place[0] - width / 2, place[-1] + width / 2),
        origin="lower",
        aspect="auto",
        cmap=PRESSURE,
        vmin=0.0,
        interpolation="bilinear",
    )
    axes[0, 0].grid(visible=False)
    axes[0, 0].set(xlabel="time in s", ylabel="x (forward) in mm")
    figure.colorbar(picture, ax=axes, label="force in N per mm", pad=0.01)
    return encode(figure, "png", dpi=110)
