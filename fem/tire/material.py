"""Interface of a material law: its parameters and strain energy.

A new law is one file in fem.tire.laws, or a class in a user's script, with its parameters (unit and
range), the energy, and the two moduli at zero strain. The scene's keys, `check`, the key reference
and the range tests follow from it.

A rubber: strain energy, density, and dynamic properties for small motions.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, ClassVar

from tireroad.fem.errors import InputError
from tireroad.fem.parameters import Parameters, Registry

if TYPE_CHECKING:
    from ufl.core.expr import Expr


class MaterialLaw(Parameters):
    """Base of hyperelastic laws, each a function of the right Cauchy-Green tensor C alone.

    `coefficients` names the attributes that `energy` takes, in order. They become fields on the
    mesh, so that other values need no recompilation.
    """

    owner = "material"
    coefficients: ClassVar[tuple[str, ...]]

    @property
    def shear(self) -> float:
        """Shear modulus at zero strain, Pa."""
        raise NotImplementedError

    @property
    def bulk(self) -> float:
        """Bulk modulus at zero strain, Pa."""
        raise NotImplementedError

    @property
    def youngs(self) -> float:
        """Young's modulus at zero strain, Pa: 9 K G / (3 K + G)."""
        return 9 * self.bulk * self.shear / (3 * self.bulk + self.shear)

    @property
    def poisson(self) -> float:
        """Poisson's ratio at zero strain: (3 K - 2 G) / (6 K + 2 G)."""
        return (3 * self.bulk - 2 * self.shear) / (6 * self.bulk + 2 * self.shear)

    @staticmethod
    def energy(C: Expr, *coefficients: Expr) -> tuple[Expr, Expr]:
        """Energy per undeformed volume (J/m3) in UFL as (distortion, dilatation): the two are
        integrated with different quadrature rules (fem.static.virtual_work)."""
        raise NotImplementedError


MATERIALS: Registry[MaterialLaw] = Registry("material model", "tireroad.fem.tire.laws", MaterialLaw)
material_law = MATERIALS.register


@dataclass(frozen=True, kw_only=True)
class Material:
    """A rubber with strain energy `law` and `density` (kg/m3).

    `dynamic`: ratio of the moduli for small motions and for the static state; `loss_factor` for
    small motions.
    """

    law: MaterialLaw
    density: float
    dynamic: float = 1.0
    loss_factor: float = 0.0

    def __post_init__(self) -> None:
        if not (self.density > 0 and math.isfinite(self.density)):
            raise InputError(f"material: density = {self.density:g} kg/m3 must be above 0")


def compound(
    model: str,
    density: float,
    *,
    dynamic: float = 1.0,
    loss_factor: float = 0.0,
    **parameters: Any,
) -> Material:
    """Material of law `model` (fem.tire.laws); `parameters` (Pa, -) not given at their defaults.

    Raises InputError for a value out of range or a parameter of another law.
    """
    law = MATERIALS[model]
    wrong = sorted(parameters.keys() - law.__dataclass_fields__.keys())
    if wrong:
        known = ", ".join(law.__dataclass_fields__)
        raise InputError(f"material {model}: unknown parameter {wrong[0]}; valid: {known}")
    return Material(
        law=law(**parameters), density=density, dynamic=dynamic, loss_factor=loss_factor
    )
