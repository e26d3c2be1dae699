"""`section = "torus"`: a wall between two circles; regions are given by arc, side and depth."""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from tireroad.fem.parameters import choice, integer, number
from tireroad.fem.sections.mesh2d import PlyLine, RegionPatch, Ring
from tireroad.fem.sections.torus import Torus
from tireroad.runs.scene.schema import Source
from tireroad.runs.scene.tables.tire import (
    AROUND_CROWN,
    CORDS_ARC,
    CORDS_DEPTH,
    WHOLE_WALL,
    Parts,
    Proportions,
    SectionKind,
    changed,
    cords_of,
    losses_of,
    section_kind,
)

if TYPE_CHECKING:
    from tireroad.fem.tire.cords import Cords
    from tireroad.fem.tire.material import Material
    from tireroad.runs.scene.tables.tire import CordsTable, RegionTable, TireTable

# Default (segments, elements along the arc) by order. Largest error of the 28 lowest frequencies of
# the unloaded torus, E = 480 MPa, against Fourier series around (bench.parts.harmonics): 28 x 16
# of order 3, 47,376 unknowns, 0.06 %, 0.23 % when graded for a road (30 x 14: 0.42 %); 100 x 16 of
# order 2, 55,800 unknowns, 1.4 to 1.75 %, at the same CPU time as 24 x 14 of order 3.
MESHES = {1: (160, 32), 2: (100, 16), 3: (28, 16)}

# (elements around, along) available to a search, for the order with the lowest cost per error.
FINER = (
    (16, 8),
    (20, 10),
    (24, 12),
    (28, 14),
    (34, 16),
    (40, 20),
    (48, 24),
    (58, 28),
    (70, 34),
    (84, 42),
)
ORDER = 3


@section_kind("torus", "a wall between two circles about the section's centre: the thesis's tire")
class TorusSection(SectionKind):
    """Order 3 by default, but 2 for a given number of elements, which are then usually finer."""

    air = False
    tread_law = "half-space"

    outer_radius: float = number(
        0.32, "m", "outer radius, from the axle to the crown", least=0.01, most=10
    )
    minor_radius: float = number(
        0.10, "m", "radius of the section circle, to its outer face", least=1e-3, most=10
    )
    thickness: float = number(0.012, "m", "thickness of the wall", least=1e-4, most=5)
    half_angle: float = number(
        120.0, "deg", "angle of the section from the crown to each bead", least=10, most=175
    )
    elements_arc: int | None = integer(
        None, "number of elements from bead to bead; absent: 16, of order 1 32", least=2, most=1000
    )
    elements_thickness: int = integer(1, "number of elements through the wall", least=1, most=20)
    grading: str = choice("bead", ("bead", "uniform"), "grading of the elements along the section")

    def elements(self, tire: TireTable) -> tuple[TorusSection, int, int]:
        counted = tire.segments is not None or self.elements_arc is not None
        order = tire.order or (2 if counted else 3)
        segments, along = MESHES[order]
        kind = replace(self, elements_arc=self.elements_arc or along)
        return kind, order, tire.segments or segments

    def proportions(self, tire: TireTable) -> Proportions:
        return Proportions(
            outer_radius=self.outer_radius,
            height=self.minor_radius,
            thickness=self.thickness,
            half_angle=self.half_angle,
            along=self.elements_arc,
            through=self.elements_thickness,
        )

    def check(self, tire: TireTable, source: Source) -> None:
        self._check_circles(source)
        for which, region in enumerate(tire.region):
            place = ("tire", "region", str(which))
            if region.name is not None:
                source.add(
                    (*place, "name"),
                    'is for section = "file": a region of a torus is given by arc, side and depth',
                )
            for key in ("arc", "depth"):
                low, high = getattr(region, key) or (0.0, 1.0)
                if low >= high:
                    source.add((*place, key), f"= [{low:g}, {high:g}] must ascend")
        for which in range(len(tire.cords)):
            self._check_cords(tire, which, source)

    def _check_circles(self, source: Source) -> None:
        """Check that wall, section circle and outer radius fit, and the beads clear the axle."""
        wall, minor, outer = self.thickness, self.minor_radius, self.outer_radius
        bead = outer - minor + minor * math.cos(math.radians(self.half_angle))
        problems = (
            (
                "thickness",
                wall >= minor,
                f"= {wall:g} m must be less than minor_radius = {minor:g} m",
            ),
            (
                "minor_radius",
                minor >= outer,
                f"= {minor:g} m must be less than outer_radius = {outer:g} m",
            ),
            (
                "half_angle",
                bead <= 0,
                f"= {self.half_angle:g} deg puts the beads at {bead:g} m from the axle: make it or "
                "minor_radius smaller",
            ),
        )
        _note(("tire",), problems, source)

    def _check_cords(self, tire: TireTable, which: int, source: Source) -> None:
        """Check that a line of cords lies within the wall and has a unique name."""
        cords, place = tire.cords[which], ("tire", "cords", str(which))
        depth, (low, high) = _place(cords)
        names = [other.name for other in tire.cords[:which]]
        wall = f"tire.thickness = {self.thickness:g} m"
        problems = (
            ("arc", low >= high, f"= [{low:g}, {high:g}] must ascend"),
            (
                "arc",
                max(-low, high) > self.half_angle,
                f"= [{low:g}, {high:g}] deg reaches beyond the beads, at tire.half_angle = "
                f"{self.half_angle:g} deg",
            ),
            (
                "depth",
                depth > self.thickness,
                f"= {depth:g} m lies outside the wall: at most {wall}",
            ),
            (
                "area",
                cords.area / cords.spacing > self.thickness,
                f"= {cords.area:g} m² every {cords.spacing:g} m is more cord than the wall of "
                f"{self.thickness:g} m has room for",
            ),
            (
                "name",
                cords.name in names,
                f'= "{cords.name}" is that of an earlier line (absent: "ply"): give each line its own',
            ),
            (
                "name",
                "/" in cords.name or cords.name in (".", ".."),
                f'= "{cords.name}" must hold no "/": results are named so',
            ),
        )
        _note(place, problems, source)

    def ring(self, tire: TireTable) -> Ring:
        torus, patches, plies = self._drawn(tire)
        return torus.ring(patches, plies)

    def free_unknowns(self, tire: TireTable) -> int:
        through, along = self.elements_thickness, self.elements_arc
        if tire.region or tire.cords:  # elements end at their edges, which may take more
            torus, patches, plies = self._drawn(tire)
            through, along = (len(line) - 1 for line in torus.lines(patches, plies))
        nodes = (tire.order * through + 1) * (
            tire.order * along - 1
        )  # of a section, not on its rim
        return 3 * tire.segments * tire.order * nodes

    def meshes(self, tire: TireTable) -> tuple[tuple[int, int], ...]:
        return FINER

    def search_order(self, tire: TireTable) -> int:
        return ORDER

    def elements_along(self, along: int) -> TorusSection:
        return replace(self, elements_arc=along)

    def coarser(self, tire: TireTable) -> TorusSection:
        return replace(self, elements_arc=self.elements_arc // 2)

    def parts(self, tire: TireTable) -> Parts:
        from tireroad.runs.scene.parts import material_table

        wall = tire.material
        assert wall is not None, "a torus has a wall of one material"
        lies = {"depth": CORDS_DEPTH, "arc": list(CORDS_ARC)}
        return Parts({}, {}, {"material": material_table(wall.law, wall.model, wall.density)}, lies)

    def rubbers(self, tire: TireTable) -> dict[str, Material]:
        return {"wall": rubber(tire)} | {
            patch(i, region).name: rubber(tire, region) for i, region in enumerate(tire.region)
        }

    def cords(self, tire: TireTable) -> list[Cords]:
        return [cords_of(line) for line in tire.cords]

    def _drawn(self, tire: TireTable) -> tuple[Torus, list[RegionPatch], list[PlyLine]]:
        """The torus, and the parts of its section with a compound or cords of their own."""
        torus = Torus(
            outer_radius=self.outer_radius,
            minor_radius=self.minor_radius,
            thickness=self.thickness,
            half_angle=np.radians(self.half_angle),
            segments=tire.segments,
            elements_arc=self.elements_arc,
            elements_thickness=self.elements_thickness,
            order=tire.order,
            grading=self.grading,
            footprint_size=tire.footprint_size,
        )
        plies = []
        for line in tire.cords:
            depth, arc = _place(line)
            plies.append(PlyLine(line.name, tuple(np.radians(arc)), 1 - depth / self.thickness))
        return torus, [patch(i, region) for i, region in enumerate(tire.region)], plies


def _note(
    place: tuple[str, ...], problems: Iterable[tuple[str, bool, str]], source: Source
) -> None:
    """Note the first of the problems (key, whether it exists, text); others may be consequences."""
    for key, wrong, text in problems:
        if wrong:
            source.add((*place, key), text)
            return


def _place(line: CordsTable) -> tuple[float, tuple[float, float]]:
    """Depth (m) and arc (deg) of a line of cords."""
    return CORDS_DEPTH if line.depth is None else line.depth, line.arc or CORDS_ARC


def patch(which: int, region: RegionTable) -> RegionPatch:
    """The part of the section described by a [[tire.region]]."""
    low, high = np.radians(region.arc or AROUND_CROWN)
    sides = {"left": ((-high, -low),), "right": ((low, high),)}
    arcs = sides.get(region.side or "both", sides["left"] + sides["right"])
    return RegionPatch(f"tire.region {which}", arcs, region.depth or WHOLE_WALL)


def rubber(tire: TireTable, region: RegionTable | None = None) -> Material:
    """The compound of the wall, or of one of its regions; keys that a region leaves out are taken from [tire]."""
    from tireroad.fem.tire.material import Material

    assert tire.material is not None, "a torus has a wall of one material"
    wall = Material(
        law=tire.material.law, density=tire.material.density, **losses_of(tire, tire.material.law)
    )
    return changed(wall, region)
