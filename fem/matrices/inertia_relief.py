"""Static flexibility of a free tire by inertia relief.

A rigid motion R has no stiffness, so K is singular. A load is balanced by the inertia forces of the
rigid acceleration it causes, and the response is made orthogonal to the rigid motions:

    G = P K^+ P^T,   P = 1 - R R^T M,   R^T M R = 1   (MacNeal, Comput. Struct. 1 (1971) 581)

For K^+ as many unknowns of the rim are held as there are rigid motions; a balanced load causes no
reaction there.

By frame indifference K R of a rotation is the moment of the static forces that do not turn with the
tire. The doppler inertia leaves some where there should be none: Omega^2 S_B u of a shape that is
round but for its elements. A balanced load then causes a small reaction, which is balanced and
solved for again until none is left.
"""

from __future__ import annotations

import numpy as np
from petsc4py import PETSc
from scipy import linalg, sparse

from tireroad.fem.collective import summed
from tireroad.fem.errors import ConvergenceError
from tireroad.fem.matrices.direct import (
    RESIDUAL_TOLERANCE,
    factorise,
    multiply,
    solve_all,
    solve_columns,
)
from tireroad.fem.matrices.operators import Operators
from tireroad.fem.matrices.support import rigid_motions

# Of the norm of M^-1/2 K M^-1/2: stiffnesses nearer to zero are none, rounding is 1e-16. The modes
# and the static shapes of a tire must agree on it.
RIGID = 1e-12
_PASSES = 8  # each reduces what is out of balance at least a thousandfold where motions are rigid


def rigid_space(operators: Operators) -> np.ndarray:
    """Own rows (n, r) of the M-orthonormal rigid motions without stiffness. Collective.

    They are those of the deformed body's six rigid motions that store no energy R^T K R: none with a
    clamped rim, six with a free rim and no road, but three when centrifugal forces act, which do
    not turn with the tire. The forces K R tell less: they are nonzero already where the stiffness,
    of second order in them, is rounding.
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
    energy = summed(comm, motions.T @ multiply(operators.stiffness, motions))
    squares, turn = np.linalg.eigh((energy + energy.T) / 2)
    return motions @ turn[:, np.abs(squares) <= RIGID * _norm(operators)]


def _norm(operators: Operators) -> float:
    """Largest row sum of M^-1/2 K M^-1/2, 1/s2. Collective."""
    scaled = operators.stiffness.copy()
    roots = scaled.createVecLeft()
    roots.array[:] = 1 / np.sqrt(operators.mass)
    scaled.diagonalScale(roots, roots)
    norm = float(scaled.norm(PETSc.NormType.NORM_INFINITY))
    scaled.destroy()
    roots.destroy()
    return norm


def statics(operators: Operators, stiffness: PETSc.Mat, loads: sparse.csr_matrix) -> np.ndarray:
    """Own rows (n, p) of the shapes under constant loads. Collective.

    K^-1 loads, or inertia relief with a free rim, for a standing tire only.
    """
    if operators.unknowns.rim is None:
        return solve_all(stiffness, loads)
    return relieved(operators, loads)


def relieved(operators: Operators, loads: sparse.csr_matrix) -> np.ndarray:
    """Own rows (n, p) of G loads; K^-1 loads if there is no rigid motion. Collective.

    Raises ConvergenceError if the balanced loads stay out of balance.
    """
    stiffness, comm = operators.stiffness, operators.body.comm
    rigid = rigid_space(operators)
    if not rigid.shape[1]:
        return solve_all(stiffness, loads)
    weighted = operators.mass[:, None] * rigid
    given = loads.toarray()
    balanced = defect = given - weighted @ summed(comm, rigid.T @ given)
    held, supported = _determinate(operators, rigid)
    factor, answer = factorise(supported), np.zeros_like(given)
    for _ in range(_PASSES):
        forces = defect.copy()
        forces[held] = 0.0
        answer += solve_columns(factor, supported, forces)
        answer -= rigid @ summed(comm, weighted.T @ answer)
        defect = given - multiply(stiffness, answer)
        defect -= weighted @ summed(comm, rigid.T @ defect)
        worst, size = comm.allreduce(np.array([(defect**2).sum(), (balanced**2).sum()]))
        if worst <= RESIDUAL_TOLERANCE**2 * size:
            break
    else:
        raise ConvergenceError(_out_of_balance(np.sqrt(worst / size)))
    factor.destroy()
    supported.destroy()
    return answer


def _out_of_balance(relative: float) -> str:
    return (
        f"greens: the balanced loads leave a relative force of {relative:.1e} on the "
        "supports of the free tire: its rigid-body modes are not clearly separated from soft ones. Refine the mesh."
    )


def _determinate(operators: Operators, rigid: np.ndarray) -> tuple[np.ndarray, PETSc.Mat]:
    """Own indices of rim unknowns that restrain the rigid motions statically determinately, and K
    with these held. Collective."""
    rim, stiffness, count = operators.unknowns.rim, operators.stiffness, rigid.shape[1]
    held = np.zeros(0, PETSc.IntType)
    if rim is not None and rim.mine:
        chosen = linalg.qr(rigid[-6:].T, pivoting=True)[2][:count]
        held = (len(rigid) - 6 + np.sort(chosen)).astype(PETSc.IntType)
    supported = stiffness.copy()
    typical = stiffness.getDiagonal().norm() / np.sqrt(stiffness.getSize()[0])
    supported.zeroRowsColumns(held + supported.getOwnershipRange()[0], typical)
    supported.setOption(PETSc.Mat.Option.SYMMETRIC, True)
    return held, supported
