"""The toroidal tire: a wall between two circles about the section's centre."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from tireroad.fem.errors import InputError
from tireroad.fem.parameters import Limits, ParameterError, finite, whole
from tireroad.fem.sections import mesh2d
from tireroad.fem.sections.mesh2d import (
    ARC_NEAR,
    SIZE,
    PlyLine,
    RegionPatch,
    Ring,
    SectionMesh,
    element_corners,
    near_road,
    product_mesh,
    ring_corners,
)

LEAST = (6, 2)  # elements around and along: minimum for a tire
# What a section can be made of; those of a scene's tire are narrower.
_WHOLE = {
    "segments": Limits(least=3),
    "elements_arc": Limits(least=1),
    "elements_thickness": Limits(least=1),
    "order": Limits(least=1, most=3),
}
_REAL = {
    "outer_radius": Limits(),
    "minor_radius": Limits(),
    "thickness": Limits(),
    "half_angle": Limits(),
    "footprint_size": SIZE,
}

# A belt ends in a singularity. Ten lowest frequencies of the belted torus
# (tests/verification/test_belted_torus), largest excess over the reference for n = 0, 1, 2: 16
# elements along the arc 1.0 %, 20 elements 0.7 %; ungraded with 16, 20, 24 and 32 elements: 1.8,
# 1.3, 0.8 and 0.5 %. More than one layer per ply gains nothing.
_ENDS, _ENDS_DEPTH = np.radians(8), 0.7


@dataclass(frozen=True, kw_only=True)
class Torus:
    """A toroidal tire: section circle of outer radius `minor_radius` about the axle (y).

    Lengths in m; `half_angle` in rad: arc from the crown to each bead. `segments` elements around,
    `elements_arc` along the arc, `elements_thickness` through the wall, all of `order`;
    `footprint_size`: relative element length at the road. InputError for a value of wrong kind or
    out of range.
    """

    outer_radius: float
    minor_radius: float
    thickness: float
    half_angle: float
    segments: int
    elements_arc: int
    elements_thickness: int
    order: int
    grading: str = "bead"
    footprint_size: float = 1.0

    def __post_init__(self) -> None:
        self._check(_WHOLE, whole)
        self._check(_REAL, finite)
        if not 0 < self.half_angle < math.pi:
            raise InputError(
                f"torus: half_angle = {self.half_angle:g} rad must lie between 0 and pi: it is in radians"
            )
        # A minor radius larger than the outer one gives a barrel, up to the cylinder of closed
        # forms.
        least = min(self.minor_radius, self.outer_radius)
        if not 0 < self.thickness < least:
            raise InputError(
                f"torus: thickness = {self.thickness:g} m must be above 0 and less than minor_radius = "
                f"{self.minor_radius:g} m and outer_radius = {self.outer_radius:g} m"
            )

    def _check(self, ranges: Mapping[str, Limits], read: Callable[[object], float]) -> None:
        for name, limits in ranges.items():
            try:
                limits.check(read(getattr(self, name)), "-")
            except ValueError as error:
                raise ParameterError(name, str(error), "torus") from None

    @property
    def ring_corners(self) -> np.ndarray:
        """Angles of the element corners around the axle, rad, from the lowest point towards +x."""
        return ring_corners(self.segments, self.footprint_size)

    def arc_corners(self, between: Sequence[float] = (), ends: Sequence[float] = ()) -> np.ndarray:
        """Angles of the element corners along the section, rad, bead to bead, 0 at the crown.

        Corners are placed at the angles `between` and their mirror images; elements are smaller at
        `ends`, which are among them.
        """
        both = np.concatenate([between, -np.asarray(between)])
        half, size = self.half_angle, self._size

        def density(arc: np.ndarray) -> np.ndarray:
            return 1 / (size(arc) * _near_ends(arc, ends))

        return element_corners(self.elements_arc, density, -half, half, both)

    def _size(self, arc: np.ndarray) -> np.ndarray:
        """Relative element size at a section angle."""
        near = near_road(np.abs(arc), self.footprint_size, ARC_NEAR)
        if self.grading != "bead":
            return near
        edge = self.half_angle - np.abs(arc)
        length = 2 * self.half_angle
        floor = mesh2d.LEAST * self.thickness / self.minor_radius / self.elements_arc
        return near * mesh2d.graded_size(edge, length, self.elements_arc, floor)

    def section(
        self, patches: Sequence[RegionPatch] = (), plies: Sequence[PlyLine] = ()
    ) -> SectionMesh:
        """The section mesh, with edges exactly on the boundaries of patches and on plies."""
        wall, arc = self.lines(patches, plies)
        return product_mesh(
            order=self.order, wall=wall, arc=arc, place=self._place, patches=patches, plies=plies
        )

    def lines(
        self, patches: Sequence[RegionPatch], plies: Sequence[PlyLine]
    ) -> tuple[np.ndarray, np.ndarray]:
        """Corners through the wall, as fractions of it, and along the arc, rad."""
        arcs = [end for patch in patches for arc in patch.arcs for end in arc]
        ends = [end for ply in plies for end in ply.arc]
        arcs, ends = (
            [end for end in angles if abs(end) < self.half_angle * (1 - 1e-9)]
            for angles in (arcs + ends, ends)
        )
        depths = [end for patch in patches for end in patch.depth]
        depths += [ply.depth for ply in plies]
        wall = element_corners(self.elements_thickness, np.ones_like, 0.0, 1.0, depths)
        return wall, self.arc_corners(arcs, ends)

    def ring(self, patches: Sequence[RegionPatch] = (), plies: Sequence[PlyLine] = ()) -> Ring:
        """The ring of elements, with edges exactly on the boundaries of patches and on plies."""

        def coarser() -> Ring | None:
            around, along = self.segments // 2, self.elements_arc // 2
            if around < LEAST[0] or along < LEAST[1]:
                return None
            half = replace(self, segments=around, elements_arc=along)
            return half.ring(patches, plies)

        return Ring(
            section=self.section(patches, plies),
            ring_corners=self.ring_corners,
            arc_corners=self.lines(patches, plies)[1],
            thickness=self.thickness,
            height=self.minor_radius,
            coarser=coarser,
        )

    def _place(self, depth: np.ndarray, arc: np.ndarray) -> np.ndarray:
        inner = self.minor_radius - self.thickness
        wall = np.where(depth == 1.0, self.minor_radius, inner + depth * self.thickness)
        reach = self.outer_radius - self.minor_radius + wall * np.cos(arc)
        return np.stack([reach, wall * np.sin(arc)], axis=-1)


def _near_ends(angle: np.ndarray, ends: Sequence[float]) -> np.ndarray:
    """Relative element size at section angles, rad, near the ends of plies (both sides)."""
    if not len(ends):
        return np.ones_like(angle)
    both = np.concatenate([ends, -np.asarray(ends)])
    distance = np.abs(angle[:, None] - both).min(axis=1)
    return 1 - _ENDS_DEPTH * np.exp(-((distance / _ENDS) ** 2))
