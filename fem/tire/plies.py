"""The plies of a body: which face of which cell lies on which, and their forms.

Like the coefficients of the wall, those of the cords are data of the compiled forms, one value a cell and 0
where its face is on no ply: another angle, modulus or number of plies compiles nothing.
"""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import ufl
from dolfinx import fem
from mpi4py import MPI

from tireroad.fem import compat, kinematics
from tireroad.fem.errors import InputError
from tireroad.fem.sections.mesh2d import SectionMesh
from tireroad.fem.tire import cords as law
from tireroad.fem.tire.cords import Cords
from tireroad.fem.tire.face_rule import Face
from tireroad.fem.tire.mesh import TireMesh


@dataclass(frozen=True)
class Laid:
    """Cells (k,) of this process, ghosts included, that have a face on the ply `number`: the face where
    the reference coordinate `axis` is `side`, 0 or 1. The normal that leaves the cell there is
    e_arc x e_circ of the ply, or its opposite where `reverse`.

    Of the two cells at a face one is named, by any rule that is the same on all processes.
    """

    number: int
    cells: np.ndarray
    axis: int
    side: int
    reverse: bool = False


class Sheet:
    """One face of every cell with the cords on it, as fields that are constant in a cell.

    `owner` (cells,) is the number of the ply, or -1; `turn` 1 or -1 as the cords' e_arc is e_circ x n or
    its opposite, n the normal that leaves the cell.
    """

    def __init__(self, face: Face, owner: np.ndarray, turn: np.ndarray, cords: Sequence[Cords]):
        self.face, self.owner = face, owner
        self._space = compat.cell_space(face.mesh)
        self.stiffness = self._field([c.stiffness for c in cords])
        self.slack = self._field([c.compression for c in cords])
        self.mass = self._field([c.mass for c in cords])
        around, across = face.tangents()
        cosine = self._field([c.direction[0] for c in cords], 1.0)  # a unit vector on no ply too
        sine = self._field([c.direction[1] for c in cords], 0.0, turn)
        self.direction = cosine * around + sine * across

    def _field(self, values: Sequence[float], without: float = 0.0, times=1.0) -> fem.Function:
        """The value of each ply by cell, and `without` where the face is on none."""
        field = fem.Function(self._space)
        field.x.array[:] = np.append(values, without)[self.owner] * times
        return field


class Plies:
    """All cords of a body, `order` that of its elements; without any, every form is 0. Collective to make."""

    def __init__(self, mesh, order: int, cords: Sequence[Cords], laid: Sequence[Laid]):
        self.cords = tuple(cords)
        self.sheets = _sheets(mesh, order, self.cords, laid)

    def work(self, u, v):
        """Virtual work of the cords' tension in UFL."""
        return _sum(self._work(sheet, u, v) for sheet in self.sheets)

    def _work(self, sheet: Sheet, u, v):
        line, test_line = self._lines(sheet, u, v)
        tension = law.tension_over_stretch(ufl.dot(line, line), sheet.stiffness, sheet.slack)
        return sheet.face.integral(tension * ufl.dot(line, test_line), RULE)

    def _lines(self, sheet: Sheet, u, v):
        """F a and grad(v) a."""
        F = kinematics.deformation_gradient(u)
        return ufl.dot(F, sheet.direction), ufl.dot(ufl.grad(v), sheet.direction)

    def energy(self, u):
        """Strain energy of the cords, J, in UFL."""

        def stored(sheet: Sheet):
            line, _ = self._lines(sheet, u, u)
            density = law.energy(ufl.sqrt(ufl.dot(line, line)), sheet.stiffness, sheet.slack)
            return sheet.face.integral(density, RULE)

        return _sum(stored(sheet) for sheet in self.sheets)

    def stress_prediction(self, u, before, du, v):
        """As fem.static.virtual_work.stress_prediction, of the cords."""

        def correction(sheet: Sheet):
            line, last = self._lines(sheet, u, before)[0], self._lines(sheet, before, v)[0]
            change = ufl.dot(ufl.grad(u - before), sheet.direction)
            given = sheet.stiffness, sheet.slack
            was = ufl.dot(last, last)
            predicted = law.tension_over_stretch(was, *given)
            predicted += law.tension_over_stretch_rate(was, *given) * 2 * ufl.dot(last, change)
            excess = predicted - law.tension_over_stretch(ufl.dot(line, line), *given)
            bending = ufl.dot(
                ufl.dot(ufl.grad(du), sheet.direction), ufl.dot(ufl.grad(v), sheet.direction)
            )
            return sheet.face.integral(excess * bending, RULE)

        return _sum(correction(sheet) for sheet in self.sheets)

    def inertia(self, integrand, kind: str = "full"):
        """int (mass per area) integrand over all plies that have mass, in UFL."""
        if not any(one.mass for one in self.cords):
            return 0
        return _sum(sheet.face.integral(sheet.mass * integrand, kind) for sheet in self.sheets)


RULE = "reduced"


def _sum(forms):
    """The sum of UFL forms; 0 of none."""
    return sum(forms)


def _sheets(mesh, order: int, cords: Sequence[Cords], laid: Sequence[Laid]) -> list[Sheet]:
    """As few sheets as hold all plies: one a face of the cells, and more where plies lie on each other."""
    count = mesh.topology.index_map(3)
    blank = np.full(count.size_local + count.num_ghosts, -1)
    filled: dict[tuple[int, int, int], tuple[np.ndarray, np.ndarray]] = {}
    for one in laid:
        for slot in itertools.count():
            key = one.axis, one.side, slot
            owner, turn = filled.setdefault(key, (blank.copy(), np.ones(len(blank))))
            taken = bool((owner[one.cells] >= 0).any())
            if not mesh.comm.allreduce(taken, op=MPI.LOR):
                break
        owner[one.cells] = one.number
        turn[one.cells] = -1.0 if one.reverse else 1.0
    faces = {key[:2]: Face(mesh, *key[:2], order) for key in filled}
    return [Sheet(faces[key[:2]], *filled[key], cords) for key in sorted(filled)]


def laid_on(tire: TireMesh, cords: Sequence[Cords]) -> list[Laid]:
    """Where the cords lie: on the section's plies of their names. Raises InputError where one has no ply, or a
    ply no cords. Not collective.
    """
    section = tire.ring.section
    names = [one.name for one in cords]
    for name in section.plies:
        if name not in names:
            raise InputError(f"section: ply {name!r} has no cords")
    out = []
    for number, name in enumerate(names):
        if name not in section.plies:
            raise InputError(f"cords {name!r}: the section has no ply of that name")
        chain = section.plies[name]
        reverse = _turned(section, chain)
        for side, other in itertools.product(range(4), (False, True)):
            marked = np.zeros(len(section.cells), bool)
            marked[chain[(chain[:, 1] == side) & (reverse == other), 0]] = True
            if marked.any():
                cells = np.flatnonzero(marked[tire.section_cell])
                out.append(Laid(number, cells, 1 + side // 2, side % 2, other))
    return out


def _turned(section: SectionMesh, chain: np.ndarray) -> np.ndarray:
    """Whether e_arc x e_circ, e_arc along the chain, points into the cell of each edge (k,)."""
    start = section.chain(chain)[:: section.order][:-1]
    ascends = section.side(chain)[:, 0] == start
    # (xi, eta) is right-handed in (r, y): the normal that leaves xi = 1 is eta's direction turned
    # clockwise, as e_arc x e_circ is e_arc.
    return ascends != np.isin(chain[:, 1], (1, 2))
