"""From a section to a ring of curved hexahedra: geometry, node lattice and boundary tags."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import dolfinx.mesh as dmesh
import numpy as np
from mpi4py import MPI

from tireroad.fem import compat

INNER, TREAD, RIM = 1, 2, 3  # facet tags


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
        return np.pi + np.pi * _graded(self.segments, lambda t: self._near_road(1 - np.abs(t)))

    @property
    def wall_corners(self) -> np.ndarray:
        """Distances of the element corners from the section's centre, m, inside to outside."""
        inner = self.minor_radius - self.thickness
        return np.linspace(inner, self.minor_radius, self.elements_thickness + 1)

    @property
    def arc_corners(self) -> np.ndarray:
        """Angles of the element corners along the section, rad, bead to bead; the crown is 0."""

        def size(t):
            # The clamped edge is singular: at the bead an element is _BEAD times the uniform one.
            bead = _BEAD + (1 - _BEAD) * np.pi / 2 * np.cos(np.pi / 2 * t)
            return self._near_road(np.abs(t)) * (bead if self.grading == "bead" else 1.0)

        return self.half_angle * _graded(self.elements_arc, size)

    def _near_road(self, distance: np.ndarray) -> np.ndarray:
        """Relative element size at a distance from the footprint, both by element count, 0 to 1."""
        return 1 - (1 - self.footprint_size) * np.exp(-((distance / _NEAR) ** 2))

    def position(self, ring: np.ndarray, wall: np.ndarray, arc: np.ndarray) -> np.ndarray:
        """Cartesian position of (angle around, distance from the section's centre, section angle)."""
        reach = self.outer_radius - self.minor_radius + wall * np.cos(arc)
        return np.stack([reach * np.sin(ring), wall * np.sin(arc), -reach * np.cos(ring)], axis=-1)

    def coordinates(self, points: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Inverse of `position`, for points (n, 3); the ring angle is in [0, 2 pi)."""
        x, y, z = points.T
        reach = np.hypot(x, z) - (self.outer_radius - self.minor_radius)
        return np.arctan2(x, -z) % (2 * np.pi), np.hypot(reach, y), np.arctan2(y, reach)


class Lattice:
    """The nodes of a section as a product of three lines: around, through the wall, along the arc.

    The id of a node is the same on any number of processes. `nodes` are the nodes on one edge of
    the reference element, ascending, 0 and 1 included.
    """

    def __init__(self, section: Torus, nodes: np.ndarray):
        self.section = section
        self.edge = nodes
        self.ring = _subdivide(section.ring_corners, nodes)[:-1]
        self.wall = _subdivide(section.wall_corners, nodes)
        self.arc = _subdivide(section.arc_corners, nodes)
        self.shape = (len(self.ring), len(self.wall), len(self.arc))
        self.size = len(self.ring) * len(self.wall) * len(self.arc)

    def points(self, ids: np.ndarray) -> np.ndarray:
        """Undeformed positions (n, 3), m."""
        i, k, j = np.unravel_index(ids, self.shape)
        return self.section.position(self.ring[i], self.wall[k], self.arc[j])

    def ids(self, points: np.ndarray) -> np.ndarray:
        """Ids of the nodes at the given points (n, 3); the element's own map may be off by a little."""
        ring, wall, arc = self.section.coordinates(points)
        i = _nearest(np.append(self.ring, 2 * np.pi), ring) % len(self.ring)
        return np.ravel_multi_index(
            (i, _nearest(self.wall, wall), _nearest(self.arc, arc)), self.shape
        )

    def cells(self) -> np.ndarray:
        """Ids of the nodes of all elements, (cells, nodes), in the order of the Lagrange element."""
        section = self.section
        count = section.segments * section.elements_thickness * section.elements_arc
        return _cells(self, compat.field_nodes(section.order), np.arange(count))

    def quads(self) -> np.ndarray:
        """The outer face as quadrilaterals between neighbouring nodes, (q, 4) indices into it."""
        around, _, along = self.shape
        i, j = np.meshgrid(np.arange(around), np.arange(along - 1), indexing="ij")
        next_i = (i + 1) % around
        corners = [i * along + j, next_i * along + j, next_i * along + j + 1, i * along + j + 1]
        return np.stack(corners, axis=-1).reshape(-1, 4)


# First frequency of the unloaded torus, 16 segments, 8, 12 and 16 elements along the arc, above that of
# 36: 7.3, 2.1 and 0.8 % at 0.3; 7.9, 2.1, 0.8 % at 0.2; 6.9, 2.1, 1.0 % at 0.5; 9.7, 3.2, 1.7 % ungraded.
_BEAD = 0.3
_NEAR = 0.4  # of the elements on either side of the footprint: enough, and a soft change


def _graded(count: int, size: Callable[[np.ndarray], np.ndarray]) -> np.ndarray:
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


def _subdivide(corners: np.ndarray, nodes: np.ndarray) -> np.ndarray:
    """Corner coordinates with the inner nodes of each element set between them."""
    steps = np.diff(corners)[:, None] * nodes[None, :-1] + corners[:-1, None]
    return np.append(steps.ravel(), corners[-1])


def _nearest(line: np.ndarray, values: np.ndarray) -> np.ndarray:
    """Index of the entry of an ascending line next to each value."""
    return np.searchsorted((line[1:] + line[:-1]) / 2, values)


def _edge(nodes: np.ndarray) -> np.ndarray:
    """Nodes on one edge of the reference element, ascending, from its node coordinates."""
    return np.sort(nodes[(nodes[:, 1] == 0) & (nodes[:, 2] == 0), 0])


@dataclass(frozen=True)
class TireMesh:
    """The distributed mesh; `lattice` names the nodes of its displacement field.

    `facets` carries the tags INNER, TREAD and RIM.
    """

    section: Torus
    lattice: Lattice
    mesh: dmesh.Mesh
    facets: dmesh.MeshTags


def build(comm: MPI.Comm, section: Torus) -> TireMesh:
    """The ring of hexahedra. Each process hands in its share of cells and points. Collective."""
    nodes = compat.geometry_nodes(section.order)
    geometry = Lattice(section, _edge(nodes))
    count = section.segments * section.elements_thickness * section.elements_arc
    cells = _cells(geometry, nodes, np.arange(*_share(comm, count)))
    points = geometry.points(np.arange(*_share(comm, geometry.size)))
    mesh = compat.create_mesh(comm, cells, points, section.order)
    return TireMesh(section, field_lattice(section), mesh, _tag(mesh, section))


def field_lattice(section: Torus) -> Lattice:
    """The nodes of the displacement field of a section's mesh."""
    return Lattice(section, _edge(compat.field_nodes(section.order)))


def _share(comm: MPI.Comm, count: int) -> tuple[int, int]:
    """This process's half-open part of range(count)."""
    return count * comm.rank // comm.size, count * (comm.rank + 1) // comm.size


def _cells(lattice: Lattice, nodes: np.ndarray, cells: np.ndarray) -> np.ndarray:
    """Ids of the nodes of the given cells, (cells, nodes), in the element's node order."""
    section = lattice.section
    step = np.searchsorted(_edge(nodes), nodes - 1e-9)
    counts = (section.segments, section.elements_thickness, section.elements_arc)
    i, k, j = (section.order * index[:, None] for index in np.unravel_index(cells, counts))
    around = (i + step[:, 0]) % lattice.shape[0]
    return np.ravel_multi_index((around, k + step[:, 1], j + step[:, 2]), lattice.shape)


def _tag(mesh: dmesh.Mesh, section: Torus) -> dmesh.MeshTags:
    """Tags of the inner face, the tread and the rim (bead end faces), from the vertices' positions."""
    small = 1e-6 * section.thickness

    def coordinate(axis):
        return lambda x: section.coordinates(np.asarray(x).T)[axis]

    wall, arc = coordinate(1), coordinate(2)
    where = {
        INNER: lambda x: wall(x) < section.minor_radius - section.thickness + small,
        TREAD: lambda x: wall(x) > section.minor_radius - small,
        RIM: lambda x: np.abs(arc(x)) > section.half_angle - 1e-9,
    }
    found = {tag: dmesh.locate_entities_boundary(mesh, 2, test) for tag, test in where.items()}
    entities = np.concatenate(list(found.values()))
    tags = np.concatenate([np.full(len(facets), tag) for tag, facets in found.items()])
    order = np.argsort(entities)
    return compat.meshtags(mesh, 2, entities[order], tags[order])
