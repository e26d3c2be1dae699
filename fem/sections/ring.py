"""A section and the data for its revolution into a ring of elements."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from tireroad.fem.parameters import Limits
from tireroad.fem.sections.grid import corners
from tireroad.fem.sections.mesh2d import SectionMesh

SIZE = Limits(least=0.05, most=1.0)  # of elements at the footprint, relative to that elsewhere
# (from, to) rad: the footprint's element size holds up to the first, the full size from the second.
# A deflection of 20 mm reaches 0.35 rad along a ring of 0.32 m and 0.6 rad along a section of 0.1
# m.
RING_NEAR = (0.15, 1.2)
ARC_NEAR = (0.2, 1.2)


def near_road(distance: np.ndarray, footprint_size: float, near: tuple[float, float]) -> np.ndarray:
    """Relative element size at a distance (rad) from the lowest point, linear within `near`."""
    part = np.clip((distance - near[0]) / (near[1] - near[0]), 0.0, 1.0)
    return footprint_size + (1 - footprint_size) * part


def ring_corners(segments: int, footprint_size: float) -> np.ndarray:
    """Angles of the element corners, rad, from the lowest point (0) towards +x to 2 pi."""

    def density(angle: np.ndarray) -> np.ndarray:
        return 1 / near_road(np.pi - np.abs(angle - np.pi), footprint_size, RING_NEAR)

    return corners(segments, density, 0.0, 2 * np.pi)


@dataclass(frozen=True, kw_only=True)
class Ring:
    """The section revolved about the axle (y), `segments` elements of its order around.

    `ring_corners` (segments + 1,) rad: angles of the element corners, ascending from 0, the lowest
    point, towards +x to 2 pi, or less for a sector. `arc_corners` (k + 1,) rad: ascending section
    angles of the ends of the k outer-face edges, 0 at the crown, positive for y > 0. `thickness` m
    of a typical wall and `height` m of the section: scales of motions. `coarser`: the same tire
    with elements of about twice the size, None if there is none.
    """

    section: SectionMesh
    ring_corners: np.ndarray
    arc_corners: np.ndarray
    thickness: float
    height: float
    coarser: Callable[[], Ring | None] = lambda: None

    @property
    def segments(self) -> int:
        """Number of elements around."""
        return len(self.ring_corners) - 1

    @property
    def order(self) -> int:
        """Element order."""
        return self.section.order

    @property
    def closed(self) -> bool:
        """Whether the ring is complete and not a sector."""
        return bool(self.ring_corners[-1] - self.ring_corners[0] > 2 * np.pi * (1 - 1e-9))

    @property
    def elements(self) -> int:
        """Number of hexahedra."""
        return self.segments * len(self.section.cells)

    @cached_property
    def faces(self) -> int:
        """Number of element faces on the outer face."""
        return self.segments * len(self.section.outer)

    def outer_line(self, element: np.ndarray, t: np.ndarray) -> np.ndarray:
        """(r, y) (k, 2) m on outer edges (k,) of the chain at t (k,), 0 to 1 from bead to bead."""
        cell, side = self.section.outer[element].T
        t = np.where(self._turned[element], 1 - t, t)
        fixed = np.where(side % 2 == 1, 1.0, 0.0)
        xi, eta = np.where(side < 2, fixed, t), np.where(side < 2, t, fixed)
        return self.section.at(cell, xi, eta)

    @cached_property
    def _turned(self) -> np.ndarray:
        """Whether each edge of the outer chain runs against its cell's coordinate."""
        start = self.section.chain(self.section.outer)[:: self.order][:-1]
        return self.section.side(self.section.outer)[:, 0] != start


def revolved(
    section: SectionMesh,
    segments: int,
    footprint_size: float,
    coarser: Callable[[], Ring | None],
) -> Ring:
    """Any section revolved into `segments` elements, with the scales derived from its mesh."""
    return Ring(
        section=section,
        ring_corners=ring_corners(segments, footprint_size),
        arc_corners=section_angles(section),
        thickness=wall_thickness(section),
        height=float(np.ptp(section.nodes[:, 0])),
        coarser=coarser,
    )


def section_angles(section: SectionMesh) -> np.ndarray:
    """Section angles (rad) of the outer face's corners, ascending, 0 at the crown.

    Angles about the point of the centre plane halfway between the crown and the beads. If they do
    not increase monotonically, the same range is distributed by length along the face.
    """
    line = section.nodes[section.chain(section.outer)]
    corners = line[:: section.order]
    centre = (line[:, 0].max() + line[[0, -1], 0].mean()) / 2
    angle = np.unwrap(np.arctan2(line[:, 1], line[:, 0] - centre))
    if (np.diff(angle) > 0).all():
        return angle[:: section.order]
    length = np.append(0.0, np.cumsum(np.linalg.norm(np.diff(corners, axis=0), axis=1)))
    crown = np.interp(0.0, corners[:, 1], length) if (np.diff(corners[:, 1]) > 0).all() else None
    middle = length[-1] / 2 if crown is None else crown
    return (length - middle) / length[-1] * (angle[-1] - angle[0])


def wall_thickness(section: SectionMesh) -> float:
    """Area over mean length of inner and outer face, m."""
    corners = section.nodes[section.cells[:, [0, section.order, -1, -1 - section.order]]]
    x, y = corners[..., 0], corners[..., 1]
    area = 0.5 * abs((x * np.roll(y, -1, 1) - y * np.roll(x, -1, 1)).sum(axis=1)).sum()
    lengths = [
        np.linalg.norm(np.diff(section.nodes[section.side(face)], axis=1), axis=2).sum()
        for face in (section.inner, section.outer)
    ]
    return float(2 * area / sum(lengths))
