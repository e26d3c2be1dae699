"""Invariants of the right Cauchy-Green tensor C in UFL, for the material laws."""

from __future__ import annotations

import ufl
from ufl.core.expr import Expr


def isochoric(C: Expr) -> tuple[Expr, Expr]:
    """Invariants I1 and I2 of J^(-2/3) C."""
    J = ufl.sqrt(ufl.det(C))
    first = ufl.tr(C)
    second = (first**2 - ufl.tr(C * C)) / 2
    return J ** (-2 / 3) * first, J ** (-4 / 3) * second


def dilatation(C: Expr, bulk: Expr) -> Expr:
    """kappa/2 (J - 1)^2, the form of Abaqus and CalculiX."""
    return bulk / 2 * (ufl.sqrt(ufl.det(C)) - 1) ** 2
