"""A drawing of a scene's section: regions, lines of cords with angles, inner face, tread and rim."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import numpy as np
from matplotlib import colormaps
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection, PolyCollection
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch
from numpy.typing import NDArray

from tireroad.fem.sections.mesh2d import SectionMesh
from tireroad.runs.report.figures import canvas, styled
from tireroad.runs.scene.tables.scene import Scene

_CURVE = np.linspace(0, 1, 7)  # positions along a side at which it is drawn
_FACES = {"inner": "#2f6db5", "tread": "#3e4c59", "rim": "#c8502d"}
NAME = "section.png"


@styled
def draw_section(mesh: SectionMesh, angles: Mapping[str, float] | None = None) -> Figure:
    """The section seen along the road's x: y to the right, axle at the top, tread below; mm.

    `angles`: degrees to the circumference, by the names of the plies.
    """
    width, height = np.ptp(mesh.nodes[:, 1]), np.ptp(mesh.nodes[:, 0])
    figure, ((axes,),) = canvas(8.0, min(max(6.5 * height / width + 1.8, 4.0), 14.0))
    regions = _regions(axes, mesh)
    cords = _plies(axes, mesh, angles or {})
    faces = _faces(axes, mesh)
    axes.set_aspect("equal")
    axes.autoscale_view()
    axes.invert_yaxis()
    axes.set_xlabel("y, along the axle, mm")
    axes.set_ylabel("r, from the axle, mm")
    axes.set_title(f"Section: {len(mesh.cells)} elements, {len(mesh.nodes)} nodes")
    handles = [*regions, *cords, *faces]
    axes.legend(handles=handles, loc="upper center", bbox_to_anchor=(0.5, -0.1), ncol=3, fontsize=8)
    return figure


def save_section(
    mesh: SectionMesh, path: Path, angles: Mapping[str, float] | None = None, dpi: int = 150
) -> None:
    """Write the drawing as a PNG."""
    draw_section(mesh, angles).savefig(path, dpi=dpi, bbox_inches="tight")


def _curves(mesh: SectionMesh, edges: NDArray) -> NDArray:
    """Points (k, 7, 2) of (y, r) in mm along the sides (k, 2) of cells."""
    cell, side = (np.repeat(part, len(_CURVE)) for part in edges.T)
    along, fixed = np.tile(_CURVE, len(edges)), (side % 2).astype(float)
    xi, eta = np.where(side < 2, fixed, along), np.where(side < 2, along, fixed)
    return 1e3 * mesh.at(cell, xi, eta)[:, ::-1].reshape(len(edges), len(_CURVE), 2)


def _regions(axes: Axes, mesh: SectionMesh) -> list[Patch]:
    """Fill all cells with the colour of their region; returns the legend entries."""
    cells = np.arange(len(mesh.cells))
    sides = [_curves(mesh, np.column_stack([cells, np.full_like(cells, s)])) for s in range(4)]
    outline = np.concatenate([sides[2], sides[1], sides[3][:, ::-1], sides[0][:, ::-1]], axis=1)
    colours = colormaps["tab20"](np.linspace(0.05, 1, max(len(mesh.regions), 2)) % 1)
    colours[:, 3] = 0.55
    fill = PolyCollection(
        outline, facecolors=colours[mesh.region], edgecolors="#7b8794", linewidths=0.3
    )
    axes.add_collection(fill)
    return [Patch(color=colours[n], label=name) for n, name in enumerate(mesh.regions)]


def _plies(axes: Axes, mesh: SectionMesh, angles: Mapping[str, float]) -> list[Line2D]:
    """Draw each ply as a line, with its angle in the legend."""
    handles = []
    colours = colormaps["Dark2"](np.arange(max(len(mesh.plies), 1)) % 8)
    for (name, edges), colour in zip(mesh.plies.items(), colours, strict=False):
        axes.add_collection(LineCollection(_curves(mesh, edges), colors=[colour], linewidths=1.8))
        angle = f", {angles[name]:+.4g}°" if name in angles else ""
        handles.append(Line2D([], [], color=colour, lw=1.8, label=f"cords {name}{angle}"))
    return _shortened(handles)


def _shortened(handles: list[Line2D]) -> list[Line2D]:
    """At most fifteen legend entries."""
    if len(handles) <= 15:
        return handles
    more = Line2D([], [], color="none", label=f"and {len(handles) - 14} more")
    return [*handles[:14], more]


def _faces(axes: Axes, mesh: SectionMesh) -> list[Line2D]:
    handles = []
    for name, colour in _FACES.items():
        edges = getattr(mesh, name)
        style = {"colors": [colour], "linewidths": 3.0, "capstyle": "butt"}
        axes.add_collection(LineCollection(_curves(mesh, edges), **style))
        handles.append(Line2D([], [], color=colour, lw=3, label=f"{name}, {len(edges)} sides"))
    return handles


def write_section(scene: Scene, directory: Path) -> str:
    """Draw the section of the scene's tire; returns a message: where it is, or why it failed."""
    tire = scene.tire
    try:
        directory.mkdir(parents=True, exist_ok=True)
        save_section(tire.ring().section, directory / NAME, tire.shape.angles(tire))
    except OSError as error:
        return f"section not drawn: {directory / NAME}: {error.strerror}"
    return f"section drawn: {directory / NAME}"
