"""From a section to a ring of curved hexahedra: geometry, node lattice and boundary tags."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import dolfinx.mesh as dmesh
import numpy as np
from mpi4py import MPI
from scipy.spatial import cKDTree

from tireroad.fem import compat
from tireroad.fem.sections import reference
from tireroad.fem.sections.ring import Ring
from tireroad.fem.sections.torus import Torus

__all__ = ["INNER", "RIM", "TREAD", "Lattice", "TireMesh", "Torus", "build", "field_lattice"]

INNER, TREAD, RIM = 1, 2, 3  # facet tags


class Lattice:
    """The nodes of a ring as a product: angles around the axle times the nodes of the section.

    The id of a node, angle * section nodes + section node, is the same on any number of processes.
    `edge` (order + 1,) are the nodes on one edge of the reference element, ascending, 0 and 1
    included; `ring` (a,) rad the angles, `section` (s, 2) m the places (r, y), `cells_2d` (c, n) the
    section's cells in tensor order. The outer face is a grid of `face_shape`, `ring` times `arc`, the
    section angles (rad) of its nodes bead to bead.
    """

    def __init__(self, tire: Ring | Torus, edge: np.ndarray) -> None:
        tire = tire.ring() if isinstance(tire, Torus) else tire
        self.tire, self.edge = tire, edge
        self.ring_corners, self.arc_corners = tire.ring_corners, tire.arc_corners
        angles = _subdivide(tire.ring_corners, edge)
        self.ring = angles[:-1] if tire.closed else angles
        self.arc = _subdivide(tire.arc_corners, edge)
        self.section, self.cells_2d = tire.section.on_nodes(tire.order, edge)
        self.shape = len(self.ring), len(self.section)
        self.face_shape = len(self.ring), len(self.arc)
        self.size = len(self.ring) * len(self.section)

    @cached_property
    def face(self) -> np.ndarray:
        """Ids of the nodes of the outer face: around the axle, then bead to bead."""
        line = self.tire.section.chain(self.tire.section.outer)
        return (np.arange(self.shape[0])[:, None] * self.shape[1] + line).ravel()

    def points(self, ids: np.ndarray) -> np.ndarray:
        """Undeformed positions (n, 3), m."""
        i, node = np.divmod(ids, self.shape[1])
        return position(self.ring[i], self.section[node])

    def ids(self, points: np.ndarray) -> np.ndarray:
        """Ids of the nodes at the given points (n, 3); the element's own map may be off by a little."""
        x, y, z = points.T
        ring = np.arctan2(x, -z) % (2 * np.pi)
        i = _nearest(np.append(self.ring, 2 * np.pi), ring) % len(self.ring)
        _, node = cKDTree(self.section).query(np.stack([np.hypot(x, z), y], axis=-1))
        return i * self.shape[1] + node

    def circles(self, ids: np.ndarray) -> np.ndarray:
        """Number of the circle about the axle that each node is on: its node of the section."""
        return ids % self.shape[1]

    def cells(self) -> np.ndarray:
        """Ids of the nodes of all elements, (cells, nodes), in the order of the Lagrange element."""
        return _cells(self, compat.field_nodes(self.tire.order), np.arange(self.tire.elements))

    def quads(self) -> np.ndarray:
        """The outer face as quadrilaterals between neighbouring nodes, (q, 4) indices into it."""
        around, along = self.face_shape
        i, j = np.meshgrid(np.arange(around), np.arange(along - 1), indexing="ij")
        next_i = (i + 1) % around
        corners = [i * along + j, next_i * along + j, next_i * along + j + 1, i * along + j + 1]
        return np.stack(corners, axis=-1).reshape(-1, 4)


def position(ring: np.ndarray, place: np.ndarray) -> np.ndarray:
    """Cartesian position (n, 3) of angles around (n,) rad and places (r, y) (n, 2) m."""
    r, y = place[:, 0], place[:, 1]
    return np.stack([r * np.sin(ring), y, -r * np.cos(ring)], axis=-1)


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

    `facets` carries the tags INNER, TREAD and RIM. `section_cell` (cells of this process, ghosts too):
    the cell of the section each hexahedron is made of. Its reference coordinates are (around, xi, eta):
    side s of that cell is its face where coordinate 1 + s // 2 is s % 2.
    """

    ring: Ring
    lattice: Lattice
    mesh: dmesh.Mesh
    facets: dmesh.MeshTags
    section_cell: np.ndarray


def build(comm: MPI.Comm, ring: Ring) -> TireMesh:
    """The ring of hexahedra. Each process hands in its share of cells and points. Collective."""
    nodes = compat.geometry_nodes(ring.order)
    geometry = Lattice(ring, _edge(nodes))
    cells = _cells(geometry, nodes, np.arange(*_share(comm, ring.elements)))
    points = geometry.points(np.arange(*_share(comm, geometry.size)))
    mesh = compat.create_mesh(comm, cells, points, ring.order)
    section_cell = np.asarray(mesh.topology.original_cell_index) % len(ring.section.cells)
    return TireMesh(ring, field_lattice(ring), mesh, _tag(mesh, ring, section_cell), section_cell)


def field_lattice(tire: Ring | Torus) -> Lattice:
    """The nodes of the displacement field of a tire's mesh."""
    return Lattice(tire, _edge(compat.field_nodes(tire.order)))


def _share(comm: MPI.Comm, count: int) -> tuple[int, int]:
    """This process's half-open part of range(count)."""
    return count * comm.rank // comm.size, count * (comm.rank + 1) // comm.size


def _cells(lattice: Lattice, nodes: np.ndarray, cells: np.ndarray) -> np.ndarray:
    """Ids of the nodes of the given cells, (cells, nodes), in the element's node order."""
    order = lattice.tire.order
    step = np.searchsorted(_edge(nodes), nodes - 1e-9)
    i, cell = np.divmod(cells[:, None], len(lattice.cells_2d))
    around = (order * i + step[:, 0]) % lattice.shape[0]
    return around * lattice.shape[1] + lattice.cells_2d[cell, step[:, 1] * (order + 1) + step[:, 2]]


def _tag(mesh: dmesh.Mesh, ring: Ring, section_cell: np.ndarray) -> dmesh.MeshTags:
    """Tags of the inner face, the tread and the rim, by the sides of the section's cells.

    Cells are numbered alike on all processes, so what a process needs to know lies in its own cells.
    """
    section, facet_of = ring.section, compat.cell_facets(mesh)
    found: dict[int, int] = {}
    # Where an edge is in two sets, the later one here has it: what the wheel holds is no face.
    for tag, edges in ((INNER, section.inner), (TREAD, section.tread), (RIM, section.rim)):
        for side in range(len(reference.SIDES)):
            marked = np.zeros(len(section.cells), bool)
            marked[edges[edges[:, 1] == side, 0]] = True
            facets = facet_of[marked[section_cell], _HEX_FACE[1 + side // 2, side % 2]]
            found |= dict.fromkeys(facets.tolist(), tag)
    entities = np.array(sorted(found), dtype=int)
    return compat.meshtags(mesh, 2, entities, np.array([found[e] for e in entities.tolist()], int))


# Facet of the reference hexahedron where coordinate 0, 1, 2 is 0 or 1 (basix: z = 0, y = 0, x = 0, x = 1, ...).
_HEX_FACE = np.array([[2, 3], [1, 4], [0, 5]])
