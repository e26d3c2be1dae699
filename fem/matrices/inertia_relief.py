"""Static flexibility of a free tire by inertia relief.

A rigid motion R has no stiffness, so K is singular. A load is balanced by the inertia forces of the
rigid acceleration it causes, and the response is made orthogonal to the rigid motions:

    G = P K^+ P^T,   P = 1 - R R^T M,   R^T M R = 1   (MacNeal, Comput. Struct. 1 (1971) 581)

For K^+ as many unknowns of the rim are held as there are rigid motions; a balanced load causes no
reaction there.
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

_ZERO = 1e-11  # of the largest K_ii / M_ii; motions below have no stiffness, rounding is 1e-15


def rigid_space(operators: Operators) -> np.ndarray:
    """Own rows (n, r) of the M-orthonormal rigid motions without stiffness. Collective.

    They are those of the deformed body's six rigid motions on which K exerts no force: none with a
    clamped rim, six with a free rim and no road.
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
    """Own rows (n, p) of the shapes under constant loads. Collective.

    K^-1 loads, or inertia relief with a free rim, for a standing tire only.
    """
    if operators.unknowns.rim is None:
        return solve_all(stiffness, loads)
    return relieved(operators, loads)


def relieved(operators: Operators, loads: sparse.csr_matrix) -> np.ndarray:
    """Own rows (n, p) of G loads; K^-1 loads if there is no rigid motion. Collective.

    Raises ConvergenceError if the balanced loads leave a reaction at the held unknowns.
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
    """Own indices of rim unknowns that restrain the rigid motions statically determinately."""
    rim, count = operators.unknowns.rim, rigid.shape[1]
    if rim is None or not rim.mine:
        return np.zeros(0, PETSc.IntType)
    chosen = linalg.qr(rigid[-6:].T, pivoting=True)[2][:count]
    return (len(rigid) - 6 + np.sort(chosen)).astype(PETSc.IntType)
