"""The choice of the contact solver."""

import numpy as np

from tireroad.contact.solver.complementarity import ActiveSet
from tireroad.contact.solver.conditions import Array, ContactSolver, checked_compliance
from tireroad.contact.solver.grid_compliance import Compliance, MatrixCompliance
from tireroad.contact.solver.projected_cg import ProjectedCG
from tireroad.contact.solver.usual_set import UsualSet
from tireroad.fem.errors import InputError


def make_solver(name: str, matrix: Array | Compliance) -> ContactSolver:
    """The solver "active-set", "projected-cg" or "snes-vi" (`contact.solver`); else InputError.

    For a compliance that is a product, the active set is found from the set that usually touches,
    with a matrix of these points only.
    """
    if name == "snes-vi":
        from tireroad.contact.solver.snes_vi import SnesVI  # PETSc only if requested

        return SnesVI(matrix)
    if name not in ("active-set", "projected-cg"):
        raise InputError(
            f'contact.solver = "{name}" is unknown: take "active-set", "projected-cg" or "snes-vi"'
        )
    if isinstance(matrix, np.ndarray):
        whole = MatrixCompliance(checked_compliance(matrix))
        return ActiveSet(whole) if name == "active-set" else ProjectedCG(whole)
    return UsualSet(matrix) if name == "active-set" else ProjectedCG(matrix)
