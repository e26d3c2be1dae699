"""Stiffness of the tire between rim and road for small motions of the road.

The nodes in contact move with the road as a rigid plate, R q (three translations, three rotations
about the footprint's centre), or without friction only vertically; the rim is held:

    S = R^T (K_hh - K_hf K_ff^-1 K_fh) R,

K being the static tangent. The whole footprint sticks. A real one slips at its edges under large
forces, so S is the initial slope of a test.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from dolfinx import fem
from petsc4py import PETSc
from scipy import sparse

from tireroad.fem import compat
from tireroad.fem.collective import summed
from tireroad.fem.errors import InputError
from tireroad.fem.matrices.compliance import multiply, solve_all
from tireroad.fem.matrices.operators import FIXED, Unknowns, rigid_motions
from tireroad.fem.static.virtual_work import AT_REST, Rolling, static_residual, tangent
from tireroad.fem.tire.body import Body

_VERTICAL = 2


@dataclass(frozen=True)
class RoadStiffness:
    """Road stiffness of a sticking and of a frictionless footprint.

    `matrix` (6, 6), sticking: force (N) and moment (N m) on the tire per x, y, z (m) and rotation
    about them (rad); `frictionless`: vertical stiffness of a footprint that slides freely, N/m.
    """

    matrix: np.ndarray
    frictionless: float

    def at_constant_load(self, motion: int) -> float:
        """Stiffness of one motion, N/m or N m/rad, at constant vertical load."""
        across = self.matrix[motion, _VERTICAL] * self.matrix[_VERTICAL, motion]
        return float(self.matrix[motion, motion] - across / self.matrix[_VERTICAL, _VERTICAL])

    @property
    def longitudinal(self) -> float:
        """N/m, at constant load."""
        return self.at_constant_load(0)

    @property
    def lateral(self) -> float:
        """N/m, at constant load."""
        return self.at_constant_load(1)

    @property
    def torsional(self) -> float:
        """N m/rad about the vertical, at constant load."""
        return self.at_constant_load(5)

    @property
    def asymmetry(self) -> float:
        """Largest relative difference from the transpose: zero without damping, by reciprocity."""
        scale = np.sqrt(np.outer(np.diag(self.matrix), np.diag(self.matrix)))
        return float(np.abs((self.matrix - self.matrix.T) / scale).max())


def road_stiffness(
    body: Body,
    inflation: float,
    nodes: np.ndarray,
    centre: np.ndarray,
    rolling: Rolling = AT_REST,
) -> RoadStiffness:
    """Road stiffness at the body's present displacement. Collective.

    `inflation` Pa; `nodes`: this process's indices of the nodes in contact; `centre` (3,) m of the
    road's rotations. Raises InputError for fewer than three nodes.
    """
    count = body.comm.allreduce(len(nodes))
    if count < 3:
        raise InputError(
            f"stiffness: {count} node(s) touch the road, and at least three are needed to stick to a plate: "
            "raise static.load, or refine tire.segments, tire.elements_arc or tire.footprint_size"
        )
    unknowns = Unknowns(body, FIXED)
    stiffness = _static_tangent(body, unknowns, inflation, rolling)
    places = body.lattice.points(body.ids) + body.owned(body.u.x.array)
    motions = rigid_motions(places - centre)[unknowns.free]
    touching = np.isin(unknowns.free // 3, nodes)
    matrix = _condensed(stiffness, motions, touching)
    upright = touching & (unknowns.component == _VERTICAL)
    vertical = _condensed(stiffness, motions[:, [_VERTICAL]], upright)
    stiffness.destroy()
    return RoadStiffness(matrix, float(vertical[0, 0]))


def _static_tangent(
    body: Body, unknowns: Unknowns, inflation: float, rolling: Rolling
) -> PETSc.Mat:
    """K with static moduli, N/m. Collective."""
    residual = static_residual(body, fem.Constant(body.mesh, inflation), rolling)
    matrix = fem.petsc.assemble_matrix(compat.form(tangent(body, residual)))
    matrix.assemble()
    reduced = unknowns.reduced(matrix)
    matrix.destroy()
    reduced.setOption(PETSc.Mat.Option.SYMMETRIC, rolling.speed * rolling.damping == 0)
    return reduced


def _condensed(stiffness: PETSc.Mat, motions: np.ndarray, held: np.ndarray) -> np.ndarray:
    """R^T S R (k, k) for held unknowns moved by `motions`, own rows (n, k). Collective."""
    moved = np.where(held[:, None], motions, 0.0)
    loads = -multiply(stiffness, moved)
    loads[held] = 0.0
    supported = stiffness.copy()
    rows = (np.flatnonzero(held) + supported.getOwnershipRange()[0]).astype(PETSc.IntType)
    typical = stiffness.getDiagonal().norm() / np.sqrt(stiffness.getSize()[0])
    supported.zeroRowsColumns(rows, typical)
    known, symmetric = stiffness.isSymmetricKnown()
    supported.setOption(PETSc.Mat.Option.SYMMETRIC, bool(known and symmetric))
    answer = moved + solve_all(supported, sparse.csc_matrix(loads))
    supported.destroy()
    force = multiply(stiffness, answer)
    comm = stiffness.comm.tompi4py()
    return summed(comm, moved.T @ force)
