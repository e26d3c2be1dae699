"""Strain energies per undeformed volume, each a function of the right Cauchy-Green tensor C alone.

An energy comes in two parts, (distortion, dilatation), because they are integrated by different rules
(fem.static.equilibrium). Compressible laws share the dilatation kappa/2 (J - 1)^2, the form Abaqus and
CalculiX use. A new material is one more function and one more line in `LAWS`.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import ufl

from tireroad.fem.errors import InputError


@dataclass(frozen=True)
class Material:
    """A rubber: law by name, moduli in Pa, density in kg/m3.

    `dynamic`: modulus of small motions over that of the static state; `loss_factor` of small motions.

    Laws of Young's modulus and Poisson's ratio leave the coefficients at 0, and the others way round.
    """

    model: str
    density: float
    youngs_modulus: float = 0.0
    poisson_ratio: float = 0.0
    c10: float = 0.0
    c01: float = 0.0
    c20: float = 0.0
    c30: float = 0.0
    bulk_modulus: float = 0.0
    dynamic: float = 1.0
    loss_factor: float = 0.0

    def __post_init__(self) -> None:
        if self.model not in LAWS:
            raise InputError(f"material model {self.model!r}: known are {', '.join(LAWS)}")
        if not self.density > 0:
            raise InputError(f"material: density = {self.density:g} kg/m3 must be above 0")
        if not -1 < self.poisson_ratio < 0.5:
            raise InputError(
                f"material: poisson_ratio = {self.poisson_ratio:g} must lie between -1 and 0.5; 0.4995 is "
                "nearly incompressible"
            )
        for name in ("shear", "bulk"):
            if not getattr(self, name) > 0:
                raise InputError(
                    f"material {self.model!r}: its {name} modulus is {getattr(self, name):g} Pa: give "
                    "youngs_modulus and poisson_ratio, or c10 and bulk_modulus, as the law takes them"
                )

    @property
    def shear(self) -> float:
        """Shear modulus at zero strain, Pa."""
        if "shear" in LAWS[self.model].coefficients:
            return self.youngs_modulus / (2 * (1 + self.poisson_ratio))
        return 2 * (self.c10 + self.c01)

    @property
    def bulk(self) -> float:
        """Bulk modulus at zero strain, Pa."""
        if "shear" in LAWS[self.model].coefficients:
            return self.youngs_modulus / (3 * (1 - 2 * self.poisson_ratio))
        return self.bulk_modulus


def linear(C, shear, bulk):
    """Hooke's law between Green-Lagrange strain and second Piola-Kirchhoff stress."""
    E = (C - ufl.Identity(3)) / 2
    return shear * ufl.inner(ufl.dev(E), ufl.dev(E)), bulk / 2 * ufl.tr(E) ** 2


def neo_hookean(C, shear, bulk):
    """mu/2 (J^(-2/3) tr C - 3) and kappa/2 (J - 1)^2."""
    first, _ = _isochoric(C)
    return shear / 2 * (first - 3), _dilatation(C, bulk)


def mooney_rivlin(C, c10, c01, bulk):
    """c10 (I1 - 3) + c01 (I2 - 3) of the isochoric part, and the common dilatation."""
    first, second = _isochoric(C)
    return c10 * (first - 3) + c01 * (second - 3), _dilatation(C, bulk)


def yeoh(C, c10, c20, c30, bulk):
    """c10 (I1 - 3) + c20 (I1 - 3)^2 + c30 (I1 - 3)^3 of the isochoric part, and the common dilatation."""
    first, _ = _isochoric(C)
    terms = (c * (first - 3) ** (i + 1) for i, c in enumerate((c10, c20, c30)))
    return sum(terms), _dilatation(C, bulk)


def _isochoric(C):
    """Invariants I1 and I2 of J^(-2/3) C."""
    J = ufl.sqrt(ufl.det(C))
    first = ufl.tr(C)
    second = (first**2 - ufl.tr(C * C)) / 2
    return J ** (-2 / 3) * first, J ** (-4 / 3) * second


def _dilatation(C, bulk):
    return bulk / 2 * (ufl.sqrt(ufl.det(C)) - 1) ** 2


@dataclass(frozen=True)
class Law:
    """An energy as a function of C and of coefficients, named as attributes of `Material`."""

    energy: Callable
    coefficients: tuple[str, ...]


LAWS = {
    "linear": Law(linear, ("shear", "bulk")),
    "neo-hookean": Law(neo_hookean, ("shear", "bulk")),
    "mooney-rivlin": Law(mooney_rivlin, ("c10", "c01", "bulk")),
    "yeoh": Law(yeoh, ("c10", "c20", "c30", "bulk")),
}
