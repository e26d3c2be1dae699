"""Attachment modes: the static shapes under the probes' loads join the basis, with their inertia.

    R = K_Omega^-1 B,  R <- R - Phi (Phi^T M R),  Psi = R V with Psi^T M Psi = I, Psi^T K Psi diagonal

The pseudo-modes Psi are M-orthonormal to the modes and to each other, so all that is done with modes
is done with them; coupled to the modes through G, S and B. (MacNeal 1971; Rubin, AIAA J. 13 (1975)
995.) Exact at 0 Hz: the exact static answer lies in the basis.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from mpi4py import MPI
from petsc4py import PETSc

from tireroad.modal.fields import gram, multiply
from tireroad.modal.undamped import Modes

# Share of the largest squared length below which a direction is rounding of the orthogonalisation.
_ROUNDING = 1e-12


def with_attachments(
    modes: Modes, stiffness: PETSc.Mat, mass: np.ndarray, columns: np.ndarray, comm: MPI.Comm
) -> Modes:
    """Modes followed by pseudo-modes, ascending among themselves. Collective.

    `stiffness` K (not K_Omega) and `mass` (own rows) of the modes, `columns` own rows (n, p) of R.
    """
    root = np.sqrt(mass)[:, None]
    basis, extra = root * modes.vectors, root * columns
    whole = np.diag(gram(comm, extra, extra))
    # A load on the clamped rim moves nothing.
    extra = extra[:, whole > 0] / np.sqrt(whole[whole > 0])
    for _ in range(2):  # once leaves what the first pass's rounding brought back
        extra = extra - basis @ gram(comm, basis, extra)
    lengths, directions = np.linalg.eigh(gram(comm, extra, extra))
    kept = lengths > _ROUNDING
    extra = extra @ (directions[:, kept] / np.sqrt(lengths[kept]))
    extra = extra - basis @ gram(comm, basis, extra)
    extra = extra @ np.linalg.inv(np.linalg.cholesky(gram(comm, extra, extra))).T
    shapes = extra / root
    squares, turn = np.linalg.eigh(gram(comm, shapes, multiply(stiffness, shapes)))
    return replace(
        modes,
        squares=np.concatenate([modes.squares, squares]),
        vectors=np.hstack([modes.vectors, shapes @ turn]),
    )
