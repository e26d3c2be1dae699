"""Axisymmetric state of the inflated tire without a road, from one section.

With P from the motion of the section's nodes, in circumferential, axial and radial directions, to
all nodes of a sector of one element around,

    P^T (F_int(P v) + p F_pressure(P v) + Omega^2 S (X + P v)) = 0.

The boundary terms of the two cut faces cancel in an axisymmetric motion. Angled belts may rotate
the crown relative to the beads; that is axisymmetric too. Damping by mass or stiffness has no
effect in an axisymmetric shape.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
from mpi4py import MPI
from petsc4py import PETSc
from scipy import sparse
from scipy.sparse.linalg import SuperLU, splu

from tireroad.fem.errors import LoadingStopped
from tireroad.fem.static.equilibrium import Equilibrium
from tireroad.fem.static.tangent import Moved
from tireroad.fem.static.virtual_work import AT_REST, Rolling
from tireroad.fem.timing import Timing
from tireroad.fem.tire.body import Body
from tireroad.fem.tire.mesh import Lattice


class RoundEquilibrium(Equilibrium):
    """Equilibrium of a ring's axisymmetric shape, on the shortest of its elements around.

    On the calling process only. The state is `body.u` of its own `body`, a sector.
    """

    def __init__(self, whole: Body, rolling: Rolling) -> None:
        ring = whole.ring
        angle = float(np.diff(ring.ring_corners).min())
        sector = replace(ring, ring_corners=np.array([0.0, angle]), coarser=lambda: None)
        body = Body(MPI.COMM_SELF, sector, whole.materials, cords=whole.plies.cords)
        self._turned = _turned(body)
        super().__init__(body, replace(rolling, damping=0.0, stiffness_damping=0.0))

    def _make_system(self, kind: str) -> RoundSystem:
        return RoundSystem(self._turned, self.cost)

    def _assemble_residual(self) -> np.ndarray:
        """The axisymmetric part of the residual forces, N."""
        copies = self.body.lattice.shape[0]
        return self._turned @ (self._turned.T @ super()._assemble_residual()) / copies

    def on(self, lattice: Lattice) -> np.ndarray:
        """The displacement (n, 3) m at the nodes of the whole ring's lattice."""
        local = np.empty((self.body.lattice.shape[1], 3))
        first = self.body.ids < len(local)
        local[self.body.ids[first]] = self.body.owned(self.body.u.x.array)[first]
        along, across, down = local.T  # at the angle 0, the lowest point
        sine, cosine = np.sin(lattice.ring)[:, None], np.cos(lattice.ring)[:, None]
        parts = cosine * along - sine * down, np.tile(across, (len(sine), 1))
        return np.stack([*parts, sine * along + cosine * down], axis=-1).reshape(-1, 3)


def inflated(
    whole: Body, rolling: Rolling, inflate: Callable[[RoundEquilibrium], None]
) -> RoundEquilibrium:
    """The axisymmetric shape inflated by `inflate`; if rotation prevents it, via that at rest.

    Cords not yet tensioned by the pressure give way under centrifugal forces. The radial tire's
    section of 34 elements from bead to bead at 71.9 rad/s stops at 13 Pa, but converges in two
    tangents from the inflated state at rest. On the calling process only. Raises LoadingStopped if
    the state at rest does not help either.
    """
    section = RoundEquilibrium(whole, rolling)
    try:
        inflate(section)
    except LoadingStopped:
        if not rolling.speed:
            raise
        still = RoundEquilibrium(whole, AT_REST)
        inflate(still)
        section.body.u.x.array[:] = still.body.u.x.array
        inflate(section)
    return section


class RoundSystem:
    """P^T K P of the sector, the counterpart of `HeldSystem`; no dof is held."""

    def __init__(self, turned: sparse.csr_matrix, timing: Timing) -> None:
        self._turned, self._timing = turned, timing
        self.closing = self.raising = Moved(np.zeros(turned.shape[0]), np.zeros(turned.shape[0]))
        self._factor: SuperLU | None = None

    def take(
        self, matrix: PETSc.Mat, held: np.ndarray, closing: np.ndarray, raising: np.ndarray
    ) -> bool:
        """Factorise; False if the matrix is singular."""
        rows, columns, values = matrix.getValuesCSR()
        whole = sparse.csr_matrix((values, columns, rows), matrix.getSize())
        with self._timing("factorisation"):
            try:
                self._factor = splu((self._turned.T @ whole @ self._turned).tocsc())
            except RuntimeError:  # SuperLU: "Factor is exactly singular"
                return False
        return True

    def solve(self, right: np.ndarray, moved: Moved | None = None) -> tuple[np.ndarray, np.ndarray]:
        """Motion (m) of all dofs of the sector under forces (N), and no reactions."""
        assert self._factor is not None, "take() comes before"
        with self._timing("solve"):
            change = self._turned @ self._factor.solve(self._turned.T @ right)
        return change, np.zeros(0)


def _turned(body: Body) -> sparse.csr_matrix:
    """P (3 nodes, 3 free nodes of the section)."""
    angle, node = np.divmod(body.ids, body.lattice.shape[1])
    held = np.zeros(body.lattice.shape[1], bool)
    held[node[body.rim]] = True
    number = np.cumsum(~held) - 1
    own = np.flatnonzero(~held[node])
    sine, cosine = (f(body.lattice.ring[angle[own]]) for f in (np.sin, np.cos))
    one, none = np.ones(len(own)), np.zeros(len(own))
    axes = np.array([[cosine, none, sine], [none, one, none], [sine, none, -cosine]])
    rows = np.broadcast_to((3 * own + np.arange(3)[:, None])[:, None], axes.shape)
    columns = np.broadcast_to((3 * number[node[own]] + np.arange(3)[:, None])[None], axes.shape)
    size = 3 * body.nodes, 3 * int((~held).sum())
    return sparse.csr_matrix((axes.ravel(), (rows.ravel(), columns.ravel())), size)
