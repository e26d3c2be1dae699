"""A rubber: strain energy, density, and dynamic properties for small motions."""

from __future__ import annotations

import math
from dataclasses import dataclass

from tireroad.fem.errors import InputError
from tireroad.fem.tire.law import MATERIALS, MaterialLaw


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
    **parameters: float,
) -> Material:
    """Material of law `model` (fem.tire.laws); `parameters` (Pa, -) not given at their defaults.

    Raises InputError for a value out of range or a parameter of another law.
    """
    law = MATERIALS[model]
    wrong = sorted(parameters.keys() - law.__dataclass_fields__.keys())
    if wrong:
        known = ", ".join(law.__dataclass_fields__)
        raise InputError(f"material {model}: {wrong[0]} is none of its parameters: {known}")
    return Material(
        law=law(**parameters), density=density, dynamic=dynamic, loss_factor=loss_factor
    )
