"""Static force of every cord at the integration points of its ply.

    f = E A_c (lambda - 1),  with the modulus in compression below lambda = 1, N per cord.

With one Gauss point per direction fewer than full integration, these are the points where the
elements' strains are most accurate (Barlow 1976, doi 10.1002/nme.1620100202). The grid is (ring,
along): ring angles ascending from the lowest point towards +x, then along the ply's line from its
first end (lower y at its middle) to its last.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import ufl
from mpi4py import MPI

from tireroad.fem import compat, kinematics
from tireroad.fem.sections import mesh2d
from tireroad.fem.tire.body import Body
from tireroad.fem.tire.cords import TAUT
from tireroad.fem.tire.mesh import position
from tireroad.fem.tire.plies import RULE, Sheet, edge_rule, face_points


@dataclass(frozen=True)
class CordForce:
    """Cord force of one ply: undeformed `points` (a, b, 3) m, `force` (a, b) N per cord, tension
    positive, and `area` (a, b) m2 of the undeformed ply associated with each point.
    """

    points: np.ndarray
    force: np.ndarray
    area: np.ndarray

    @property
    def compressed(self) -> float:
        """Fraction of the ply's area whose cords are in compression."""
        return float(self.area[self.force < 0].sum() / self.area.sum())


def cord_forces(body: Body) -> dict[str, CordForce]:
    """Cord forces by ply at the present displacement, on every process. Collective."""
    found = {}
    for number, one in enumerate(body.plies.cords):
        chain = body.ring.section.plies[one.name]
        values = np.zeros((2, *_grid(body, chain)))
        for sheet in body.plies.sheets:
            _read(body, sheet, number, chain, values)
        body.comm.Allreduce(MPI.IN_PLACE, values)
        found[one.name] = CordForce(_points(body, chain), values[0], values[1])
    return found


def _line(body: Body) -> np.ndarray:
    return edge_rule(body.ring.order, RULE)[0]


def _grid(body: Body, chain: np.ndarray) -> tuple[int, int]:
    count = len(_line(body))
    return body.ring.segments * count, len(chain) * count


def _ascends(body: Body, chain: np.ndarray) -> np.ndarray:
    """Whether each edge's local coordinate runs along the chain."""
    section = body.ring.section
    return section.side(chain)[:, 0] == section.chain(chain)[:: section.order][:-1]


def _read(body: Body, sheet: Sheet, number: int, chain: np.ndarray, values: np.ndarray) -> None:
    """Write this process's part of force and area into `values` (2, a, b)."""
    tire, face = body.tire, sheet.face
    owned = tire.mesh.topology.index_map(3).size_local
    cells = np.flatnonzero(sheet.owner[:owned] == number)
    edges = chain[:, 1] == 2 * (face.axis - 1) + face.side
    place = np.full(len(body.ring.section.cells), -1)
    place[chain[edges, 0]] = np.flatnonzero(edges)
    edge = place[tire.section_cell[cells]]
    cells, edge = cells[edge >= 0], edge[edge >= 0]
    line, weight = edge_rule(body.ring.order, RULE)
    n = len(line)
    points = face_points(face.axis, face.side, line)
    stretched = ufl.dot(kinematics.deformation_gradient(body.u), sheet.direction)
    stretch = ufl.sqrt(ufl.dot(stretched, stretched))
    cords = body.plies.cords[number]
    # A face's area is |J^-T n| |det J| per unit of the reference face.
    area = face.area * abs(ufl.det(ufl.Jacobian(tire.mesh)))
    stretch, area = (compat.evaluate(e, points, tire.mesh, cells) for e in (stretch, area))
    modulus = np.where(stretch < TAUT, cords.compression, 1.0) * cords.youngs_modulus
    strain = np.where(np.abs(stretch - 1) > 1 - TAUT, stretch - 1, 0.0)  # else rounding
    force = modulus * cords.area * strain
    area = area * np.outer(weight, weight).ravel()
    segment = np.asarray(tire.mesh.topology.original_cell_index)[cells] // len(place)
    along = np.where(_ascends(body, chain)[edge][:, None], np.arange(n), np.arange(n)[::-1])
    i = (segment[:, None] * n + np.arange(n))[:, :, None]
    j = (edge[:, None] * n + along)[:, None, :]
    for out, part in zip(values, (force, area), strict=True):
        out[i, j] = part.reshape(-1, n, n)


def _points(body: Body, chain: np.ndarray) -> np.ndarray:
    """Undeformed positions (a, b, 3) m of the grid."""
    line, ring = _line(body), body.ring
    angle = (np.diff(ring.ring_corners)[:, None] * line + ring.ring_corners[:-1, None]).ravel()
    t = np.where(_ascends(body, chain)[:, None], line, 1 - line)
    cell, side = np.repeat(chain, len(line), axis=0).T
    fixed = (side % 2).astype(float)
    xi = np.where(side < 2, fixed, t.ravel())
    eta = np.where(side < 2, t.ravel(), fixed)
    edge = mesh2d.equispaced(ring.order)
    shape = mesh2d.tensor(mesh2d.line(edge, xi), mesh2d.line(edge, eta))
    section = ring.section
    place = np.einsum("ka,kax->kx", shape, section.nodes[section.cells[cell]])
    both = np.repeat(angle, len(place)), np.tile(place, (len(angle), 1))
    return position(*both).reshape(len(angle), len(place), 3)
