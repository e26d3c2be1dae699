"""From a section to a ring of curved hexahedra: geometry, node numbering, materials of the wall."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property

import dolfinx.mesh as dmesh
import numpy as np
from dolfinx import fem
from mpi4py import MPI
from scipy.spatial import cKDTree
from ufl.core.expr import Expr

from tireroad.fem import compat
from tireroad.fem.errors import InputError
from tireroad.fem.sections import mesh2d
from tireroad.fem.sections.mesh2d import RegionPatch, Ring
from tireroad.fem.sections.torus import Torus
from tireroad.fem.tire.material import MATERIALS, Kind, Material, MaterialLaw, kinds

__all__ = ["INNER", "RIM", "TREAD", "NodeGrid", "TireMesh", "Torus", "build", "field_lattice"]

INNER, TREAD, RIM = 1, 2, 3  # facet tags

# Facet of the reference hexahedron where coordinate 0, 1, 2 is 0 or 1 (basix: z = 0, y = 0, x = 0,
# x = 1, ...).
_HEX_FACE = np.array([[2, 3], [1, 4], [0, 5]])


class NodeGrid:
    """The nodes of a ring as a tensor product of angles around the axle and nodes of the section.

    The id of a node, angle * section nodes + section node, does not depend on the number of
    processes. `edge` (order + 1,): nodes on an edge of the reference element, ascending from 0 to
    1; `ring` (a,) rad: angles; `section` (s, 2) m: positions (r, y); `cells_2d` (c, n): the
    section's cells in tensor order. The outer face is a grid of `face_shape`, `ring` times `arc`,
    the section angles (rad) of its nodes from bead to bead.
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
        """Ids of the nodes of the outer face: around the axle, then from bead to bead."""
        line = self.tire.section.chain(self.tire.section.outer)
        return (np.arange(self.shape[0])[:, None] * self.shape[1] + line).ravel()

    def points(self, ids: np.ndarray) -> np.ndarray:
        """Undeformed positions (n, 3), m."""
        i, node = np.divmod(ids, self.shape[1])
        return position(self.ring[i], self.section[node])

    def ids(self, points: np.ndarray) -> np.ndarray:
        """Ids of the nodes nearest to points (n, 3), as element maps deviate slightly."""
        x, y, z = points.T
        ring = np.arctan2(x, -z) % (2 * np.pi)
        i = _nearest(np.append(self.ring, 2 * np.pi), ring) % len(self.ring)
        _, node = cKDTree(self.section).query(np.stack([np.hypot(x, z), y], axis=-1))
        return i * self.shape[1] + node

    def circles(self, ids: np.ndarray) -> np.ndarray:
        """Index of each node's circle about the axle, which is its node of the section."""
        return ids % self.shape[1]

    def cells(self) -> np.ndarray:
        """Ids of the nodes of all elements, (cells, nodes), in the Lagrange element's order."""
        return _cells(self, compat.field_nodes(self.tire.order), np.arange(self.tire.elements))

    def quads(self) -> np.ndarray:
        """The outer face as quadrilaterals (q, 4) of neighbouring nodes, indices into it."""
        return ring_quads(*self.face_shape)


def ring_quads(around: int, along: int) -> np.ndarray:
    """Quadrilaterals (q, 4) of neighbouring places of a grid `around` x `along`, closed around."""
    i, j = np.meshgrid(np.arange(around), np.arange(along - 1), indexing="ij")
    next_i = (i + 1) % around
    corners = [i * along + j, next_i * along + j, next_i * along + j + 1, i * along + j + 1]
    return np.stack(corners, axis=-1).reshape(-1, 4)


def position(ring: np.ndarray, place: np.ndarray) -> np.ndarray:
    """Cartesian positions (n, 3) from ring angles (n,) rad and section (r, y) (n, 2) m."""
    r, y = place[:, 0], place[:, 1]
    return np.stack([r * np.sin(ring), y, -r * np.cos(ring)], axis=-1)


def _subdivide(corners: np.ndarray, nodes: np.ndarray) -> np.ndarray:
    """Corner coordinates with each element's inner nodes inserted."""
    steps = np.diff(corners)[:, None] * nodes[None, :-1] + corners[:-1, None]
    return np.append(steps.ravel(), corners[-1])


def _nearest(line: np.ndarray, values: np.ndarray) -> np.ndarray:
    """Index of the entry of an ascending line nearest to each value."""
    return np.searchsorted((line[1:] + line[:-1]) / 2, values)


def _edge(nodes: np.ndarray) -> np.ndarray:
    """Nodes on an edge of the reference element, ascending, from its node coordinates."""
    return np.sort(nodes[(nodes[:, 1] == 0) & (nodes[:, 2] == 0), 0])


@dataclass(frozen=True)
class TireMesh:
    """The distributed mesh; `lattice` numbers the nodes of its displacement field.

    `facets` carries the tags INNER, TREAD and RIM. `section_cell`: for each of this process's
    cells, ghosts included, the section's cell it is made from. Reference coordinates are (around,
    xi, eta): side s of that cell is the face where coordinate 1 + s // 2 equals s % 2.
    """

    ring: Ring
    lattice: NodeGrid
    mesh: dmesh.Mesh
    facets: dmesh.MeshTags
    section_cell: np.ndarray


def build(comm: MPI.Comm, ring: Ring) -> TireMesh:
    """The ring of hexahedra; each process passes its share of cells and points. Collective."""
    nodes = compat.geometry_nodes(ring.order)
    geometry = NodeGrid(ring, _edge(nodes))
    cells = _cells(geometry, nodes, np.arange(*_share(comm, ring.elements)))
    points = geometry.points(np.arange(*_share(comm, geometry.size)))
    mesh = compat.create_mesh(comm, cells, points, ring.order)
    section_cell = np.asarray(mesh.topology.original_cell_index) % len(ring.section.cells)
    return TireMesh(ring, field_lattice(ring), mesh, _tag(mesh, ring, section_cell), section_cell)


def field_lattice(tire: Ring | Torus) -> NodeGrid:
    """The nodes of the displacement field of a tire's mesh."""
    return NodeGrid(tire, _edge(compat.field_nodes(tire.order)))


def _share(comm: MPI.Comm, count: int) -> tuple[int, int]:
    """This process's half-open part of range(count)."""
    return count * comm.rank // comm.size, count * (comm.rank + 1) // comm.size


def _cells(lattice: NodeGrid, nodes: np.ndarray, cells: np.ndarray) -> np.ndarray:
    """Ids of the nodes of the given cells, (cells, nodes), in the element's node order."""
    order = lattice.tire.order
    step = np.searchsorted(_edge(nodes), nodes - 1e-9)
    i, cell = np.divmod(cells[:, None], len(lattice.cells_2d))
    around = (order * i + step[:, 0]) % lattice.shape[0]
    return around * lattice.shape[1] + lattice.cells_2d[cell, step[:, 1] * (order + 1) + step[:, 2]]


def _tag(mesh: dmesh.Mesh, ring: Ring, section_cell: np.ndarray) -> dmesh.MeshTags:
    """Tags of inner face, tread and rim, from the sides of the section's cells.

    Cells are numbered alike on all processes, so each process's own cells suffice.
    """
    section, facet_of = ring.section, compat.cell_facets(mesh)
    tags: dict[int, int] = {}
    # An edge in two sets belongs to the later one: a face held by the wheel is no free face.
    for tag, edges in ((INNER, section.inner), (TREAD, section.tread), (RIM, section.rim)):
        for side in range(len(mesh2d.SIDES)):
            marked = np.zeros(len(section.cells), bool)
            marked[edges[edges[:, 1] == side, 0]] = True
            facets = facet_of[marked[section_cell], _HEX_FACE[1 + side // 2, side % 2]]
            tags |= dict.fromkeys(facets.tolist(), tag)
    entities = np.array(sorted(tags), dtype=int)
    return compat.meshtags(mesh, 2, entities, np.array([tags[e] for e in entities.tolist()], int))


@dataclass(frozen=True, kw_only=True)
class Region:
    """A part of a torus's section with a material of its own; its boundary lies on element edges.

    `arc` (from, to) in rad from the crown, on the sides named: "both", "left" (y < 0) or "right";
    `depth` (from, to) through the wall: 0 inner, 1 outer face.
    """

    material: Material
    arc: tuple[float, float]
    depth: tuple[float, float] = (0.0, 1.0)
    side: str = "both"

    def patch(self, number: int) -> RegionPatch:
        """The part of the section, named after its number in the scene."""
        low, high = self.arc
        right, left = (low, high), (-high, -low)
        arcs = {"both": (right, left), "left": (left,), "right": (right,)}[self.side]
        return RegionPatch(f"tire.region {number}", arcs, self.depth)


def compounds(material: Material, regions: tuple[Region, ...]) -> dict[str, Material]:
    """The materials of a torus by the names of its section's regions."""
    return {"wall": material} | {r.patch(i).name: r.material for i, r in enumerate(regions)}


class Wall:
    """Density and coefficients of all laws in use, as fields constant in each cell.

    They are data of the compiled forms, so another modulus needs no recompilation and regions cost
    nothing. `materials` by name of the section's regions. Raises InputError for a region without a
    material. Collective to make.
    """

    def __init__(self, tire: TireMesh, materials: Mapping[str, Material]) -> None:
        self._space = compat.cell_space(tire.mesh)
        section = tire.ring.section
        missing = [name for name in section.regions if name not in materials]
        if missing:
            raise InputError(f"section: no material for region {missing[0]!r}")
        self._owner = section.region[tire.section_cell]  # region number of each cell
        self.materials = [materials[name] for name in section.regions]
        self.density = self._by_cell([m.density for m in self.materials])
        self.stiffens = any(m.dynamic != 1 for m in self.materials)
        self._laws = [
            (law.energy, [self._coefficient(name, law) for name in law.coefficients])
            for law in map(MATERIALS.__getitem__, MATERIALS)
            if any(type(m.law) is law for m in self.materials)
        ]

    def _coefficient(self, name: str, law: type[MaterialLaw]) -> fem.Function:
        """A coefficient of the law by cell; 0 where the material follows another law."""
        own = [m.law for m in self.materials]
        return self._by_cell([getattr(value, name) if type(value) is law else 0.0 for value in own])

    def _by_cell(self, values: Sequence[float]) -> fem.Function:
        field = fem.Function(self._space)
        field.x.array[:] = np.array(values)[self._owner]
        return field

    def stiffening(self) -> fem.Function:
        """Excess of the dynamic modulus over the static one, as a fraction of it: dynamic - 1."""
        return self._by_cell([m.dynamic - 1 for m in self.materials])

    def kinds(self) -> list[tuple[Kind, fem.Function]]:
        """The kinds of compounds, each with its part of the static modulus by cell."""
        given = [(m.spectrum, m.loss_factor, m.dynamic) for m in self.materials]
        return [(kind, self._by_cell(share)) for kind, share in kinds(given).items()]

    def energy(self, C: Expr) -> tuple[Expr, Expr]:
        """Strain energy density as (distortion, dilatation), J/m3, in UFL."""
        parts = [energy(C, *coefficients) for energy, coefficients in self._laws]
        return sum(part[0] for part in parts), sum(part[1] for part in parts)
