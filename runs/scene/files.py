"""Quantities read from the files of a scene, with places and units: one table for the log and for `check`."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from tireroad.fem.decks.compounds import SYSTEMS
from tireroad.runs.scene.plan import meets_road
from tireroad.runs.scene.road_cache import road_of
from tireroad.runs.scene.sections.file import FileSection, own_section
from tireroad.runs.scene.tables.scene import Scene

HEAD = ("file", "quantity", "read from", "unit", "gaps, remarks")
Row = tuple[str, str, str, str, str]


def read_of(scene: Scene, until: str | None = None) -> list[Row]:
    """Rows, by HEAD, of what a run to stage `until` reads of files: one for each quantity; none of a scene without files."""
    rows = [*_of_tire(scene), *(_of_road(scene) if meets_road(until) else [])]
    if scene.pattern is not None and scene.pattern.file:
        rows.append((Path(scene.pattern.file).name, "depth of the pattern", "", "m", ""))
    return rows


def table(rows: Sequence[Row]) -> list[str]:
    """These rows as lines of text under a title; none of no rows."""
    if not rows:
        return []
    widths = [max(len(row[k]) for row in (HEAD, *rows)) for k in range(len(HEAD))]
    lines = [
        "  ".join(cell.ljust(width) for cell, width in zip(row, widths, strict=True)).rstrip()
        for row in (HEAD, *rows)
    ]
    return ["files: what was read as what", *(f"  {line}" for line in lines)]


def _of_road(scene: Scene) -> list[Row]:
    """Columns, units, gaps and what was assumed of the road's files."""
    if scene.road is None or not scene.road.surface.files:
        return []
    name = " > ".join(file.name for file in scene.road.surface.files)
    road = road_of(scene.road.surface)
    rows = [
        (name, reading.quantity, reading.place, reading.unit, reading.remark)
        for reading in getattr(road, "readings", ())
    ]
    return [*rows, *((name, "remark", "", "", note) for note in getattr(road, "notes", ()))]


def _of_tire(scene: Scene) -> list[Row]:
    """The mesh of a deck, its unit, and its rubbers and cords."""
    tire = scene.tire
    shape = tire.shape
    if not isinstance(shape, FileSection):
        return []
    own, name = own_section(tire), Path(shape.file or shape.mesh or "").name
    mesh, unit = own.mesh, shape.length_unit
    units = f"{unit} of the file (tire.length_unit)" if unit in SYSTEMS else "m"
    size = f"{len(mesh.nodes)} nodes, {len(mesh.cells)} cells of the section"
    rows: list[Row] = [(name, "mesh", ", ".join(own.used[:2]), units, size)]
    for region, rubber in zip(mesh.regions, own.rubbers, strict=True):
        of = "the scene" if rubber is None else f"{rubber.model} of the file"
        rows.append((name, f"region {region}", of, "" if rubber is None else "Pa, kg/m3", ""))
    rows += [(name, f"cords {ply.name}", "the file", "Pa, m2, m, deg", "") for ply in own.plies]
    unused = ", ".join(own.unused) or "nothing"
    return [*rows, (name, "not used", "", "", unused)]
