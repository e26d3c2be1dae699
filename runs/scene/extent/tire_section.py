"""The tire of a scene as a section and its ring of elements, and the elements it has by default."""

from __future__ import annotations

from dataclasses import fields, replace
from typing import TYPE_CHECKING

import numpy as np

from tireroad.fem.sections.grid import Patch, PlyLine
from tireroad.fem.sections.ring import Ring
from tireroad.fem.sections.torus import Torus
from tireroad.runs.scene.extent.own_tire import own_free_unknowns, own_ring
from tireroad.runs.scene.tables.scene import Scene
from tireroad.runs.scene.tables.tire import Region, Tire

if TYPE_CHECKING:
    from tireroad.fem.sections.construction import Construction

# (segments, elements along the arc) where the scene does not say; by order.
MESHES = {1: (160, 32), 2: (100, 16), 3: (30, 14)}
OWN_SEGMENTS = 60  # around a tire from a file
RADIAL = (30, 26)  # segments, elements along the arc of a radial tire
NEAR_ROAD = 0.2  # footprint_size with a road


def with_elements(scene: Scene) -> Scene:
    """The scene with its elements chosen where it leaves them open.

    Order 3 unless the scene says how many elements there are: then 2, as finer ones are asked for by
    their number; and of a radial tire and a file, which have several layers. With a road, elements are
    smaller at the footprint.
    """
    tire, static = scene.tire, scene.static
    counted = tire.segments is not None or tire.elements_arc is not None
    order = tire.order or (2 if counted or tire.section != "torus" else 3)
    segments, along = {"file": (OWN_SEGMENTS, 1), "radial": RADIAL}.get(tire.section, MESHES[order])
    road = (static.load, static.deflection, static.road_height) != (None, None, None)
    chosen = replace(
        tire,
        order=order,
        segments=tire.segments or segments,
        elements_arc=tire.elements_arc or along,
        footprint_size=tire.footprint_size or (NEAR_ROAD if road else 1.0),
    )
    return replace(scene, tire=chosen)


def built(tire: Tire) -> Construction:
    """What a built-in radial tire is built of."""
    from tireroad.fem.sections.radial import radial

    return radial(tire.size)


def make_section(tire: Tire) -> Ring:
    """The shape of the tire and its elements."""
    if tire.section == "file":
        return own_ring(tire)
    if tire.section == "radial":
        given = tire.segments, tire.elements_arc, tire.order, tire.footprint_size
        return built(tire).ring(*given)
    torus, patches, plies = _torus(tire)
    return torus.ring(patches, plies)


def _torus(tire: Tire) -> tuple[Torus, list[Patch], list[PlyLine]]:
    names = {f.name for f in fields(Torus)} - {"half_angle"}
    given = {name: getattr(tire, name) for name in names}
    patches = [patch(i, region) for i, region in enumerate(tire.region)]
    plies = [
        PlyLine(c.name, tuple(np.radians(c.arc)), 1 - c.depth / tire.thickness) for c in tire.cords
    ]
    return Torus(half_angle=np.radians(tire.half_angle), **given), patches, plies


def patch(number: int, region: Region) -> Patch:
    """The part of a torus's section that a region is."""
    low, high = np.radians(region.arc)
    sides = {"left": ((-high, -low),), "right": ((low, high),)}
    arcs = sides.get(region.side, sides["left"] + sides["right"])
    return Patch(f"tire.region {number}", arcs, region.depth)


def free_unknowns(tire: Tire) -> int:
    """Displacement unknowns without the clamped bead faces."""
    if tire.section == "file":
        return own_free_unknowns(tire)
    if tire.section == "radial":
        section = make_section(tire).section
        held = len(np.unique(section.side(section.rim)))
        return 3 * tire.segments * tire.order * (len(section.nodes) - held)
    torus, patches, plies = _torus(tire)
    wall, arc = (len(line) - 1 for line in torus.lines(patches, plies))
    free = (tire.order * wall + 1) * (tire.order * arc - 1)
    return 3 * tire.segments * tire.order * free
