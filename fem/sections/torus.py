"""The toroidal tire: a wall between two circles about the section's centre."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from tireroad.fem.sections.grid import Patch, PlyLine, corners, product
from tireroad.fem.sections.mesh2d import SectionMesh
from tireroad.fem.sections.ring import Ring

LEAST = (6, 2)  # elements around and along: below, a tire is none


@dataclass(frozen=True)
class Torus:
    """A toroidal tire: section circle of `minor_radius` (to its outer face) about the axle (y).

    Lengths in m, `half_angle` in rad: the arc from the crown to each bead. `segments` elements
    around, `elements_arc` along the arc, `elements_thickness` through the wall, all of `order`;
    elements where the road touches are `footprint_size` times as long as they would be otherwise.
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

    @property
    def ring_corners(self) -> np.ndarray:
        """Angles of the element corners around the axle, rad, from the lowest point towards +x."""
        return ring_corners(self.segments, self.footprint_size)

    def arc_corners(self, between: Sequence[float] = (), ends: Sequence[float] = ()) -> np.ndarray:
        """Angles of the element corners along the section, rad, bead to bead; the crown is 0.

        With corners at the angles `between` and at their mirror images; smaller elements at `ends`, which
        are among them.
        """
        plain = self.half_angle * graded(self.elements_arc, self._size)
        if not len(between):
            return plain
        # The same sizes as without: density by the plain corners, each element one.
        size = np.diff(plain)
        middle = (plain[1:] + plain[:-1]) / 2
        both = np.concatenate([between, -np.asarray(between)])
        return corners(
            self.elements_arc,
            lambda x: 1 / (np.interp(x, middle, size) * _near_ends(x, ends)),
            -self.half_angle,
            self.half_angle,
            both,
        )

    def _size(self, t: np.ndarray) -> np.ndarray:
        # The clamped edge is singular: at the bead an element is _BEAD times the uniform one.
        bead = _BEAD + (1 - _BEAD) * np.pi / 2 * np.cos(np.pi / 2 * t)
        near = near_road(np.abs(t), self.footprint_size)
        return near * (bead if self.grading == "bead" else 1.0)

    def section(self, patches: Sequence[Patch] = (), plies: Sequence[PlyLine] = ()) -> SectionMesh:
        """The section's elements, with edges exactly on those of patches and on plies."""
        wall, arc = self._lines(patches, plies)
        return product(
            order=self.order, wall=wall, arc=arc, place=self._place, patches=patches, plies=plies
        )

    def _lines(self, patches: Sequence[Patch], plies: Sequence[PlyLine]):
        """Corners through the wall, as shares of it, and along the arc, rad."""
        arcs = [end for patch in patches for arc in patch.arcs for end in arc]
        ends = [end for ply in plies for end in ply.arc]
        arcs, ends = (
            [end for end in angles if abs(end) < self.half_angle * (1 - 1e-9)]
            for angles in (arcs + ends, ends)
        )
        depths = [end for patch in patches for end in patch.depth]
        depths += [ply.depth for ply in plies]
        wall = corners(self.elements_thickness, np.ones_like, 0.0, 1.0, depths)
        return wall, self.arc_corners(arcs, ends)

    def ring(self, patches: Sequence[Patch] = (), plies: Sequence[PlyLine] = ()) -> Ring:
        """The tire's elements, with edges exactly on those of patches and on plies."""

        def coarser() -> Ring | None:
            around, along = self.segments // 2, self.elements_arc // 2
            if around < LEAST[0] or along < LEAST[1]:
                return None
            half = replace(self, segments=around, elements_arc=along)
            return half.ring(patches, plies)

        return Ring(
            section=self.section(patches, plies),
            ring_corners=self.ring_corners,
            arc_corners=self._lines(patches, plies)[1],
            thickness=self.thickness,
            height=self.minor_radius,
            coarser=coarser,
        )

    def _place(self, depth: np.ndarray, arc: np.ndarray) -> np.ndarray:
        inner = self.minor_radius - self.thickness
        wall = np.where(depth == 1.0, self.minor_radius, inner + depth * self.thickness)
        reach = self.outer_radius - self.minor_radius + wall * np.cos(arc)
        return np.stack([reach, wall * np.sin(arc)], axis=-1)


# First frequency of the unloaded torus, 16 segments, 8, 12 and 16 elements along the arc, above that of
# 36: 7.3, 2.1 and 0.8 % at 0.3; 7.9, 2.1, 0.8 % at 0.2; 6.9, 2.1, 1.0 % at 0.5; 9.7, 3.2, 1.7 % ungraded.
_BEAD = 0.3
# A belt ends in a singularity. Ten lowest frequencies of the belted torus (tests/verification/test_belted_torus),
# worst of n = 0, 1, 2 above the reference: 16 elements along the arc 1.0 %, 20 elements 0.7 %;
# ungraded, 16, 20, 24 and 32 elements: 1.8, 1.3, 0.8 and 0.5 %; more layers than one a ply gain nothing.
_ENDS, _ENDS_DEPTH = np.radians(8), 0.7
_NEAR = 0.4  # of the elements on either side of the footprint: enough, and a soft change


def _near_ends(angle: np.ndarray, ends: Sequence[float]) -> np.ndarray:
    """Relative element size at section angles, rad, for the ends of plies and their mirror images."""
    if not len(ends):
        return np.ones_like(angle)
    both = np.concatenate([ends, -np.asarray(ends)])
    distance = np.abs(angle[:, None] - both).min(axis=1)
    return 1 - _ENDS_DEPTH * np.exp(-((distance / _ENDS) ** 2))


def near_road(distance: np.ndarray, footprint_size: float) -> np.ndarray:
    """Relative element size at a distance from the footprint, by element count, 0 to 1."""
    return 1 - (1 - footprint_size) * np.exp(-((distance / _NEAR) ** 2))


def ring_corners(segments: int, footprint_size: float) -> np.ndarray:
    """Angles of the element corners around the axle, rad, from the lowest point towards +x."""
    sizes = graded(segments, lambda t: near_road(1 - np.abs(t), footprint_size))
    return np.pi + np.pi * sizes


def graded(count: int, size: Callable[[np.ndarray], np.ndarray]) -> np.ndarray:
    """Corners of `count` elements over [-1, 1] whose lengths follow size(t), t in [-1, 1] by count.

    The size must be even in t; so are the corners then, to the last bit, and a symmetric tire
    keeps its mirror planes.
    """
    t, weight = np.polynomial.legendre.leggauss(8)
    middle = (2 * np.arange(count) + 1) / count - 1
    lengths = size(middle[:, None] + t / count) @ weight
    lengths = lengths + lengths[::-1]
    corners = np.concatenate([[0.0], np.cumsum(lengths)])
    corners = 2 * corners / corners[-1] - 1
    return (corners - corners[::-1]) / 2
