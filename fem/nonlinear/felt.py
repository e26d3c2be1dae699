"""The answer of the road to a load that a reduced force leaves out.

The linear tire answers such a load by up to ten times the motion that the tire itself does: its belts have moved, and resist
where they did not. So the answer is that of the elements' tangent K_T at the motion q, with the points that touch:

    K_T(q) e = -b + W n^T f,   f = -C n W^T e,

b the load left out, W from the contact's nodes, n normal to the road, C^-1 the compliance of the tread. Without inertia.
"""

from __future__ import annotations

import numpy as np
from scipy import sparse

from tireroad.fem.collective import summed
from tireroad.fem.matrices.compliance import factorise, solve_columns
from tireroad.fem.nonlinear.force import RestoringForce

Array = np.ndarray


def felt_by_road(
    force: RestoringForce, motion: Array, load: Array, normal: sparse.csr_matrix, tread: Array
) -> Array:
    """Forces f (t,) N at t points that touch by a load b (n,) N left out at a motion q (n,) m.

    `normal` W n^T (n, t) on own rows; `tread` (t, t) m/N. NearlySingular where K_T is. Collective.
    """
    stiffness, comm = force.tangent(motion, motion), force.body.comm
    factor = factorise(stiffness)
    try:
        shapes = solve_columns(factor, stiffness, np.column_stack([-load, normal.toarray()]))
    finally:
        factor.destroy()
        stiffness.destroy()
    seen = summed(comm, normal.T @ shapes)
    return -np.linalg.solve(seen[:, 1:] + tread, seen[:, 0])
