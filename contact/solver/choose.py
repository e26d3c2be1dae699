"""The contact solver that a scene names."""

from tireroad.contact.solver.complementarity import ActiveSet
from tireroad.contact.solver.conditions import Array, ContactSolver
from tireroad.contact.solver.grid_compliance import Compliance
from tireroad.fem.errors import InputError


def make_solver(name: str, matrix: Array | Compliance) -> ContactSolver:
    """The solver named "active-set" or "snes-vi" (`contact.solver`). InputError for another."""
    if name == "active-set":
        return ActiveSet(matrix)
    if name == "snes-vi":
        from tireroad.contact.solver.snes_vi import SnesVI  # PETSc only where it is asked for

        return SnesVI(matrix)
    raise InputError(f'contact.solver = "{name}" is unknown: take "active-set" or "snes-vi"')
