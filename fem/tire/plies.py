"""The plies of a body: the cell faces that they lie on, and the integrals over these.

An integral over one face of each cell is a cell integral whose quadrature points lie on the face:

    int_face f dA = int_cell-rule f |J^-T n| |det J|,   n the reference normal (Nanson's formula)

Facet integrals on a surface inside the body would couple the two adjacent cells in the sparsity
pattern, order each facet's sides differently on each process, and need cells of other processes.
Here each cell, and thus each process, owns its faces.

As for the wall, the cords' coefficients are data of the compiled forms, one value per cell and 0
where its face is on no ply. Another angle, modulus or number of plies needs no recompilation.
"""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import ufl
from dolfinx import fem
from dolfinx.mesh import Mesh
from mpi4py import MPI
from ufl.core.expr import Expr

from tireroad.fem import compat, kinematics
from tireroad.fem.errors import InputError
from tireroad.fem.sections.mesh2d import SectionMesh
from tireroad.fem.tire import cords as law
from tireroad.fem.tire.cords import Cords
from tireroad.fem.tire.mesh import TireMesh

AXES = 3
RULE = "reduced"


def edge_rule(order: int, kind: str) -> tuple[np.ndarray, np.ndarray]:
    """Points and weights on [0, 1]: "reduced": `order` Gauss points, "full": one more, "nodes":
    Lobatto's."""
    if kind == "nodes":
        nodes = compat.field_nodes(order)
        points = np.sort(nodes[(nodes[:, 1] == 0) & (nodes[:, 2] == 0), 0])
        powers = np.arange(order + 1)
        return points, np.linalg.solve(points ** powers[:, None], 1 / (powers + 1))
    points, weights = np.polynomial.legendre.leggauss(order + (kind == "full"))
    return (points + 1) / 2, weights / 2


def face_points(axis: int, side: int, line: np.ndarray) -> np.ndarray:
    """Tensor points (n^2, 3) of a line on a face; the lower of the other axes varies slowest."""
    points = np.full((len(line) ** 2, AXES), float(side))
    first, second = (other for other in range(AXES) if other != axis)
    grid = np.array(list(itertools.product(line, line)))
    points[:, first], points[:, second] = grid[:, 0], grid[:, 1]
    return points


class Face:
    """The face of all cells of a mesh where reference coordinate `axis` is `side` (0 or 1)."""

    def __init__(self, mesh: Mesh, axis: int, side: int, order: int) -> None:
        self.mesh, self.axis, self.side, self._order = mesh, axis, side, order
        reference = np.zeros(AXES)
        reference[axis] = 2 * side - 1
        scaled = ufl.inv(ufl.Jacobian(mesh)).T * ufl.as_vector([float(v) for v in reference])
        self.area = ufl.sqrt(ufl.dot(scaled, scaled))
        self.normal = scaled / self.area

    def integral(self, integrand: Expr, kind: str) -> ufl.Form:
        """UFL form of the surface integral with the rule `kind` of `edge_rule`."""
        line, weights = edge_rule(self._order, kind)
        metadata = {
            "quadrature_rule": "custom",
            "quadrature_degree": 2 * self._order,  # no effect, but UFL requires one
            # Tuples: UFL writes them into the form's signature in full, but arrays only to eight
            # digits.
            "quadrature_points": _nested(face_points(self.axis, self.side, line)),
            "quadrature_weights": _nested(np.outer(weights, weights).ravel()),
        }
        return self.area * integrand * ufl.Measure("dx", domain=self.mesh, metadata=metadata)

    def tangents(self) -> tuple[Expr, Expr]:
        """(e_circ, e_across) in UFL: around the axle, and e_circ x normal, both in the face."""
        X = ufl.SpatialCoordinate(self.mesh)
        along = ufl.as_vector((-X[2], 0.0, X[0]))
        # The polynomial face is not exactly a surface of revolution.
        along = along - ufl.dot(along, self.normal) * self.normal
        around = along / ufl.sqrt(ufl.dot(along, along))
        return around, ufl.cross(around, self.normal)


def _nested(values: np.ndarray) -> tuple:
    return tuple(_nested(part) if part.ndim else float(part) for part in values)


@dataclass(frozen=True)
class Laid:
    """Cells (k,) of this process, ghosts included, with a face on the ply `number`.

    It is the face where the reference coordinate `axis` equals `side`, 0 or 1. The outward normal
    of the cell there is e_arc x e_circ of the ply, or its opposite if `reverse`. Only one of the
    two cells at a face is listed, by a rule that is the same on all processes. `radius` (k,) m of
    each face from the axle, used for lifted plies only.
    """

    number: int
    cells: np.ndarray
    axis: int
    side: int
    reverse: bool = False
    radius: np.ndarray | None = None


class Sheet:
    """One face of every cell with the cords on it, as fields constant in each cell.

    `owner` (cells,) is the number of the ply, or -1; no two of `laid` share a cell.
    """

    def __init__(
        self, face: Face, count: int, laid: Sequence[Laid], cords: Sequence[Cords]
    ) -> None:
        self.face, self.owner = face, np.full(count, -1)
        # Without a ply: zero stiffness and mass along a unit vector.
        values = dict.fromkeys(("stiffness", "mass", "slack", "sine"), 0.0) | {"cosine": 1.0}
        by_cell = {name: np.full(count, value) for name, value in values.items()}
        for layer in laid:
            line, cells = cords[layer.number], layer.cells
            woven = line.at(np.ones(len(cells)) if layer.radius is None else layer.radius)
            self.owner[cells] = layer.number
            by_cell["slack"][cells] = line.compression
            for name, part in vars(woven).items():
                by_cell[name][cells] = part
            # e_arc is e_circ x n or its opposite, n being the cell's outward normal.
            by_cell["sine"][cells] *= -1.0 if layer.reverse else 1.0
        space = compat.cell_space(face.mesh)
        fields = {name: fem.Function(space) for name in by_cell}
        for name, field in fields.items():
            field.x.array[:] = by_cell[name]
        self.stiffness, self.mass, self.slack = (
            fields[name] for name in ("stiffness", "mass", "slack")
        )
        around, across = face.tangents()
        self.direction = fields["cosine"] * around + fields["sine"] * across


class Plies:
    """All cords of a body; without any, every form is 0. Collective to make."""

    def __init__(
        self, mesh: Mesh, order: int, cords: Sequence[Cords], laid: Sequence[Laid]
    ) -> None:
        self.cords = tuple(cords)
        self.sheets = _sheets(mesh, order, self.cords, laid)

    def work(self, u: Expr, v: Expr) -> ufl.Form | int:
        """Virtual work of the cords' tension, in UFL."""
        return sum(self._work(sheet, u, v) for sheet in self.sheets)

    def _work(self, sheet: Sheet, u: Expr, v: Expr) -> ufl.Form:
        line, test_line = self._lines(sheet, u, v)
        tension = law.tension_over_stretch(ufl.dot(line, line), sheet.stiffness, sheet.slack)
        return sheet.face.integral(tension * ufl.dot(line, test_line), RULE)

    def _lines(self, sheet: Sheet, u: Expr, v: Expr) -> tuple[Expr, Expr]:
        """F a and grad(v) a."""
        F = kinematics.deformation_gradient(u)
        return ufl.dot(F, sheet.direction), ufl.dot(ufl.grad(v), sheet.direction)

    def energy(self, u: Expr) -> ufl.Form | int:
        """Strain energy of the cords, J, in UFL."""

        def stored(sheet: Sheet) -> ufl.Form:
            line, _ = self._lines(sheet, u, u)
            density = law.energy(ufl.sqrt(ufl.dot(line, line)), sheet.stiffness, sheet.slack)
            return sheet.face.integral(density, RULE)

        return sum(stored(sheet) for sheet in self.sheets)

    def stress_prediction(self, u: Expr, before: Expr, du: Expr, v: Expr) -> ufl.Form | int:
        """The cords' part of fem.static.virtual_work.stress_prediction."""

        def correction(sheet: Sheet) -> ufl.Form:
            line, last = self._lines(sheet, u, before)[0], self._lines(sheet, before, v)[0]
            change = ufl.dot(ufl.grad(u - before), sheet.direction)
            arguments = sheet.stiffness, sheet.slack
            was = ufl.dot(last, last)
            predicted = law.tension_over_stretch(was, *arguments)
            predicted += law.tension_over_stretch_rate(was, *arguments) * 2 * ufl.dot(last, change)
            excess = predicted - law.tension_over_stretch(ufl.dot(line, line), *arguments)
            bending = ufl.dot(
                ufl.dot(ufl.grad(du), sheet.direction), ufl.dot(ufl.grad(v), sheet.direction)
            )
            return sheet.face.integral(excess * bending, RULE)

        return sum(correction(sheet) for sheet in self.sheets)

    def inertia(self, integrand: Expr, kind: str = "full") -> ufl.Form | int:
        """int (mass per area) integrand over all plies that have mass, in UFL."""
        if not any(cord.density for cord in self.cords):
            return 0
        return sum(sheet.face.integral(sheet.mass * integrand, kind) for sheet in self.sheets)


def _sheets(mesh: Mesh, order: int, cords: Sequence[Cords], laid: Sequence[Laid]) -> list[Sheet]:
    """The fewest sheets for all plies: one per cell face, more where plies coincide. Collective."""
    cells = mesh.topology.index_map(3)
    count = cells.size_local + cells.num_ghosts
    sheets: dict[tuple[int, int, int], np.ndarray] = {}
    parts: dict[tuple[int, int, int], list[Laid]] = {}
    for layer in laid:
        for slot in itertools.count():
            key = layer.axis, layer.side, slot
            used = sheets.setdefault(key, np.zeros(count, bool))
            if not mesh.comm.allreduce(bool(used[layer.cells].any()), op=MPI.LOR):
                break
        used[layer.cells] = True
        parts.setdefault(key, []).append(layer)
    faces = {key[:2]: Face(mesh, *key[:2], order) for key in parts}
    return [Sheet(faces[key[:2]], count, parts[key], cords) for key in sorted(parts)]


def laid_on(tire: TireMesh, cords: Sequence[Cords]) -> list[Laid]:
    """Assign cords to the section's plies of the same names. Not collective.

    Raises InputError for cords without a ply or a ply without cords.
    """
    section = tire.ring.section
    names = [cord.name for cord in cords]
    for name in section.plies:
        if name not in names:
            raise InputError(f"section: ply {name!r} has no cords")
    out = []
    for number, name in enumerate(names):
        if name not in section.plies:
            raise InputError(f"cords {name!r}: the section has no ply of that name")
        chain = section.plies[name]
        reverse = _turned(section, chain)
        radius = np.zeros((len(section.cells), 4))
        radius[chain[:, 0], chain[:, 1]] = section.nodes[section.side(chain), 0].mean(axis=1)
        for side, other in itertools.product(range(4), (False, True)):
            marked = np.zeros(len(section.cells), bool)
            marked[chain[(chain[:, 1] == side) & (reverse == other), 0]] = True
            if marked.any():
                cells = np.flatnonzero(marked[tire.section_cell])
                here = radius[tire.section_cell[cells], side]
                out.append(Laid(number, cells, 1 + side // 2, side % 2, other, here))
    return out


def _turned(section: SectionMesh, chain: np.ndarray) -> np.ndarray:
    """Whether e_arc x e_circ, e_arc along the chain, points into the cell of each edge (k,)."""
    start = section.chain(chain)[:: section.order][:-1]
    ascends = section.side(chain)[:, 0] == start
    # (xi, eta) is right-handed in (r, y): the outward normal at xi = 1 is eta's direction turned
    # clockwise, just as e_arc x e_circ is e_arc turned clockwise.
    return ascends != np.isin(chain[:, 1], (1, 2))
