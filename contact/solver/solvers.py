"""Solvers of the normal contact of a step, by their names in `contact.solver`.

A solver is declared here; its module is imported when one is made. Only names are needed to read a scene.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from importlib import import_module
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from tireroad.fem.errors import InputError

if TYPE_CHECKING:
    from tireroad.contact.solver.conditions import ContactSolver
    from tireroad.contact.solver.projected_cg import Compliance


@dataclass(frozen=True)
class NormalSolver:
    """One solver: its `module` beside this one, its class for a compliance that is a matrix, and for a product.

    `about`: the method of a library that solves, for the log.
    """

    module: str
    of_matrix: str
    of_product: str
    about: str = ""


SOLVERS: Mapping[str, NormalSolver] = {
    # Of a product, from the set that usually touches, with a matrix of these points only.
    "active-set": NormalSolver("active_set", "ActiveSet", "UsualSet"),
    "projected-cg": NormalSolver("projected_cg", "ProjectedCG", "ProjectedCG"),
    "snes-vi": NormalSolver("snes_vi", "SnesVI", "SnesVI", "PETSc SNES vinewtonrsls"),
}


def make_solver(name: str, matrix: NDArray[np.float64] | Compliance) -> ContactSolver:
    """The solver of this name for a compliance (c, c) m/N, a matrix or a product.

    InputError for an unknown name, and for a matrix that is not square, positive and definite.
    """
    from tireroad.contact.solver.conditions import checked_compliance
    from tireroad.contact.solver.projected_cg import MatrixCompliance

    if name not in SOLVERS:
        raise InputError(f'contact.solver = "{name}" is unknown: take {", ".join(SOLVERS)}')
    kind = SOLVERS[name]
    of = kind.of_product
    if isinstance(matrix, np.ndarray):
        matrix, of = MatrixCompliance(checked_compliance(matrix)), kind.of_matrix
    solver: ContactSolver = getattr(import_module(f"{__package__}.{kind.module}"), of)(matrix)
    return solver
