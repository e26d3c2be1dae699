"""What joins the modes of a basis: static shapes with their inertia, the air, the wheel.

    R <- R - Phi (Phi^T M R),  Psi = R V with Psi^T M Psi = I, Psi^T K Psi diagonal

The pseudo-modes Psi are M-orthonormal to the modes and to each other, so all that is done with modes is done with
them; coupled to the modes through G, S and B. Eigenvectors are K-orthogonal to all that they are M-orthogonal to;
shapes are not: those that joined before and those that join now are one space, and K diagonal on all of it.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from mpi4py import MPI

from tireroad.fem.axle import Axle
from tireroad.fem.cavity.column import Column
from tireroad.fem.collective import summed
from tireroad.fem.matrices.operators import Operators
from tireroad.fem.matrices.rim_motion import RimMotion
from tireroad.modal.air import Air
from tireroad.modal.basis import Projection
from tireroad.modal.corner import meeting
from tireroad.modal.solver.fields import between, gram
from tireroad.modal.solver.modes import Modes

Array = np.ndarray

# Share of the largest squared length below which a direction is rounding of the orthogonalisation.
_ROUNDING = 1e-12
_ROWS = 4096  # of all fields at a time, when they are changed in place


def joined(modes: Modes, columns: Array, operators: Operators) -> Modes:
    """Modes of K and M (not K_Omega) followed by pseudo-modes, those of before among them, ascending. Collective.

    `columns` own rows (n, p) of R, which are used up: of a thousand loads on a fine mesh every copy takes a gigabyte.
    """
    comm, root = operators.body.comm, np.sqrt(operators.mass)[:, None]
    basis, extra = root * modes.vectors, columns
    extra *= root
    whole = summed(comm, np.einsum("ij,ij->j", extra, extra))
    extra /= np.sqrt(np.where(whole > 0, whole, 1.0))  # a load on the clamped rim moves nothing
    for _ in range(2):  # once leaves what the first pass's rounding brought back
        take_off(extra, basis, gram(comm, basis, extra))
    lengths, directions = np.linalg.eigh(gram(comm, extra, extra))
    kept = lengths > _ROUNDING
    extra = combined(extra, directions[:, kept] / np.sqrt(lengths[kept]), extra)
    take_off(extra, basis, gram(comm, basis, extra))
    del basis
    extra = combined(extra, np.linalg.inv(np.linalg.cholesky(gram(comm, extra, extra))).T, extra)
    extra /= root
    vectors = np.hstack([modes.vectors, extra])
    del extra
    shapes = vectors[:, modes.count :]
    squares, turn = np.linalg.eigh(between(comm, shapes, operators.stiffness, shapes))
    combined(shapes, turn, shapes)
    squares = np.concatenate([modes.squares[: modes.count], squares])
    return replace(modes, squares=squares, vectors=vectors)


def take_off(fields: Array, basis: Array, shares: Array) -> None:
    """fields (n, p) -= basis (n, m) shares (m, p), in place."""
    for start in range(0, len(fields), _ROWS):
        rows = slice(start, start + _ROWS)
        fields[rows] -= basis[rows] @ shares


def combined(fields: Array, change: Array, out: Array) -> Array:
    """fields (n, p) change (p, k) in the first columns of `out`, which may be the fields themselves."""
    out = out[:, : change.shape[1]]
    for start in range(0, len(fields), _ROWS):
        rows = slice(start, start + _ROWS)
        out[rows] = fields[rows] @ change
    return out


def with_corner(
    projection: Projection,
    modes: Modes,
    axle: Axle | None,
    rim: RimMotion | None,
    places: np.ndarray,
    comm: MPI.Comm,
) -> Projection:
    """The projection on the modes (all rows), joined by the wheel, one that is held where `axle` is None; `places` (s, 3) m
    of the outer face in the static state; as it is without a `rim`. Collective."""
    if rim is None:
        return projection
    return replace(
        projection, corner=meeting(axle or Axle.held(), rim, modes.vectors, places, comm)
    )


def with_air(projection: Projection, modes: Modes, air: Column | None) -> Projection:
    """The projection on the modes (all rows), joined by the air where there is any. Collective."""
    return replace(projection, air=Air(air.duct, air.coupling(modes.vectors)) if air else None)
