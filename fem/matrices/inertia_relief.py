"""Static flexibility of a tire that nothing holds: inertia relief.

A rigid motion R has no stiffness, so K has no inverse. A load is balanced by the inertia of the rigid
motions it sets off, and the answer is measured beside them:

    G = P K^+ P^T,   P = 1 - R R^T M,   R^T M R = 1   (MacNeal, Comput. Struct. 1 (1971) 581)

K^+: as many of the rim's unknowns as there are rigid motions are held, which takes no force from a
balanced load.
"""

from __future__ import annotations

import numpy as np
from petsc4py import PETSc
from scipy import linalg, sparse

from tireroad.fem.collective import summed
from tireroad.fem.errors import ConvergenceError
from tireroad.fem.matrices.direct import RESIDUAL_TOLERANCE, multiply, solve_all
from tireroad.fem.matrices.operators import Operators
from tireroad.fem.matrices.support import rigid_motions

_ZERO = 1e-11  # of the largest K_ii / M_ii: motions with less have no stiffness, rounding is 1e-15


def rigid_space(operators: Operators) -> np.ndarray:
    """Own rows (n, r) of the M-orthonormal rigid motions without stiffness, found on K. Collective.

    Of the six motions of the deformed body those K gives no force: none with a clamped rim, six with a
    free one without a road.
    """
    body, unknowns, mass = operators.body, operators.unknowns, operators.mass[:, None]
    if unknowns.rim is None:
        return np.zeros((len(mass), 0))
    points = body.lattice.points(body.ids) + body.owned(body.u.x.array)
    motions = rigid_motions(points)[unknowns.free]
    if unknowns.rim.mine:
        motions = np.vstack([motions, np.linalg.inv(unknowns.rim.coordinates)])
    comm = body.comm
    inertia = comm.allreduce(motions.T @ (mass * motions))
    motions = motions @ np.linalg.inv(np.linalg.cholesky(inertia)).T
    forces = multiply(operators.stiffness, motions)
    sizes, turn = np.linalg.eigh(summed(comm, forces.T @ (forces / mass)))
    stiffest = comm.allreduce((operators.stiffness.getDiagonal().array / mass[:, 0]).max())
    return motions @ turn[:, sizes <= (_ZERO * stiffest) ** 2]


def statics(operators: Operators, stiffness: PETSc.Mat, loads: sparse.csr_matrix) -> np.ndarray:
    """Own rows (n, p) of the shapes under constant loads: K^-1 loads, or relieved with a free rim,
    whose tire has to stand. Collective.
    """
    if operators.unknowns.rim is None:
        return solve_all(stiffness, loads)
    return relieved(operators, loads)


def relieved(operators: Operators, loads: sparse.csr_matrix) -> np.ndarray:
    """Own rows of G loads (n, p); K^-1 loads where nothing is rigid. Collective.

    Raises ConvergenceError when the balanced loads still press on what was held.
    """
    stiffness, comm = operators.stiffness, operators.body.comm
    rigid = rigid_space(operators)
    if not rigid.shape[1]:
        return solve_all(stiffness, loads)
    weighted = operators.mass[:, None] * rigid
    balanced = loads.toarray()
    balanced -= weighted @ summed(comm, rigid.T @ balanced)
    held = _determinate(operators, rigid)
    supported = stiffness.copy()
    typical = stiffness.getDiagonal().norm() / np.sqrt(stiffness.getSize()[0])
    supported.zeroRowsColumns(held + supported.getOwnershipRange()[0], typical)
    supported.setOption(PETSc.Mat.Option.SYMMETRIC, True)
    forces = balanced.copy()
    forces[held] = 0.0
    answer = solve_all(supported, sparse.csc_matrix(forces))
    supported.destroy()
    defect = multiply(stiffness, answer) - balanced
    worst, size = comm.allreduce(np.array([(defect**2).sum(), (balanced**2).sum()]))
    if not worst <= RESIDUAL_TOLERANCE**2 * size:
        raise ConvergenceError(
            f"greens: the balanced loads leave a relative force of {np.sqrt(worst / size):.1e} on the "
            "supports of the free tire: its rigid-body modes are not clearly separated from soft ones. Refine the mesh."
        )
    return answer - rigid @ summed(comm, weighted.T @ answer)


def _determinate(operators: Operators, rigid: np.ndarray) -> np.ndarray:
    """Own rows, all of the rim, that hold the rigid motions and no more."""
    rim, count = operators.unknowns.rim, rigid.shape[1]
    if rim is None or not rim.mine:
        return np.zeros(0, PETSc.IntType)
    chosen = linalg.qr(rigid[-6:].T, pivoting=True)[2][:count]
    return (len(rigid) - 6 + np.sort(chosen)).astype(PETSc.IntType)
