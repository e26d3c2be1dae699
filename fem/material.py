"""Strain energies per undeformed volume, each a function of the right Cauchy-Green tensor C alone.

Compressible laws share the volumetric term kappa/2 (J - 1)^2, the form Abaqus and CalculiX use.
A new material is one more function and one more line in `energy`.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import ufl

from fem.errors import InputError


@dataclass(frozen=True)
class Material:
    """A rubber: law by name, moduli in Pa, density in kg/m3.

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

    @property
    def shear(self) -> float:
        """Shear modulus at zero strain, Pa."""
        if self.model in ("linear", "neo-hookean"):
            return self.youngs_modulus / (2 * (1 + self.poisson_ratio))
        return 2 * (self.c10 + self.c01)

    @property
    def bulk(self) -> float:
        """Bulk modulus at zero strain, Pa."""
        if self.model in ("linear", "neo-hookean"):
            return self.youngs_modulus / (3 * (1 - 2 * self.poisson_ratio))
        return self.bulk_modulus


def linear(C, material: Material):
    """Hooke's law between Green-Lagrange strain and second Piola-Kirchhoff stress."""
    E = (C - ufl.Identity(3)) / 2
    lame = material.bulk - 2 * material.shear / 3
    return material.shear * ufl.inner(E, E) + lame / 2 * ufl.tr(E) ** 2


def neo_hookean(C, material: Material):
    """mu/2 (J^(-2/3) tr C - 3) + kappa/2 (J - 1)^2."""
    first, _, volumetric = _split(C, material)
    return material.shear / 2 * (first - 3) + volumetric


def mooney_rivlin(C, material: Material):
    """c10 (I1 - 3) + c01 (I2 - 3) of the isochoric part, and the volumetric term."""
    first, second, volumetric = _split(C, material)
    return material.c10 * (first - 3) + material.c01 * (second - 3) + volumetric


def yeoh(C, material: Material):
    """c10 (I1 - 3) + c20 (I1 - 3)^2 + c30 (I1 - 3)^3 of the isochoric part, and the volumetric term."""
    first, _, volumetric = _split(C, material)
    terms = (material.c10, material.c20, material.c30)
    return sum(c * (first - 3) ** (i + 1) for i, c in enumerate(terms)) + volumetric


def _split(C, material: Material):
    """Isochoric invariants I1, I2 and the volumetric energy."""
    J = ufl.sqrt(ufl.det(C))
    first = ufl.tr(C)
    second = (first**2 - ufl.tr(C * C)) / 2
    return J ** (-2 / 3) * first, J ** (-4 / 3) * second, material.bulk / 2 * (J - 1) ** 2


_LAWS: dict[str, Callable] = {
    "linear": linear,
    "neo-hookean": neo_hookean,
    "mooney-rivlin": mooney_rivlin,
    "yeoh": yeoh,
}


def energy(C, material: Material):
    """Strain energy density of the material's law, J/m3."""
    if material.model not in _LAWS:
        raise InputError(f"material model {material.model!r}: known are {', '.join(_LAWS)}")
    return _LAWS[material.model](C, material)
