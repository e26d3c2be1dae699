"""Additions to the modes of a basis: static shapes with their inertia, the air, the wheel.

    R <- R - Phi (Phi^T M R),  Psi = R V with Psi^T M Psi = I, Psi^T K Psi diagonal

The pseudo-modes Psi are M-orthonormal to the modes and to each other, so all later steps treat them
as modes; G, S and B couple them to the modes. Eigenvectors are K-orthogonal to all that they are
M-orthogonal to, but static shapes are not: shapes that joined earlier and those that join now form
one space, on all of which K is made diagonal.
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

# Fraction of the largest squared length below which a direction is rounding.
_ROUNDING = 1e-12
_ROWS = 4096  # of all fields at a time, when they are changed in place


def joined(modes: Modes, columns: Array, operators: Operators) -> Modes:
    """Modes of K and M (not K_Omega) followed by pseudo-modes, earlier ones among them, ascending.
    Collective.

    `columns`, own rows (n, p) of R, are overwritten: with a thousand loads on a fine mesh a copy
    takes a gigabyte.
    """
    comm, root = operators.body.comm, np.sqrt(operators.mass)[:, None]
    basis, extra = root * modes.vectors, columns
    extra *= root
    whole = summed(comm, np.einsum("ij,ij->j", extra, extra))
    extra /= np.sqrt(np.where(whole > 0, whole, 1.0))  # a load on the clamped rim moves nothing
    for _ in range(2):  # the second pass removes the rounding of the first
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
    """fields (n, p) change (p, k), in the first columns of `out`, which may be `fields`."""
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
    """The projection on the modes (all rows), with the wheel added; unchanged without a `rim`.

    The wheel is held where `axle` is None. `places` (s, 3) m of the outer face in the static state.
    Collective.
    """
    if rim is None:
        return projection
    return replace(
        projection, corner=meeting(axle or Axle.held(), rim, modes.vectors, places, comm)
    )


def with_air(projection: Projection, modes: Modes, air: Column | None) -> Projection:
    """The projection on the modes (all rows), with the air added where there is any. Collective."""
    return replace(projection, air=Air(air.duct, air.coupling(modes.vectors)) if air else None)
